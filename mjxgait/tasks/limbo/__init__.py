"""The way to a goal beneath a bar: what hopping to a goal has, and how deep parts reach into it."""
