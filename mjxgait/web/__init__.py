"""Browser pages: one to share a walk, one to drive it, and one to watch a running evolution."""
