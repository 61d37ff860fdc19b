"""Evolve a stable walk for any creature."""

__version__ = "0.1.0"
