"""Several runs of one creature that differ in nothing but their seed, and all their champions in one picture."""
