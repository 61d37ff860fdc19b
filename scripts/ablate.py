"""Compare variants of the settings: `python scripts/ablate.py forced_evolution --out runs/forced`.

Same as `mjxgait ablate`.
"""

import sys

from mjxgait.cli import main

if __name__ == "__main__":
    main(["ablate", *sys.argv[1:]])
