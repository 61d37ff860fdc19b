"""Animation files: export to other programs, and import from them."""
