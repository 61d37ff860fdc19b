"""Ten textbook cycles, refined until they walk: `python benchmarks/keyed.py FOLDER`.

A chart gives the stance time of each leg, the swing of its hip and the bend of its knee on the way
forward; it was never simulated. Each is written as a CSV file of angles and passed to `mjxgait
refine`; a line of JSON per cycle gives the result. `--only NAME ...` selects some of them; other
options are passed on: `--config near.toml`.
"""

import argparse
import json
import subprocess
import time
from pathlib import Path

import numpy as np

from mjxgait.animation.keys.refine import departure_of
from mjxgait.certification import read_certificate, verdict_of
from mjxgait.config.layers import find_creature
from mjxgait.creature import Creature, load_creature
from mjxgait.processes import python_command
from mjxgait.training.folder import CERTIFICATE

RATE = 24
"""Frames/s, the usual rate of films."""
LEGS = ("front_left", "front_right", "hind_left", "hind_right")
GAITS = {
    "walk": (0.25, 0.75, 0.0, 0.5),
    "trot": (0.0, 0.5, 0.5, 0.0),
    "pace": (0.0, 0.5, 0.0, 0.5),
    "amble": (0.2, 0.7, 0.0, 0.5),
}
"""Share of the cycle at which each leg touches down."""
CHARTS = {
    "short trot": ("short_quadruped", "trot", 0.5, 0.5, 20.0, 35.0),
    "short walk": ("short_quadruped", "walk", 0.65, 0.6, 22.0, 35.0),
    "short amble": ("short_quadruped", "amble", 0.55, 0.55, 20.0, 35.0),
    "short pace": ("short_quadruped", "pace", 0.5, 0.5, 18.0, 35.0),
    "tall trot": ("tall_quadruped", "trot", 0.55, 0.5, 20.0, 35.0),
    "tall walk": ("tall_quadruped", "walk", 0.7, 0.6, 22.0, 35.0),
    "tall amble": ("tall_quadruped", "amble", 0.6, 0.55, 20.0, 35.0),
    "crab tetrapod": ("crab", "", 0.6, 0.5, 22.0, 25.0),
    "duck waddle": ("duck", "", 0.55, 0.55, 20.0, 35.0),
    "duck stroll": ("duck", "", 0.7, 0.6, 22.0, 35.0),
}
"""Creature, gait, seconds of a cycle, duty factor, degrees of hip and knee."""


def leg(share: np.ndarray, carries: float, hip: float, knee: float) -> tuple[np.ndarray, ...]:
    """Return the hip and knee angles of a leg, deg, at shares [F] of its own cycle."""
    on_floor = share < carries
    swing = np.clip((share - carries) / (1.0 - carries), 0.0, 1.0)
    forward = np.where(on_floor, 1.0 - 2.0 * share / carries, -np.cos(np.pi * swing))
    return hip * forward, np.where(on_floor, 0.0, knee * np.sin(np.pi * swing))


def drawn(creature: Creature, name: str) -> dict[str, np.ndarray]:
    """Return angles [F] in degrees by joint, the last frame equal to the first."""
    kind, gait, seconds, carries, hip, knee = CHARTS[name]
    time = np.linspace(0.0, 1.0, round(seconds * RATE) + 1)
    angles: dict[str, np.ndarray] = {}
    if kind == "crab":
        places = [
            f"{row}_{side}" for row in ("front", "middle", "hind") for side in ("left", "right")
        ]
        starts = dict(zip(places, (0.0, 0.5, 0.5, 0.0, 0.0, 0.5), strict=True))
    elif kind == "duck":
        starts = {"left": 0.0, "right": 0.5}
    else:
        starts = dict(zip(LEGS, GAITS[gait], strict=True))
    for place, start in starts.items():
        forward, bent = leg((time - start) % 1.0, carries, hip, knee)
        if kind == "crab":
            angles |= {f"{place}_swing": forward, f"{place}_lift": bent}
        elif kind == "duck":
            angles |= {f"{place}_hip_pitch": forward - 0.5 * bent, f"{place}_knee": bent}
            angles[f"{place}_ankle_pitch"] = -forward - 0.5 * bent
        else:
            fold = 0.5 * bent if place.startswith("front") else -0.5 * bent
            angles |= {f"{place}_hip_pitch": -forward + fold, f"{place}_knee": bent}
    return angles


def write_cycle(folder: Path, name: str) -> Path:
    """Write the CSV file of a chart."""
    creature = load_creature(find_creature(CHARTS[name][0]))
    angles = drawn(creature, name)
    seconds = CHARTS[name][2]
    count = len(next(iter(angles.values())))
    rows = np.stack([np.linspace(0.0, seconds, count), *angles.values()], 1)
    file = folder / f"{name.replace(' ', '-')}.csv"
    head = ",".join(["time", *(f"{joint}_deg" for joint in angles)])
    file.write_text("\n".join([head, *(",".join(f"{v:.4f}" for v in row) for row in rows)]) + "\n")
    return file


def refined(folder: Path, name: str, keep: float, others: list[str]) -> dict[str, object]:
    """Refine a chart and return the result; others: options of the command."""
    file, run = write_cycle(folder, name), folder / name.replace(" ", "-")
    kind, began = CHARTS[name][0], time.perf_counter()
    command = python_command("mjxgait", "refine", "--env", kind, "--keys", str(file))
    done = subprocess.run(
        [*command, "--out", str(run), "--keep", str(keep), *others], capture_output=True, text=True
    )
    seconds = time.perf_counter() - began
    (folder / f"{run.name}.log").write_text(done.stdout + done.stderr)
    found: dict[str, object] = {"cycle": name, "seconds": round(seconds)}
    document = read_certificate(run / CERTIFICATE)
    if done.returncode or document is None:
        return found | {"certified": False}
    apart = departure_of(run)
    return found | {
        "certified": verdict_of(document).certified,
        "failed": verdict_of(document).numbers,
        "summary": document["report"]["summary"],
        "poses_deg": round(apart.poses, 1),
        "moved_deg": None if apart.moved is None else round(apart.moved, 1),
        "period": None if apart.period is None else round(apart.period, 3),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--only", nargs="*", default=list(CHARTS), choices=CHARTS)
    parser.add_argument("--keep", type=float, default=0.5)
    options, others = parser.parse_known_args()
    options.folder.mkdir(parents=True, exist_ok=True)
    for name in options.only:
        found = refined(options.folder, name, options.keep, others)
        print(json.dumps(found), flush=True)


if __name__ == "__main__":
    main()
