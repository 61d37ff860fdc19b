"""Library interface: the same runs as on the command line, from a script or a notebook.

import mjxgait

run = mjxgait.train("tall_quadruped", seed=0, out="runs/x", generations=20)
run.champion, run.certificate, run.metrics()
mjxgait.walk(run)["trunk_z"]
"""

from mjxgait.api.bodies import import_model
from mjxgait.api.environments import environment
from mjxgait.api.examining import certify, examine, examine_expressions, verify, walk
from mjxgait.api.exports import export, plot, share
from mjxgait.api.films import render
from mjxgait.api.galleries import gallery
from mjxgait.api.make import load_creature, refine, train
from mjxgait.api.repertoires import repertoire
from mjxgait.api.robots import build
from mjxgait.api.run import Run, frames, open
from mjxgait.api.studies import ablate
from mjxgait.errors import UserError

__all__ = [
    "Run",
    "UserError",
    "ablate",
    "build",
    "certify",
    "environment",
    "examine",
    "examine_expressions",
    "export",
    "frames",
    "gallery",
    "import_model",
    "load_creature",
    "open",
    "plot",
    "refine",
    "render",
    "repertoire",
    "share",
    "train",
    "verify",
    "walk",
]
