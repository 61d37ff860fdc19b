"""Browser pages: to share a walk, compare several, simulate one, drive a repertoire, follow a run."""
