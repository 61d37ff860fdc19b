"""Evolve a walk: `python scripts/train.py --env tall_quadruped`. Same as `mjxgait train`."""

import sys

from mjxgait.cli import main

if __name__ == "__main__":
    main(["train", *sys.argv[1:]])
