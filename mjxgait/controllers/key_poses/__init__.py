"""Controllers that track key poses (Wilson)."""
