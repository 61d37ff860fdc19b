"""The command, with champions evaluated for 2 s instead of 22.

In its own file, because the evaluating processes read it again.
"""

from mjxgait.experiments.ablation import measures

measures.SECONDS = 2.0

if __name__ == "__main__":
    from mjxgait.cli import main

    main()
