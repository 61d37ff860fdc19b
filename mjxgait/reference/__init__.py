"""The reference simulator: C MuJoCo and NumPy, free of JAX."""
