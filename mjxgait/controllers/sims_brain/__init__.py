"""Brains of evolved creatures: networks of Sims' neurons."""
