"""How simulations begin and are disturbed: joint noise, friction, masses, pushes. `S` simulations, `J` actuated joints."""

import dataclasses

import numpy as np

from mjxgait.creature import Creature


@dataclasses.dataclass(frozen=True, eq=False)
class Starts:
    """One row per simulation.

    joint_offset, joint_velocity: [S, J] rad, rad/s; added to the standing pose.
    friction: [S] factor on the sliding friction. mass: [S, nbody] factor on each body's mass and inertia.
    push_time: [S] s, infinite for none. push: [S, 2] m/s, sudden change of the trunk's horizontal velocity in the world.
    end: [S] s, from which nobody looks any more: who is up until then has stayed up. Infinite for the end of the simulation.
    """

    joint_offset: np.ndarray
    joint_velocity: np.ndarray
    friction: np.ndarray
    mass: np.ndarray
    push_time: np.ndarray
    push: np.ndarray
    end: np.ndarray

    def __len__(self) -> int:
        return len(self.friction)

    def rows(self, index: slice | np.ndarray) -> "Starts":
        """Some of the simulations."""
        return Starts(
            **{field.name: getattr(self, field.name)[index] for field in dataclasses.fields(self)}
        )


def join(*parts: Starts) -> Starts:
    """All simulations of the parts, in order."""
    return Starts(
        **{
            f.name: np.concatenate([getattr(p, f.name) for p in parts])
            for f in dataclasses.fields(Starts)
        }
    )


def nominal_starts(creature: Creature, count: int) -> Starts:
    """Undisturbed ones."""
    joints = len(creature.joint_names)
    return Starts(
        joint_offset=np.zeros((count, joints)),
        joint_velocity=np.zeros((count, joints)),
        friction=np.ones(count),
        mass=np.ones((count, creature.model.nbody)),
        push_time=np.full(count, np.inf),
        push=np.zeros((count, 2)),
        end=np.full(count, np.inf),
    )


def perturbed_starts(
    creature: Creature,
    count: int,
    rng: np.random.Generator,
    joint_noise: float = 0.05,
    velocity_noise: float = 0.1,
    friction: tuple[float, float] = (0.8, 1.2),
    mass: float = 0.05,
) -> Starts:
    """Uniform noise of these half widths (rad, rad/s, share of each body's mass), and a friction factor between two numbers."""
    plain = nominal_starts(creature, count)
    return dataclasses.replace(
        plain,
        joint_offset=rng.uniform(-joint_noise, joint_noise, plain.joint_offset.shape),
        joint_velocity=rng.uniform(-velocity_noise, velocity_noise, plain.joint_velocity.shape),
        friction=rng.uniform(*friction, count),
        mass=rng.uniform(1 - mass, 1 + mass, plain.mass.shape),
    )


def pushed_starts(
    creature: Creature,
    count: int,
    rng: np.random.Generator,
    speed: float | np.ndarray,
    window: tuple[float, float],
) -> Starts:
    """Pushes of a speed in m/s ([] or [count]) at uniform moments of a window in s, each quarter of the compass equally often."""
    sector = (np.arange(count) + rng.random(count)) / count
    direction = 2 * np.pi * rng.permutation(sector)
    push = np.broadcast_to(speed, (count,))[:, None] * np.stack(
        [np.cos(direction), np.sin(direction)], 1
    )
    return dataclasses.replace(
        nominal_starts(creature, count), push=push, push_time=rng.uniform(*window, count)
    )
