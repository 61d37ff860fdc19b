"""Measures the simulation against C MuJoCo by hand, against DART and against the machine itself (docs/performance.md)."""
