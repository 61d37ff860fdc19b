"""Training run: the compiled generation, the loop around it, and the run folder."""
