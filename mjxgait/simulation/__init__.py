"""Many episodes as one computation."""
