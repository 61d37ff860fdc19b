"""The gaits that can be asked for, as footfalls: one table for evolution and for the examiner.

A phase is the middle of a foot's stance in cycles (Hildebrand 1965), as a name needs it; only
differences between feet count. Letters: `A` ways of one gait, `N` feet.
"""

import dataclasses
from collections.abc import Sequence
from typing import Any

from mjxgait.errors import did_you_mean

AUTO = "auto"
"""No gait is asked for: whatever comes."""

Station = tuple[int, bool]
"""Where a foot is: its rank from the front on its side, and whether that is the left."""


@dataclasses.dataclass(frozen=True)
class Gait:
    """A gait of a body with so many feet.

    ways: phases, one table for each way that has the name; the left feet from the front, then the
    right ones. duty: range of the mean duty factor. labels: the examiner's names that fulfil it
    (`certify.describe.gait_name`).
    twice: whether the left does in the second half of a cycle what the right does in the first, as
    mirrored key poses do; if not, the whole cycle must be evolved.
    sway: deg of roll, root mean square, that belongs to it.
    """

    ways: tuple[tuple[float, ...], ...]
    labels: tuple[str, ...]
    duty: tuple[float, float] = (0.0, 1.0)
    twice: bool = True
    sway: float | None = None


GRAVITY = 9.81
"""m/s², for the strides of animals."""
SHORTEST = 0.5
"""Share of an animal's stride length that a walk at a speed asked for must have."""
SLOWEST = 0.02
"""Froude number below which animals are not known to stand for more of the time."""
WALKS_UP_TO = 0.5
"""Froude number from which four-legged animals trot rather than walk."""


def transition(mass: float) -> float:
    """Hz, at which an animal of this mass in kg changes from trot to gallop (Heglund, Taylor &
    McMahon 1974).
    """
    return 4.48 * mass**-0.14


def stride_limit(mass: float) -> float:
    """Hz; 1.2 times the trot-gallop transition frequency of an animal of this mass in kg."""
    return 1.2 * 4.48 * mass**-0.14


def animal_stride(speed: Any, hip_height: Any) -> Any:
    """Stride length in m of an animal at a speed in m/s, 2.3 (v²/gh)^0.3 hip heights (Alexander
    1976); of numbers or arrays.
    """
    return 2.3 * (speed**2 / (GRAVITY * hip_height)) ** 0.3 * hip_height


def animal_duty(speed: Any, hip_height: Any) -> Any:
    """Duty factor of an animal at a speed in m/s, 0.52 (v²/gh)^-0.14 (Alexander & Jayes 1983,
    mammals that run), 0.9 at most; of numbers or arrays.
    """
    froude = speed**2 / (GRAVITY * hip_height)
    return 0.52 * (froude**2 + SLOWEST**2) ** -0.07


def most_strides(speed: Any, hip_height: Any) -> Any:
    """Hz, at a speed in m/s: those of the shortest strides there may be."""
    return speed / (SHORTEST * animal_stride(speed, hip_height))


_FOUR_BEATS = ((0.25, 0.0, 0.75, 0.5), (0.75, 0.0, 0.25, 0.5))
"""In lateral and in diagonal sequence."""
_WAVES = ((0.33, 0.17, 0.0, 0.83, 0.67, 0.5), (0.67, 0.33, 0.0, 0.17, 0.83, 0.5))
"""From the hind feet to the front, a sixth or a third of a cycle from foot to foot."""
_WALKS, _RUNS = (0.5, 1.0), (0.0, 0.5)

GAITS: dict[int, dict[str, Gait]] = {
    2: {
        "walk": Gait(((0.0, 0.5),), ("walk",), _WALKS),
        "waddle": Gait(((0.0, 0.5),), ("walk",), _WALKS, sway=6.0),
        "hop": Gait(((0.0, 0.0),), ("hop",), twice=False),
    },
    4: {
        "walk": Gait(_FOUR_BEATS, ("walk", "crawl"), _WALKS),
        "amble": Gait(_FOUR_BEATS, ("running walk",), _RUNS),
        "trot": Gait(((0.5, 0.0, 0.0, 0.5),), ("trot",)),
        "pace": Gait(((0.0, 0.0, 0.5, 0.5),), ("pace",)),
        "canter": Gait(
            ((0.33, 0.0, 0.67, 0.33), (0.67, 0.33, 0.33, 0.0)), ("canter",), twice=False
        ),
        "bound": Gait(((0.5, 0.0, 0.5, 0.0),), ("bound",), twice=False),
        "gallop": Gait(
            (
                (0.5, 0.0, 0.65, 0.15),
                (0.65, 0.15, 0.5, 0.0),
                (0.65, 0.0, 0.5, 0.15),
                (0.5, 0.15, 0.65, 0.0),
            ),
            ("gallop",),
            _RUNS,
            twice=False,
        ),
        "hop": Gait(((0.0, 0.0, 0.0, 0.0),), ("pronk",), twice=False),
    },
    6: {
        "walk": Gait(
            (*_WAVES, (0.0, 0.17, 0.33, 0.5, 0.67, 0.83)),
            ("walk", "metachronal", "wave"),
            _WALKS,
        ),
        "wave": Gait(_WAVES, ("wave",), (0.75, 1.0)),
        "tripod": Gait(((0.0, 0.5, 0.0, 0.5, 0.0, 0.5),), ("tripod",)),
    },
}
"""By number of feet and name."""

NAMES = tuple(dict.fromkeys(name for table in GAITS.values() for name in table))


def check_gait(name: str) -> str:
    """The name of a gait, or `auto`.

    Raises:
      ValueError: there is none of that name.
    """
    if name not in (AUTO, *NAMES):
        raise ValueError(f'there is no gait "{name}"; {did_you_mean(name, (AUTO, *NAMES))}')
    return name


def gait_of(name: str, feet: int) -> Gait:
    """The gait of this name of a body with so many feet.

    Raises:
      ValueError: such a body has none of that name.
    """
    known = GAITS.get(feet, {})
    if name not in known:
        has = ", ".join(known) or "no gait by name"
        raise ValueError(f"a body with {feet} feet has no {name}: it has {has}")
    return known[name]


def placed(gait: Gait, stations: Sequence[Station]) -> list[list[float]]:
    """The gait's phases [A, N] in the order of the feet that stand at these stations."""
    half = len(stations) // 2
    return [[way[rank + (0 if left else half)] for rank, left in stations] for way in gait.ways]


def stations_of(places: Sequence[tuple[float, float]]) -> tuple[Station, ...]:
    """Of feet at these places in m, forward and left of the trunk; half of them on each side.

    The leftmost half counts as left: a foot below the middle belongs to the side that lacks one.
    """
    order = sorted(range(len(places)), key=lambda n: -places[n][1])
    left = set(order[: len(places) // 2])
    sides = [
        sorted((n for n in order if (n in left) is side), key=lambda n: -places[n][0])
        for side in (True, False)
    ]
    return tuple((sides[n not in left].index(n), n in left) for n in range(len(places)))
