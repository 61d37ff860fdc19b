"""Pictures, plots and videos of walks and runs."""
