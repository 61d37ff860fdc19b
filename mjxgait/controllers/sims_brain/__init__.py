"""Brains of modular bodies: networks of Sims' neurons."""
