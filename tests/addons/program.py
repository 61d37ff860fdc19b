"""The program `mjxgait`, except that runs are made up: `train` and `refine` evolve nothing.

Everything else is the program's own: importing, reading a cycle, exporting.
"""

import argparse
import sys
from pathlib import Path

sys.path.append(str(Path(__file__).parents[1]))
from rendering.made_up import treading, write_run

from mjxgait.animation.keys import bring
from mjxgait.cli import main
from mjxgait.creature import load_creature

if sys.argv[1] not in ("train", "refine"):
    main()
parser = argparse.ArgumentParser()
parser.add_argument("--env", type=Path)
parser.add_argument("--keys", type=Path)
parser.add_argument("--out", type=Path)
given, _ = parser.parse_known_args(sys.argv[2:])
creature = load_creature(given.env)
print("Compiling…")
if given.keys:
    track = bring(creature, given.keys, tell=print).track
    print(f"most moved {max(abs(track.angles - track.angles[0]).ravel()):.3f} rad")
write_run(given.out, creature, treading(creature, degrees=8.0 if given.keys else 12.0))
print("generation   3/75  best 2.013  mean 1.000  alive  88%   91,234 steps/s  at most 12 min left")
print("Certified: walks (margin 0.21). trot, 0.80 m/s; 9 s.")
