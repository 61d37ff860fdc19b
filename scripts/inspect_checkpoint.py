"""Tells what a checkpoint holds: `python scripts/inspect_checkpoint.py RUN`. The same as `mjxgait inspect`."""

import sys

from mjxgait.cli import main

main(["inspect", *sys.argv[1:]])
