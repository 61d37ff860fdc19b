"""Animation files: what is written for other programs, and what is read from them."""
