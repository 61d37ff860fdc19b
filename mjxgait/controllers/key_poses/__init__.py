"""Controller that tracks key poses (Wilson)."""
