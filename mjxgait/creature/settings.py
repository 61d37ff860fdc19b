"""`creature.toml`: settings that a model file cannot hold (docs/reference/creature-folder.md)."""

import dataclasses
import re
from typing import Annotated, Literal

import pydantic

from mjxgait.config.tables import (
    STRICT,
    Finite,
    NonNegative,
    Positive,
)

Pattern = str
Degrees = tuple[Finite, Finite]


MOST_NAME = 100
NO_NAME = re.compile(r"""[\x00-\x1f\x7f/\\:*?"<>|]|^[.-]|^\s|[\s.]$""")
"""Forbidden parts of a name: some system allows no such file, or it is an option, or hidden."""


def _file_name(name: str) -> str:
    if not name or len(name) > MOST_NAME or NO_NAME.search(name):
        raise ValueError(
            f"{name[:MOST_NAME]!r} cannot be the name of a file; use letters, digits and _, at "
            f"most {MOST_NAME}"
        )
    return name


def _two_or_none(beside: tuple[str, ...]) -> tuple[str, ...]:
    if len(beside) not in (0, 2):
        raise ValueError("must name the opponent and the cube of a contest, or nothing")
    return beside


@dataclasses.dataclass(frozen=True)
class Identity:
    """The names of the parts.

    grows: whether it is only a seed, and the simulated bodies grow from genomes. planar: whether it
    is a body in two dimensions; its limbs pass each other. beside: bodies that move but are no part
    of the creature, such as its opponent in a contest.
    """

    __pydantic_config__ = STRICT
    name: Annotated[str, pydantic.AfterValidator(_file_name)]
    trunk: str
    feet: tuple[str, ...]
    description: str = ""
    forward: tuple[Finite, Finite, Finite] = (1.0, 0.0, 0.0)
    ground: tuple[str, ...] = ()
    keyframe: str = "stand"
    body_length: Positive | None = None
    grows: bool = False
    planar: bool = False
    beside: Annotated[tuple[str, ...], pydantic.AfterValidator(_two_or_none)] = ()


@dataclasses.dataclass(frozen=True)
class JointSettings:
    """Settings of all joints.

    Gains in N·m/rad and N·m·s/rad, torque limit in N·m, pose range in degrees about the standing
    angle.
    """

    __pydantic_config__ = STRICT
    kp: Positive
    kd: NonNegative
    torque_limit: Positive
    range: Degrees = (-45.0, 45.0)


@dataclasses.dataclass(frozen=True)
class JointException:
    """Settings of the joints with names that match a shell pattern; None keeps the common value."""

    __pydantic_config__ = STRICT
    match: Pattern
    kp: Positive | None = None
    kd: NonNegative | None = None
    torque_limit: Positive | None = None
    range: Degrees | None = None


@dataclasses.dataclass(frozen=True)
class MirrorPair:
    """A correction of the mirror map: `joint` in the mirror image is `sign * partner`."""

    __pydantic_config__ = STRICT
    joint: str
    partner: str
    sign: Literal[-1, 1] = 1


@dataclasses.dataclass(frozen=True)
class Mirror:
    """Mirror symmetry of the body's left and right."""

    __pydantic_config__ = STRICT
    symmetric: bool = True
    pairs: tuple[MirrorPair, ...] = ()


@dataclasses.dataclass(frozen=True)
class Steering:
    """Weights per joint pattern of the steering correction."""

    __pydantic_config__ = STRICT
    bend: dict[Pattern, Finite] = dataclasses.field(default_factory=dict)
    stride: dict[Pattern, Finite] = dataclasses.field(default_factory=dict)


@dataclasses.dataclass(frozen=True)
class Balance:
    """Weights per joint pattern of the balance corrections."""

    __pydantic_config__ = STRICT
    pitch: dict[Pattern, Finite] = dataclasses.field(default_factory=dict)
    roll: dict[Pattern, Finite] = dataclasses.field(default_factory=dict)


@dataclasses.dataclass(frozen=True)
class Stepping:
    """Weights per joint pattern of the corrections that step under a fall.

    ahead, aside: rad per hip height, to move the foot ahead and to the left. turn: rad per rad, to
    turn it to the left.
    """

    __pydantic_config__ = STRICT
    ahead: dict[Pattern, Finite] = dataclasses.field(default_factory=dict)
    aside: dict[Pattern, Finite] = dataclasses.field(default_factory=dict)
    turn: dict[Pattern, Finite] = dataclasses.field(default_factory=dict)


@dataclasses.dataclass(frozen=True)
class Swing:
    """An arm's joint that swings with a leg's, by a share of its angle from standing."""

    __pydantic_config__ = STRICT
    leg: str
    share: Finite


@dataclasses.dataclass(frozen=True)
class Termination:
    """Conditions that end an episode as failed.

    The trunk's up axis against the world's, the trunk's height in standing heights, a touch.
    """

    __pydantic_config__ = STRICT
    min_up: Annotated[float, pydantic.Field(ge=-1, le=1)] = 0.5
    height: tuple[NonNegative, Positive] = (0.5, 1.5)
    touch: bool = True

    def __post_init__(self) -> None:
        if self.height[0] >= self.height[1]:
            raise ValueError(f"height = {list(self.height)}: the first must be the smaller")


@dataclasses.dataclass(frozen=True)
class RigSettings:
    """The character that the creature was imported from.

    file: its name. bones: name of the bone in it, by the part that was made of it. turned: by the
    part at the top of an arm that hangs, the quaternion (w, x, y, z), in the part's axes, from the
    file's rest pose to that of creature.xml.
    """

    __pydantic_config__ = STRICT
    file: str = ""
    bones: dict[str, str] = dataclasses.field(default_factory=dict)
    turned: dict[str, tuple[Finite, Finite, Finite, Finite]] = dataclasses.field(
        default_factory=dict
    )


@dataclasses.dataclass(frozen=True)
class Usual:
    """Default walk targets of the creature. gait: as after `--gait`."""

    __pydantic_config__ = STRICT
    gait: str = "auto"


@dataclasses.dataclass(frozen=True)
class CreatureSettings:
    """The whole of `creature.toml`."""

    __pydantic_config__ = STRICT
    creature: Identity
    joints: JointSettings
    joint: tuple[JointException, ...] = ()
    mirror: Mirror = dataclasses.field(default_factory=Mirror)
    steering: Steering = dataclasses.field(default_factory=Steering)
    balance: Balance = dataclasses.field(default_factory=Balance)
    stepping: Stepping = dataclasses.field(default_factory=Stepping)
    swing: dict[str, Swing] = dataclasses.field(default_factory=dict)
    termination: Termination = dataclasses.field(default_factory=Termination)
    rig: RigSettings = dataclasses.field(default_factory=RigSettings)
    usual: Usual = dataclasses.field(default_factory=Usual)
    train: dict[str, object] = dataclasses.field(default_factory=dict)
