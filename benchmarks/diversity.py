"""Diversity of the animals that separate runs find, and of the lineages within each run.

    python benchmarks/diversity.py runs/zoo/seed* --picture diversity.png

Prints a row per run: its champion, the number of families in the last population, and the first
generation with only one. A family (lineage) is all individuals descended, mother by mother, from
one without a mother: of the first generation, or drawn anew. The picture shows the families by
generation, and the champions by blocks, hinges and speed. For modular bodies that travel (swim,
walk, follow), in runs that record mothers (`evolution.lineage`).
"""

import argparse
import json
from pathlib import Path
from statistics import median
from typing import NamedTuple

import matplotlib.pyplot as plt
import mujoco
import numpy as np

import mjxgait
from mjxgait.certification import verdict_of
from mjxgait.evolution.state import NO_PARENT
from mjxgait.training.folder import CERTIFICATE

HEADER = ("run", "certified", "speed", "blocks", "hinges", "mass", "families", "one from")


class Animal(NamedTuple):
    """A run's champion, and the number of families of its population by generation."""

    name: str
    certified: bool
    speed: float
    blocks: int
    hinges: int
    mass: float
    families: list[int]

    @property
    def alone(self) -> int | None:
        """First generation with only one family."""
        return self.families.index(1) if 1 in self.families else None


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("runs", nargs="+", type=Path)
    parser.add_argument("--picture", type=Path)
    options = parser.parse_args()
    print(*HEADER, sep=" | ")
    animals = [animal(run) for run in options.runs]
    for one in animals:
        speed, mass = f"{one.speed:.2f} m/s", f"{one.mass:.0f} kg"
        shown = (one.name, "yes" if one.certified else "no", speed, one.blocks, one.hinges, mass)
        print(*shown, one.families[-1], one.alone or "-", sep=" | ")
    alone = [one.alone for one in animals if one.alone is not None]
    shapes = {(one.blocks, one.hinges) for one in animals}
    print(
        f"{sum(one.certified for one in animals)} of {len(animals)} certified; "
        f"{len(shapes)} combinations of blocks and hinges; {len(alone)} became one family"
        + (f", in generation {median(alone):g} (median)" if alone else "")
    )
    if options.picture:
        draw(animals, options.picture)


def animal(folder: Path) -> Animal:
    """Read a run folder's champion."""
    told = json.loads((folder / CERTIFICATE).read_text(encoding="utf-8"))
    model = mujoco.MjModel.from_xml_path(str(folder / "body" / "creature.xml"))
    return Animal(
        name=folder.name,
        certified=verdict_of(told).certified,
        speed=told["report"]["speed"],
        blocks=told["report"]["parts"],
        hinges=model.nv - 6,
        mass=told["report"]["mass"],
        families=families(mjxgait.open(folder).metrics()["mothers"]),
    )


def families(mothers: np.ndarray) -> list[int]:
    """Count the families of each generation. mothers: [G, P] indices into the one before."""
    ancestors = np.arange(mothers.shape[1])
    counts = [len(ancestors)]
    for of_generation in mothers[1:].astype(int):
        # An individual without a mother founds a family.
        first = ancestors.max() + 1 + np.arange(len(ancestors))
        ancestors = np.where(of_generation == NO_PARENT, first, ancestors[of_generation])
        counts.append(len(set(ancestors.tolist())))
    return counts


def draw(animals: list[Animal], path: Path) -> None:
    figure, (left, right) = plt.subplots(1, 2, figsize=(10, 4), layout="constrained")
    for one in animals:
        left.plot(one.families, color="C0", alpha=0.4, linewidth=1)
    left.set(xlabel="generation", ylabel="families", yscale="log")
    for certified, color, label in ((True, "C2", "certified"), (False, "C7", "not certified")):
        of_kind = [one for one in animals if one.certified == certified]
        right.scatter(
            [one.hinges for one in of_kind],
            [one.speed for one in of_kind],
            s=[40 * one.blocks for one in of_kind],
            color=color,
            alpha=0.6,
            label=label,
        )
    right.set(xlabel="hinges (area: blocks)", ylabel="speed in C MuJoCo, m/s")
    right.legend(markerscale=0.6)
    figure.savefig(path, dpi=110)


if __name__ == "__main__":
    main()
