"""Settings of a run: schema, layers of files, and the part that the compiled program reads."""
