"""Evolution: whom to try next, and who survives."""
