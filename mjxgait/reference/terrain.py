"""Ground of the reference simulator: heights in NumPy, a MuJoCo field (docs/reference/ground.md).

It shares only the specification of the ground with the one used in evolution.
"""

import dataclasses
import functools

import mujoco
import numpy as np

from mjxgait.creature import Creature
from mjxgait.creature.ground.spec import GroundSpec
from mjxgait.reference.layout import (
    FLOOR,
    Ground,
    StartFrame,
    start_frame,
)

AHEAD, BEHIND, ASIDE = 60.0, 8.0, 12.0
"""Reach of the field from the start in body lengths; there is no ground outside it."""
CELLS = {"slope": (0.25, 0.25), "steps": (0.05, 2.0), "bumps": (0.1, 0.1), "rough": (0.1, 0.1)}
"""Grid spacing along and across the way, in hip heights."""
THICKNESS = 1.0
"""m below the lowest point; more than any body sinks in."""
NEAR = 1e-4
"""m; half the distance over which the slope is measured."""


@dataclasses.dataclass(frozen=True, eq=False)
class Terrain:
    """Ground of one creature. start: its origin. hip, level: m, see docs/reference/ground.md."""

    spec: GroundSpec
    start: StartFrame
    hip: float
    level: float

    def height(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return heights in m at places in m in the world, of any shape."""
        east, north = x - self.start.place[0], y - self.start.place[1]
        ahead, left = (
            east * axis[0] + north * axis[1] for axis in (self.start.forward, self.start.left)
        )
        return self.rise(ahead, left)

    def steepness(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return the change [2, ...] of the height per metre along x and y."""
        x, y = np.asarray(x), np.asarray(y)
        far = NEAR * np.array([1.0, -1.0, 0.0, 0.0]).reshape(4, *(1,) * x.ndim)
        east, west, north, south = self.height(x + far, y + far[[2, 2, 0, 1]])
        return np.stack([east - west, north - south]) / (2 * NEAR)

    def rise(self, ahead: np.ndarray, left: np.ndarray) -> np.ndarray:
        """Return heights in m at places in m ahead and to the left of the start."""
        spec, level = self.spec, self.level
        away = np.clip(((ahead**2 + left**2) / level**2 - 1) / 3, 0, 1)
        full = away**2 * (3 - 2 * away)
        sign = -1 if spec.direction == "down" else 1
        match spec.kind:
            case "slope" if spec.direction == "across":
                return spec.size * left * full
            case "slope":
                way = np.maximum(ahead - level, 0)
                return (
                    sign * spec.size * np.where(way < level, way**2 / (2 * level), way - level / 2)
                )
            case "steps":
                steps = np.maximum((ahead - level) / self.hip - self.draws[0, 1], 0)
                done, rest = np.divmod(steps, 1.0)
                up = np.clip((rest - 0.8) / 0.2, 0, 1)
                return sign * spec.size * self.hip * (done + up**2 * (3 - 2 * up))
            case _:
                return self._waves(ahead, left) * full

    def _waves(self, ahead: np.ndarray, left: np.ndarray) -> np.ndarray:
        along, across, phase, size = self.waves
        ahead, left = np.asarray(ahead)[..., None], np.asarray(left)[..., None]
        return parabolic_wave(ahead * along + left * across + phase) @ size

    @functools.cached_property
    def waves(self) -> np.ndarray:
        """Waves [4, W]: cycles per metre ahead and to the left, cycles at the start, size in m."""
        rough = self.spec.kind == "rough"
        lengths = np.array([1.5, 2.0, 2.7, 3.6, 4.8] if rough else [2.0, 2.0]) * self.hip
        directions, phases = self.draws[: len(lengths)].T
        angle = np.pi * (np.arange(len(lengths)) + (directions if rough else 0.5)) / len(lengths)
        size = self.spec.size * self.hip * lengths / lengths.sum()
        return np.stack([np.cos(angle) / lengths, np.sin(angle) / lengths, phases, size])

    @functools.cached_property
    def draws(self) -> np.ndarray:
        """Random numbers [5, 2] in [0, 1) from the seed."""
        return np.random.RandomState(self.spec.seed).random_sample((5, 2))


def parabolic_wave(cycles: np.ndarray) -> np.ndarray:
    """Approximate a sine between -1 and 1: per cycle one parabola up and one down."""
    place = cycles % 1.0
    return np.where(place < 0.5, 16 * place * (0.5 - place), -16 * (place - 0.5) * (1 - place))


def terrain_of(creature: Creature) -> Ground | None:
    """Return the ground of a creature; None for the plane z = 0."""
    if creature.terrain.flat:
        return None
    return Terrain(
        creature.terrain,
        start_frame(creature),
        creature.frame.hip_height,
        creature.frame.body_length,
    )


@functools.lru_cache(maxsize=2)
def grounded_model(creature: Creature) -> mujoco.MjModel:
    """Return the creature's model with its ground as a height field in place of the floor.

    Indices, gravity and friction are the model's own. Do not change the result: it is cached.
    """
    terrain = terrain_of(creature)
    if not isinstance(terrain, Terrain):
        return creature.model
    heights, middle, reach = sampled(terrain, creature)
    spec = mujoco.MjSpec.from_string(creature.files["creature.xml"])
    low, span = float(heights.min()), max(float(np.ptp(heights)), 1e-6)
    rows, columns = heights.shape
    spec.add_hfield(
        name="ground",
        nrow=rows,
        ncol=columns,
        size=[*reach, span, THICKNESS],
        userdata=np.zeros(heights.size),
    )
    floor, forward = spec.geom(FLOOR), terrain.start.forward
    floor.type, floor.hfieldname = mujoco.mjtGeom.mjGEOM_HFIELD, "ground"
    floor.pos = [*middle, low]
    turn = np.arctan2(forward[1], forward[0]) / 2
    floor.quat = [np.cos(turn), 0.0, 0.0, np.sin(turn)]
    model = spec.compile()
    # The compiler stretches heights to the full range, so set them afterwards.
    model.hfield_data[:] = ((heights - low) / span).ravel()
    model.opt.gravity[:] = creature.model.opt.gravity
    model.geom_friction[:] = creature.model.geom_friction
    return model


def sampled(terrain: Terrain, creature: Creature) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return heights [across, along] in m, the grid's middle [2] and half its sides [2]."""
    along, across = (cell * creature.frame.hip_height for cell in CELLS[terrain.spec.kind])
    length = creature.frame.body_length
    ahead = np.arange(-BEHIND * length, AHEAD * length + along, along)
    count = int(np.ceil(ASIDE * length / across))
    left = np.arange(-count, count + 1) * across
    heights = terrain.rise(ahead[None, :], left[:, None])
    centre = (ahead[0] + ahead[-1]) / 2
    return (
        np.broadcast_to(heights, (len(left), len(ahead))),
        terrain.start.place[:2] + centre * terrain.start.forward[:2],
        np.array([np.ptp(ahead), np.ptp(left)]) / 2,
    )
