"""Benchmark: C MuJoCo, DART and the machine's limits (docs/research/performance.md)."""
