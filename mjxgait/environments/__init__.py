"""Environments of the field's kinds over a creature and its task (docs/guide/research-tools.md)."""
