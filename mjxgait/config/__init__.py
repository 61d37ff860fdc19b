"""What a run can be told: the settings, how files lay them over each other, and what of them the
compiled program reads."""
