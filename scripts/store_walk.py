"""Stores a champion's undisturbed walk as the certificate sees it, for docs/worked-example.md.

    python scripts/store_walk.py runs/every/tall_quadruped-0 docs/data/tall_quadruped-0

Writes into the second folder the champion, its certificate, made anew, and `walk.npz`: integers,
millionths of m, rad, N and m/s.
"""

import argparse
import shutil
from pathlib import Path

import numpy as np

from mjxgait.certify import CertificateConfig, certify, record
from mjxgait.certify.measure import Recording
from mjxgait.runs.folder import CERTIFICATE, CHAMPION, open_champion


def main() -> None:
    """Examines, records and writes."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("run", type=Path)
    parser.add_argument("folder", type=Path)
    options = parser.parse_args()
    creature, champion = open_champion(options.run)
    config = CertificateConfig()
    options.folder.mkdir(parents=True, exist_ok=True)
    shutil.copy(options.run / CHAMPION, options.folder / CHAMPION)
    (options.folder / CERTIFICATE).write_text(
        certify(creature, champion, config).to_json(), encoding="utf-8"
    )
    window = record(creature, champion, config.seconds).window(config.warmup)
    np.savez_compressed(options.folder / "walk.npz", allow_pickle=False, **arrays(window))


def arrays(window: Recording) -> dict[str, np.ndarray]:
    """What lies in the file: sizes as they are, and per frame [T, ...] integers in millionths."""
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
    """As integers, which take a third of the room of float64 when compressed."""
    return np.round(values * 1e6).astype(np.int32)


if __name__ == "__main__":
    main()
