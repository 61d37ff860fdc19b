"""The command, but champions are judged by 2 s of walking instead of 22.

A file of its own, since the processes that judge read it anew.
"""

from mjxgait.experiments.ablation import rows

rows.SECONDS = 2.0

if __name__ == "__main__":
    from mjxgait.cli import main

    main()
