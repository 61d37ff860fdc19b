"""Hopping to a goal: the tally of an episode, and the terms of the fitness."""
