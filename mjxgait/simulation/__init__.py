"""Simulation of many episodes as one computation."""
