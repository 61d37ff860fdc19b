"""Tells what a checkpoint holds: `python scripts/inspect_checkpoint.py RUN`.

The same as `mjxgait inspect`.
"""

import sys

from mjxgait.cli import main

if __name__ == "__main__":
    main(["inspect", *sys.argv[1:]])
