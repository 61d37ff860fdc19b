"""Set of walks that blend: a grid of speeds and turns (docs/guide/repertoire.md)."""
