"""Tasks with a goal: hop, travel and limbo."""
