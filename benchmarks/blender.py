"""Errors of a round trip through Blender: `python benchmarks/blender.py RUN PYTHON`.

RUN's walk is exported, opened in Blender, exported again unchanged and with one joint bent, and
read back as `mjxgait refine` reads it. PYTHON is an interpreter with `pip install bpy`, of Python
3.11; bpy needs another numpy than this program, so it has its own environment. Prints a line of
JSON: errors in degrees, over all joints and frames. `--picture FILE` draws the bones.
"""

import argparse
import json
import subprocess
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from mjxgait.animation.export import export_glb, walk_loop
from mjxgait.animation.keys import bring
from mjxgait.animation.keys.bring import Brought
from mjxgait.creature import Creature
from mjxgait.rendering.walk import record_walk
from mjxgait.training.folder import open_champion

SCRIPT = Path(__file__).with_name("in_blender.py")
SECONDS = 12.0
TOLD = ("blender", "frames", "seconds", "materials", "extras")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("run", type=Path)
    parser.add_argument("python", type=Path)
    parser.add_argument("--joint", help="that is bent: about the left; by default a knee")
    parser.add_argument("--degrees", type=float, default=8.0)
    parser.add_argument("--rate", type=int, default=30)
    parser.add_argument("--picture", type=Path)
    parser.add_argument("--keep", type=Path, help="folder for the GLB files")
    given = parser.parse_args()
    creature, champion = open_champion(given.run)
    joint = given.joint or alone(creature)
    loop = walk_loop(record_walk(creature, champion, SECONDS), given.rate)
    with tempfile.TemporaryDirectory() as scratch:
        folder = given.keep or Path(scratch)
        folder.mkdir(parents=True, exist_ok=True)
        export_glb(loop, folder / "walk.glb")
        picture = ["--picture", str(given.picture)] if given.picture else []
        told = blender(given.python, folder, "same", *picture)
        bone = creature.model.body(creature.model.joint(joint).bodyid[0]).name
        blender(given.python, folder, "bent", "--turn", f"{bone}={given.degrees}")
        same, bent = (bring(creature, folder / f"{name}.glb") for name in ("same", "bent"))
    was = loop.qpos[:, creature.joints.qpos_adr]
    row = {"creature": creature.name, "bones": len(told["bones"])}
    row |= {name: told[name] for name in TOLD}
    row |= {"unchanged_off": off(same, was), "note_kept": same.own is not None}
    row |= bending(creature, joint, bent, was, given.degrees)
    print(json.dumps(row))


def alone(creature: Creature) -> str:
    """Return the first joint that is the only one of its part."""
    parts = [int(creature.model.joint(name).bodyid[0]) for name in creature.joints.names]
    return next(n for n, p in zip(creature.joints.names, parts, strict=True) if parts.count(p) == 1)


def blender(python: Path, folder: Path, name: str, *options: str) -> dict[str, Any]:
    """Open the walk in Blender, write NAME.glb, and return its report."""
    files = [str(folder / "walk.glb"), str(folder / f"{name}.glb")]
    done = subprocess.run(
        [str(python), str(SCRIPT), *files, *options], capture_output=True, text=True
    )
    lines = [line for line in done.stdout.splitlines() if line.startswith("told ")]
    if done.returncode or not lines:
        raise SystemExit(f"{python}: {done.stderr[-2000:]}")
    told: dict[str, Any] = json.loads(lines[0].removeprefix("told "))
    return told


def off(brought: Brought, expected: np.ndarray) -> float:
    """Return the greatest difference of angles [F, J] in degrees."""
    return float(np.degrees(np.abs(brought.track.angles - expected).max()))


def bending(
    creature: Creature, joint: str, brought: Brought, was: np.ndarray, degrees: float
) -> dict[str, Any]:
    """Compare the angles with those bent by so many degrees, either way about the hinge.

    Frames that would take the joint beyond its range are left out.
    """
    place = creature.joints.names.index(joint)
    low, high = creature.joints.low[place], creature.joints.high[place]
    errors = []
    for sign in (1, -1):
        expected = was.copy()
        expected[:, place] += np.radians(sign * degrees)
        kept = (expected[:, place] > low) & (expected[:, place] < high)
        miss = np.degrees(np.abs(brought.track.angles - expected)[kept])
        errors.append((float(miss.max()), int(kept.sum())))
    worst, frames = min(errors)
    changed = brought.own.changed if brought.own else float("nan")
    said = {"bent": joint, "by": degrees, "bent_off": worst, "frames_compared": frames}
    return said | {"change_told": float(np.degrees(changed))}


if __name__ == "__main__":
    main()
