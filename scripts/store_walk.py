"""Store a champion's undisturbed walk and rewrite docs/research/worked-example.md from it.

    python scripts/store_walk.py RUN

docs/data/walk receives the run's creature, settings and champion, a new certificate, and
`walk.npz`: the walk as the certificate measures it, in integers, millionths of m, rad, N and m/s.
Then the code on the page runs on these files, and its results replace everything on the page
between the marks "numbers".
"""

import argparse
import contextlib
import io
import json
import re
import shutil
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from mjxgait.certification import CertificateConfig, certify, record
from mjxgait.reference.measure import Recording
from mjxgait.training.folder import CERTIFICATE, CHAMPION, CONFIG, CREATURE, open_champion

ROOT = Path(__file__).resolve().parents[1]
PAGE, FOLDER = ROOT / "docs" / "research" / "worked-example.md", ROOT / "docs" / "data" / "walk"
CODE = re.compile(r"```python\n(.*?)```", re.DOTALL)
NUMBERS = re.compile(r"(<!-- numbers: (\w+) -->\n).*?(<!-- end -->)", re.DOTALL)
BY_HAND = (2, 3, 7)
"""Criteria with numbers that the page works out."""


def main() -> None:
    """Certify, record and write."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("run", type=Path)
    run = parser.parse_args().run
    creature, champion = open_champion(run)
    config = CertificateConfig()
    certificate = certify(creature, champion, config)
    if not certificate.passed:
        sys.exit(f"{run}: its champion is not certified; nothing was stored")
    window = record(creature, champion, config.seconds).window(config.warmup)
    shutil.rmtree(FOLDER, ignore_errors=True)
    shutil.copytree(run / CREATURE, FOLDER / CREATURE)
    for name in (CONFIG, CHAMPION):
        shutil.copy(run / name, FOLDER / name)
    (FOLDER / CERTIFICATE).write_text(certificate.to_json(), encoding="utf-8")
    np.savez_compressed(FOLDER / "walk.npz", allow_pickle=False, **arrays(window))
    PAGE.write_text(page_of(PAGE.read_text(encoding="utf-8"), FOLDER), encoding="utf-8")


def arrays(window: Recording) -> dict[str, np.ndarray]:
    """Return the contents: sizes unchanged, and per frame [T, ...] integers in millionths."""
    size = window.dimensions
    return {
        "time_step": np.array(window.time_step),
        "mass": np.array(size.mass),
        "gravity": np.array(size.gravity),
        "hip_height": np.array(size.hip_height),
        "body_length": np.array(size.body_length),
        "foot_names": np.array(size.foot_names),
        "trunk": millionths(window.trunk_pos),
        "pitch": millionths(window.pitch),
        "roll": millionths(window.roll),
        "joints": millionths(window.joint_pos),
        "foot_height": millionths(window.foot_height),
        "foot_force": millionths(window.foot_force),
        "foot_slip": millionths(window.foot_slip),
    }


def millionths(values: np.ndarray) -> np.ndarray:
    """Return integers, which take a third of the room of float64 when compressed."""
    return np.round(values * 1e6).astype(np.int32)


def page_of(page: str, folder: Path) -> str:
    """Return the page with all numbers from a stored walk."""
    found = worked_out(page)
    certificate = json.loads((folder / CERTIFICATE).read_text(encoding="utf-8"))
    champion = json.loads((folder / CHAMPION).read_text(encoding="utf-8"))
    parts = {
        "champion": _champion(champion, certificate),
        "table": _table(found["by_hand"], certified(certificate)),
        "seen": _seen(found),
    }
    return NUMBERS.sub(lambda match: f"{match[1]}{parts[match[2]]}\n{match[3]}", page)


def worked_out(page: str) -> dict[str, Any]:
    """Return the names that the page's code defines; it reads the walk from the checkout's root."""
    match, names = CODE.search(page), dict[str, Any]()
    assert match
    with contextlib.chdir(ROOT), contextlib.redirect_stdout(io.StringIO()):
        exec(match[1], names)
    return names


def certified(certificate: Mapping[str, Any]) -> dict[str, float]:
    """Return the same measures by name, as the certificate has them."""
    chosen = (c for c in certificate["criteria"] if c["number"] in BY_HAND)
    return {m["name"]: m["value"] for c in chosen for m in c["measures"]}


def _champion(champion: Mapping[str, Any], certificate: Mapping[str, Any]) -> str:
    origin, numbers = champion["origin"], [c["number"] for c in certificate["criteria"]]
    return (
        f"Champion of generation {origin['generation']} of seed {origin['seed']}, made by mjxgait "
        f"{origin['versions']['mjxgait']}: it passes all {len(numbers)} criteria ({numbers[0]} to "
        f"{numbers[-1]}) with a margin of {certificate['margin']:.2f}, and its gait is called "
        f"{certificate['report']['gait']}."
    )


def _table(by_hand: Mapping[str, float], certificate: Mapping[str, float]) -> str:
    rows = [f"| {n} | {v:.6g} | {certificate[n]:.6g} |" for n, v in by_hand.items()]
    return "\n".join(["| measure | by hand | certificate |", "|---|---|---|", *rows])


def _seen(found: Mapping[str, Any]) -> str:
    swings = [swings for swings, _ in found["feet"]]
    stride, varied = found["periods"].mean() * found["dt"], found["periods"].std()
    aside, slip = 100 * found["drift"] * found["distance"], found["slip"]
    return "\n".join(
        [
            f"- In {found['seconds']:.0f} s the feet swing {', '.join(map(str, swings))} times. A "
            f"stride takes {stride:.2f} s.",
            f"- The standard deviation of the stride period is {varied:.2f} frames of "
            f"{1e3 * found['dt']:.0f} ms.",
            f"- The trunk is at most {aside:.0f} cm off the line over {found['distance']:.0f} m. "
            f"Each foot slides {slip.min():.1f} to {slip.max():.1f} m meanwhile.",
        ]
    )


if __name__ == "__main__":
    main()
