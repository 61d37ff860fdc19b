"""Several runs of one creature with different seeds, and their champions in one picture."""
