"""A whole set of walks that blend: a grid of speeds and turns, evolved side by side (docs/repertoire.md)."""
