"""A one-second run of expressions; all tests that train with it share its compiled programs."""

import tomllib

TABLES = """
[controller]
nodes = 32
senses = ["a*", "t", "v?", "pitch"]
[rollout]
seconds = 0.2
lanes = 8
variety = 1
caution = 0.0
worst = 0.5
[examination]
candidates = 0
# The best of three generations, which move most: more of them agree than of the last alone.
[evolution]
population = 8
survival = "best"
elite = 0.0
remember = false
selection = "rank"
"""
"""Content of a file for `train --config`."""


def small_settings() -> dict:
    """The same as `settings` of `mjxgait.train`."""
    return tomllib.loads(TABLES)
