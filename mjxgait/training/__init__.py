"""A run: the compiled generation, the loop around it, and the folder that it leaves behind."""
