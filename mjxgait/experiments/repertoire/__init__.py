"""Set of walks that blend: a grid of speeds and turns, evolved together (docs/guide/repertoire.md)."""
