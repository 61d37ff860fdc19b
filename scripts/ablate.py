"""Compares variants of the settings: `python scripts/ablate.py forced_evolution --out runs/forced`.

The same as `mjxgait ablate`.
"""

import sys

from mjxgait.cli import main

if __name__ == "__main__":
    main(["ablate", *sys.argv[1:]])
