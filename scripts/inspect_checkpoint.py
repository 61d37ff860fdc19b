"""Show the contents of a checkpoint: `python scripts/inspect_checkpoint.py RUN`.

Same as `mjxgait inspect`.
"""

import sys

from mjxgait.cli import main

if __name__ == "__main__":
    main(["inspect", *sys.argv[1:]])
