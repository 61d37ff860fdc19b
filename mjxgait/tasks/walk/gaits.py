"""Target gaits as footfall phases: one table for evolution and certification.

A phase is the middle of a foot's stance in cycles (Hildebrand 1965), as precise as a gait's name
requires; only differences between feet count. Letters: `A` variants of one gait, `N` feet.
"""

import dataclasses
from collections.abc import Sequence
from typing import Any

from mjxgait.errors import did_you_mean

AUTO = "auto"
"""No target gait: any gait is accepted."""

Station = tuple[int, bool]
"""Place of a foot: its rank from the front on its side, and whether that is the left."""


@dataclasses.dataclass(frozen=True)
class Gait:
    """Gait of a body with a given number of feet.

    ways: phases, one tuple per variant; the left feet from the front, then the right ones.
    duty: range of the mean duty factor.
    labels: names in the certificate that fulfil it (`certification.describe.gait_name`).
    twice: whether the left does in the second half of a cycle what the right does in the first, as
      with mirrored key poses; if not, the whole cycle must be evolved.
    together: whether left and right do the same at the same time, so that each pose is symmetric.
    stride: of the textbook cycle, as a share of an animal's. Legs that all push at once bounce
    twice in the time of a walk's stride.
    drawn: whether evolution starts from a textbook cycle; a drawn gallop fell more than random
    poses.
    sway: deg of roll, root mean square, that belongs to the gait.
    """

    ways: tuple[tuple[float, ...], ...]
    labels: tuple[str, ...]
    duty: tuple[float, float] = (0.0, 1.0)
    twice: bool = True
    together: bool = False
    stride: float = 1.0
    drawn: bool = True
    sway: float | None = None


GRAVITY = 9.81
"""m/s², for the strides of animals."""
SHORTEST = 0.5
"""Minimum stride length at a target speed, as a share of an animal's."""
SLOWEST = 0.02
"""Froude number below which animals are not known to have a higher duty factor."""
WALKS_UP_TO = 0.5
"""Froude number from which four-legged animals trot instead of walking."""


def transition(mass: float) -> float:
    """Stride frequency in Hz of the change from trot to gallop, for an animal of this mass in kg.

    Heglund, Taylor & McMahon 1974.
    """
    return 4.48 * mass**-0.14


def stride_limit(mass: float) -> float:
    """Stride frequency limit in Hz: 1.2 times the trot-gallop transition, for a mass in kg."""
    return 1.2 * 4.48 * mass**-0.14


def animal_stride(speed: Any, hip_height: float) -> Any:
    """Stride length in m of an animal at a speed in m/s, for numbers or arrays.

    2.3 (v²/gh)^0.3 hip heights (Alexander 1976).
    """
    return 2.3 * (speed**2 / (GRAVITY * hip_height)) ** 0.3 * hip_height


def animal_duty(speed: Any, hip_height: float) -> Any:
    """Duty factor of an animal at a speed in m/s, for numbers or arrays.

    0.52 (v²/gh)^-0.14 (Alexander & Jayes 1983, running mammals), 0.9 at most.
    """
    froude = speed**2 / (GRAVITY * hip_height)
    return 0.52 * (froude**2 + SLOWEST**2) ** -0.07


def most_strides(speed: Any, hip_height: float) -> Any:
    """Stride frequency in Hz of the shortest allowed strides at a speed in m/s."""
    return speed / (SHORTEST * animal_stride(speed, hip_height))


_FOUR_BEATS = ((0.25, 0.0, 0.75, 0.5), (0.75, 0.0, 0.25, 0.5))
"""Lateral and diagonal sequence."""
_WAVES = ((0.33, 0.17, 0.0, 0.83, 0.67, 0.5), (0.67, 0.33, 0.0, 0.17, 0.83, 0.5))
"""Waves from the hind feet to the front, a sixth or a third of a cycle from foot to foot."""
_WALKS, _RUNS = (0.5, 1.0), (0.0, 0.5)

GAITS: dict[int, dict[str, Gait]] = {
    2: {
        "walk": Gait(((0.0, 0.5),), ("walk",), _WALKS),
        "waddle": Gait(((0.0, 0.5),), ("walk",), _WALKS, sway=6.0),
        "hop": Gait(((0.0, 0.0),), ("hop",), twice=False, together=True, stride=0.5),
    },
    4: {
        "walk": Gait(_FOUR_BEATS, ("walk", "crawl"), _WALKS),
        "amble": Gait(_FOUR_BEATS, ("running walk",), _RUNS),
        "trot": Gait(((0.5, 0.0, 0.0, 0.5),), ("trot",)),
        "pace": Gait(((0.0, 0.0, 0.5, 0.5),), ("pace",)),
        "canter": Gait(
            ((0.33, 0.0, 0.67, 0.33), (0.67, 0.33, 0.33, 0.0)), ("canter",), twice=False
        ),
        "bound": Gait(((0.5, 0.0, 0.5, 0.0),), ("bound",), twice=False, together=True),
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
            drawn=False,
        ),
        "hop": Gait(((0.0, 0.0, 0.0, 0.0),), ("pronk",), twice=False, together=True, stride=0.5),
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
    8: {
        "alternating": Gait(((0.0, 0.5, 0.0, 0.5, 0.5, 0.0, 0.5, 0.0),), ("alternating",)),
    },
}
"""Gaits by number of feet and name."""

NAMES = tuple(dict.fromkeys(name for table in GAITS.values() for name in table))


def check_gait(name: str) -> str:
    """Return the name of a gait, or `auto`.

    Raises:
      ValueError: there is none of that name.
    """
    if name not in (AUTO, *NAMES):
        raise ValueError(f'there is no gait "{name}"; {did_you_mean(name, (AUTO, *NAMES))}')
    return name


def gait_of(name: str, feet: int) -> Gait:
    """Return the gait of this name for a body with so many feet.

    Raises:
      ValueError: such a body has none of that name.
    """
    known = GAITS.get(feet, {})
    if name not in known:
        has = ", ".join(known) or "no gait by name"
        raise ValueError(f"a body with {feet} feet has no {name}: it has {has}")
    return known[name]


def placed(gait: Gait, stations: Sequence[Station]) -> list[list[float]]:
    """Phases [A, N] of the gait, in the order of the feet at these stations."""
    half = len(stations) // 2
    return [[way[rank + (0 if left else half)] for rank, left in stations] for way in gait.ways]


def stations_of(places: Sequence[tuple[float, float]]) -> tuple[Station, ...]:
    """Stations of feet at these places in m, forward and left of the trunk.

    The leftmost half counts as left, so a foot below the midline joins the side that lacks one.
    """
    order = sorted(range(len(places)), key=lambda n: -places[n][1])
    left = set(order[: len(places) // 2])
    sides = [
        sorted((n for n in order if (n in left) is side), key=lambda n: -places[n][0])
        for side in (True, False)
    ]
    return tuple((sides[n not in left].index(n), n in left) for n in range(len(places)))
