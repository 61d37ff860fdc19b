"""The ground as text: `flat`, `slope:0.1:down`, `steps:0.05`, `bumps:0.05`, `rough:0.05@3`.

No JAX here: settings, certification and rendering read it too.
"""

import dataclasses
import math
import re
from typing import NamedTuple

import numpy as np

FLAT = "flat"
DIRECTIONS = {
    "slope": ("up", "down", "across"),
    "steps": ("up", "down"),
    "bumps": (),
    "rough": (),
}
"""Directions of each kind but `flat`; the first is the default."""
MAX_SIZE = {"slope": 1.0, "steps": 0.5, "bumps": 0.5, "rough": 0.5}
"""The largest size of each kind."""
ALLOWED = (
    "give flat, slope:S, steps:S, bumps:S or rough:S; S is the rise per metre of a slope (at most "
    "1) or a height in hip heights (at most 0.5). slope and steps may end in :up or :down, slope "
    "in :across too; steps, bumps and rough may end in @SEED, a whole number"
)
TEXT = re.compile(
    r"(?P<kind>[a-z]+):(?P<size>[^:@]+)(:(?P<direction>[a-z]+))?(@(?P<seed>\d{1,9}))?"
)


class Place(NamedTuple):
    """A creature's start on the ground: place of the trunk, way forward, and sizes in m."""

    start: np.ndarray
    forward: np.ndarray
    hip_height: float
    body_length: float


@dataclasses.dataclass(frozen=True)
class GroundSpec:
    """Description of the ground.

    size: rise per metre of a slope; otherwise hip heights: of a step, or the most that bumps and
      rough ground may rise or fall. direction: see `DIRECTIONS`. seed: selects one ground of its
      kind; 0 for a slope, which has no variants.
    """

    kind: str = FLAT
    size: float = 0.0
    direction: str = ""
    seed: int = 0

    @property
    def flat(self) -> bool:
        """True if it is the plane z = 0."""
        return self.kind == FLAT

    def __str__(self) -> str:
        """The text that `parse_ground` reads."""
        if self.flat:
            return FLAT
        direction = f":{self.direction}" if self.direction not in _usual(self.kind) else ""
        return f"{self.kind}:{self.size:g}{direction}{f'@{self.seed}' if self.seed else ''}"


LEVEL = GroundSpec()
"""The plane z = 0."""


def parse_ground(text: str) -> GroundSpec:
    """Parse the text of a ground.

    Raises:
      ValueError: says what is allowed.
    """
    if text == FLAT:
        return LEVEL
    found = TEXT.fullmatch(text)
    if not found or found["kind"] not in DIRECTIONS:
        raise ValueError(f'"{text}" is no ground: {ALLOWED}')
    kind, known = found["kind"], DIRECTIONS[found["kind"]]
    size, direction = _number(found["size"]), found["direction"] or (known or ("",))[0]
    if not 0 < size <= MAX_SIZE[kind]:
        raise ValueError(f'"{text}": {found["size"]} is no size of {kind}: {ALLOWED}')
    if direction not in known and direction:
        raise ValueError(f'"{text}": {kind} has no direction "{direction}": {ALLOWED}')
    if found["seed"] and kind == "slope":
        raise ValueError(f'"{text}": a slope has no seed: {ALLOWED}')
    return GroundSpec(kind, size, direction, int(found["seed"] or 0))


def check_ground(text: str) -> str:
    """Return the text itself if it describes a ground.

    Raises:
      ValueError: says what is allowed.
    """
    parse_ground(text)
    return text


def _usual(kind: str) -> tuple[str, ...]:
    return DIRECTIONS[kind][:1] or ("",)


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return math.nan
