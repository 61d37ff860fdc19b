"""Bodies of blocks that grow from directed graphs, after Sims, "Evolving Virtual Creatures" (1994)."""
