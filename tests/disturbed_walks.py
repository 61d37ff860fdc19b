"""A small walking body with every disturbance of a start, for tests of parity."""

import dataclasses
from pathlib import Path

import numpy as np
from certify_made_up import LEGS, TOML, XML, make_champion
from helpers import small_config

from mjxgait.certification.trials import simulate
from mjxgait.champion import Champion
from mjxgait.config.schema import Config
from mjxgait.creature import Creature, load_creature
from mjxgait.reference import starts as examined
from mjxgait.reference.outcome import Fall, Outcome
from mjxgait.tasks.walk.stats import WalkStats

STEP, SECONDS = 0.005, 1.2
STEPS = round(SECONDS / STEP)

BUMPER = (
    '<geom name="bumper" type="sphere" size="0.02" pos="-0.2 0 -0.279" mass="0.1" '
    'contype="4" conaffinity="0"/>'
)
"""Touches the floor in lively motion.

The floor carries neither it nor the trunk: in evolution it carries only feet, and the reference
simulator must have the same world.
"""
BODY = XML.replace(
    'mass="4" contype="0" conaffinity="1"/>', f'mass="4" contype="4" conaffinity="0"/>{BUMPER}'
)
TABLE = TOML.replace("torque_limit = 12.0", "torque_limit = 8.0").replace("[-45, 45]", "[-25, 40]")

GENES_OF_THE_GAIT = {
    "period": 0.4837,  # no pose falls on a step, where float32 would decide
    "steer": 1.0,
    "pitch": 0.3,
    "pitch_rate": 0.05,
    "roll": 0.4,
    "roll_rate": 0.03,
}
SETTINGS: dict[str, dict] = {
    "stable PD": {"controller": {"advance": "clock"}},
    "with constraint forces": {
        "controller": {"advance": "clock"},
        "drive": {"constraint_forces": True},
    },
    "by the pose error, soft": {"drive": {"stiffness": 0.7, "damping": 1.5}},
    "plain PD, without the mirror": {
        "controller": {"advance": "clock", "mirror": False},
        "drive": {"law": "pd"},
    },
}
PUSH_AT = 60


@dataclasses.dataclass(frozen=True)
class Disturbance:
    """Deviations of a start from the nominal one.

    push: m/s forward and left. gains: share of kp and kd. delay: of torques, in steps.
    """

    friction: float = 1.0
    push: tuple[float, float] = (0.0, 0.0)
    joints: float = 0.0
    spin: float = 0.0
    gains: float = 0.0
    delay: int = 0


DISTURBANCES = {
    "nominal": Disturbance(),
    "half the friction": Disturbance(friction=0.5),
    "pushed forward": Disturbance(push=(0.3, 0.0)),
    "pushed to the left": Disturbance(push=(0.0, 0.25)),
    "joints displaced": Disturbance(joints=0.08),
    # With 0.8, plain MJX in single precision ends elsewhere on some processors.
    "joints moving": Disturbance(spin=0.9),
    "other gains": Disturbance(gains=0.3),
    "torques two steps late": Disturbance(delay=2),
    "all at once": Disturbance(0.6, (-0.2, -0.2), 0.05, 0.5, 0.2, 1),
    "knocked over": Disturbance(push=(0.0, 3.0)),
}
EPISODES = [(settings, disturbance) for settings in SETTINGS for disturbance in DISTURBANCES]
FALL = Fall(touch=False)
"""A touch does not end an episode, or there would be none to count."""
LENIENT = {"termination": {"touch": FALL.touch}, "latency": 2}
CONFIGS = [small_config(**tables, rollout=LENIENT) for tables in SETTINGS.values()]
"""One per row of settings."""


def make_body(folder: Path) -> Creature:
    """Write the creature into a folder and load it."""
    (folder / "creature.xml").write_text(BODY)
    (folder / "creature.toml").write_text(TABLE)
    return load_creature(folder)


def poses(creature: Creature) -> np.ndarray:
    """A trot: one diagonal pair swings while the other pushes."""
    column = {name: i for i, name in enumerate(creature.joints.names)}
    found = np.zeros((2, 8))
    for leg in LEGS:
        swings = leg in ("front_left", "hind_right")
        found[:, column[f"{leg}_hip"]] = (-0.5, -0.2) if swings else (0.0, 0.2)
        found[:, column[f"{leg}_knee"]] = (0.75, 0.1) if swings else (0.1, 0.1)
    return found


def disturbed(creature: Creature) -> examined.Starts:
    """The disturbances as starts of the reference simulator."""
    rng = np.random.default_rng(1)
    plain = examined.nominal_starts(creature, len(DISTURBANCES))
    rows = list(DISTURBANCES.values())
    noise = rng.uniform(-1, 1, (4, 8))
    return dataclasses.replace(
        plain,
        joint_offset=np.array([row.joints * noise[0] for row in rows]),
        joint_velocity=np.array([row.spin * noise[1] for row in rows]),
        stiffness=np.array([1 + row.gains * noise[2] for row in rows]),
        damping=np.array([1 + row.gains * noise[3] for row in rows]),
        friction=np.array([row.friction for row in rows]),
        delay=np.array([row.delay for row in rows]),
        push=np.array([row.push for row in rows]),
        push_time=np.array([(PUSH_AT + 0.5) * STEP if any(row.push) else np.inf for row in rows]),
    )


def champion_of(creature: Creature, config: Config) -> Champion:
    """The gait under the settings of controller and drive."""
    champion = make_champion(creature, poses(creature), GENES_OF_THE_GAIT)
    return dataclasses.replace(champion, settings=config.controller, drive=config.drive)


def watched(creature: Creature) -> list[Outcome]:
    """Outcomes of the reference simulator per settings.

    Each has a frame more than an episode, for the next position in the cycle.
    """
    rows = disturbed(creature)
    return [
        simulate(
            creature,
            champion_of(creature, config),
            rows,
            SECONDS + STEP,
            record=len(rows),
            fall=FALL,
        )
        for config in CONFIGS
    ]


COUNTS = {
    "contact": 2,
    "airborne": 2,
    "touch": 2,
    "saturation": 0.5,
    "limits": 0.5,
}
EXACT = ("steps", "reason", "swings", "swinging", "foot_down")
TOLERANCE = COUNTS | dict.fromkeys(EXACT, 0)
"""Tolerances of counts, in steps; all else may differ by 1e-4 (m, rad, ...) plus 0.2 %."""
UNCOMPARED = {
    "overlap": "looked at every 16 steps only; tests/physics/test_overlap.py holds it against C"
}
"""Fields of the statistics without a counterpart in `recorded_stats`, with the reason."""
FIELDS = [field.name for field in dataclasses.fields(WalkStats) if field.name not in UNCOMPARED]


def tolerance(name: str, value: np.ndarray | float) -> float:
    """Allowed difference from a value."""
    return TOLERANCE.get(name, 1e-4 + 2e-3 * float(np.abs(value).max()))
