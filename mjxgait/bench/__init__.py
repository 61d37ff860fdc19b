"""Measures the simulation against C MuJoCo, DART and the machine itself (docs/performance.md)."""
