"""Library interface: the same runs as on the command line, from a script or a notebook.

import mjxgait

run = mjxgait.train("tall_quadruped", seed=0, out="runs/x", generations=20)
run.champion, run.certificate, run.metrics()
mjxgait.walk(run)["trunk_z"]
"""

from mjxgait.api.environments import environment
from mjxgait.api.make import (
    examine,
    examine_expressions,
    load_creature,
    refine,
    train,
    verify,
    walk,
)
from mjxgait.api.run import Run, frames, open

__all__ = [
    "Run",
    "environment",
    "examine",
    "examine_expressions",
    "frames",
    "load_creature",
    "open",
    "refine",
    "train",
    "verify",
    "walk",
]
