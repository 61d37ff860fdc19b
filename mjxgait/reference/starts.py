"""Initial conditions and disturbances of simulations: poses, bodies, drives, ground and pushes.

Letters: `S` simulations, `J` actuated joints.
"""

import dataclasses

import mujoco
import numpy as np
from mujoco.batch import Batch

from mjxgait.creature import Creature


@dataclasses.dataclass(frozen=True, eq=False)
class Starts:
    """Initial conditions and disturbances, one row per simulation.

    joint_offset, joint_velocity: [S, J] rad, rad/s; added to the standing pose.
    friction: [S] factor on sliding friction. mass: [S, nbody] factor on mass and inertia.
    stiffness, damping: [S, J] factors on kp and kd.
    delay: [S] control steps by which torques are late.
    slope: [S, 2] rad, rise of the floor along the world's x and y.
    floor: [S] factor on the floor's softness (1 - d) / d, with MuJoCo's impedance d.
    push_time: [S] s, infinite for none.
    push: [S, 2] m/s, sudden change of the trunk's horizontal velocity in the world.
    end: [S] s at which the run stops; one still up then has stayed up. Infinite: never early.
    goal: [S] m ahead of the start; 0 if the task has none.
    light: [S, 3] m from the trunk's start; 0 if there is none.
    moved_light: [S, 3] m, the light from `light_time` on, s [S]; infinite: it does not move.
    bar: [S, 2] m ahead of the start and above the floor, lower edge of the bar; infinite if the
      task has none.
    refine: [S] physics steps per control step; the controller is unchanged and its torque is held
      in between.
    """

    joint_offset: np.ndarray
    joint_velocity: np.ndarray
    friction: np.ndarray
    mass: np.ndarray
    stiffness: np.ndarray
    damping: np.ndarray
    delay: np.ndarray
    slope: np.ndarray
    floor: np.ndarray
    push_time: np.ndarray
    push: np.ndarray
    end: np.ndarray
    goal: np.ndarray
    light: np.ndarray
    moved_light: np.ndarray
    light_time: np.ndarray
    bar: np.ndarray
    refine: np.ndarray

    def __len__(self) -> int:
        return len(self.friction)

    @property
    def undisturbed(self) -> np.ndarray:
        """Whether simulations [S] have no disturbance before their push."""
        plain = {"friction": 1, "mass": 1, "stiffness": 1, "damping": 1, "floor": 1}
        plain |= {"joint_offset": 0, "joint_velocity": 0, "delay": 0, "slope": 0, "refine": 1}
        same = [getattr(self, name) == value for name, value in plain.items()]
        return np.all([s.reshape(len(self), -1).all(1) for s in same], axis=0)

    def rows(self, index: slice | np.ndarray) -> "Starts":
        """Return some of the simulations."""
        return Starts(
            **{field.name: getattr(self, field.name)[index] for field in dataclasses.fields(self)}
        )


def join(*parts: Starts) -> Starts:
    """Concatenate the simulations of the parts."""
    return Starts(
        **{
            f.name: np.concatenate([getattr(p, f.name) for p in parts])
            for f in dataclasses.fields(Starts)
        }
    )


def nominal_starts(creature: Creature, count: int) -> Starts:
    """Return initial conditions without disturbances."""
    joints = len(creature.joints.names)
    return Starts(
        joint_offset=np.zeros((count, joints)),
        joint_velocity=np.zeros((count, joints)),
        friction=np.ones(count),
        mass=np.ones((count, creature.model.nbody)),
        stiffness=np.ones((count, joints)),
        damping=np.ones((count, joints)),
        delay=np.zeros(count, dtype=int),
        slope=np.zeros((count, 2)),
        floor=np.ones(count),
        push_time=np.full(count, np.inf),
        push=np.zeros((count, 2)),
        end=np.full(count, np.inf),
        goal=np.zeros(count),
        light=np.zeros((count, 3)),
        moved_light=np.zeros((count, 3)),
        light_time=np.full(count, np.inf),
        bar=np.full((count, 2), np.inf),
        refine=np.ones(count, dtype=int),
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
    """Draw noise (half widths in rad, rad/s, share of each body's mass) and a friction factor.

    All distributions are uniform.
    """
    plain = nominal_starts(creature, count)
    return dataclasses.replace(
        plain,
        joint_offset=rng.uniform(-joint_noise, joint_noise, plain.joint_offset.shape),
        joint_velocity=rng.uniform(-velocity_noise, velocity_noise, plain.joint_velocity.shape),
        friction=rng.uniform(*friction, count),
        mass=rng.uniform(1 - mass, 1 + mass, plain.mass.shape),
    )


def unfamiliar(
    starts: Starts,
    rng: np.random.Generator,
    *,
    gains: float = 0.0,
    latency: int = 0,
    slope: float = 0.0,
    floor: tuple[float, float] = (1.0, 1.0),
) -> Starts:
    """Add further disturbances, most of which evolution does not use by default.

    docs/reference/certificate.md lists those that are new to a champion, by the settings of its
    run.

    Args:
      gains: half width of each joint's kp and kd, as a share. latency: most control steps of delay.
      slope: rad, steepest, in any direction. floor: range of the softness factor, log-uniform:
        softer is as likely as harder if its ends are inverse to each other.
    """
    count, direction = len(starts), rng.uniform(0, 2 * np.pi, len(starts))
    return dataclasses.replace(
        starts,
        stiffness=rng.uniform(1 - gains, 1 + gains, starts.stiffness.shape),
        damping=rng.uniform(1 - gains, 1 + gains, starts.damping.shape),
        delay=rng.integers(latency, size=count, endpoint=True),
        slope=rng.uniform(0, slope, (count, 1))
        * np.stack([np.cos(direction), np.sin(direction)], 1),
        floor=np.exp(rng.uniform(np.log(floor[0]), np.log(floor[1]), count)),
    )


def pushed_starts(
    creature: Creature,
    count: int,
    rng: np.random.Generator,
    speed: float | np.ndarray,
    window: tuple[float, float],
) -> Starts:
    """Draw pushes of a speed in m/s ([] or [count]) at uniform moments of a window in s.

    Each quarter of the compass gets equally many.
    """
    sector = (np.arange(count) + rng.random(count)) / count
    direction = 2 * np.pi * rng.permutation(sector)
    push = np.broadcast_to(speed, (count,))[:, None] * np.stack(
        [np.cos(direction), np.sin(direction)], 1
    )
    return dataclasses.replace(
        nominal_starts(creature, count), push=push, push_time=rng.uniform(*window, count)
    )


def batch_of(creature: Creature, model: mujoco.MjModel, starts: Starts, threads: int = 1) -> Batch:
    """Return the simulations at their initial conditions."""
    batch = Batch(model, len(starts), min(threads, len(starts)), persistent=True)
    batch.expand("geom_friction")[:, :, 0] *= starts.friction[:, None]
    batch.expand("body_mass")[:] *= starts.mass
    batch.expand("body_inertia")[:] *= starts.mass[:, :, None]
    batch.expand("opt.gravity")[:] = _gravity(model, starts.slope)
    # Softness sets the impedance: the time constant is already as short as the time step allows.
    impedance = batch.expand("geom_solimp")[:, :, :2]
    impedance /= impedance + starts.floor[:, None, None] * (1 - impedance)
    batch.expand("opt.timestep")[:] /= starts.refine
    batch.set_const()
    batch.reset(stage=int(mujoco.mjtStage.mjSTAGE_NONE))
    qpos = batch.bind("qpos")
    qpos[:] = creature.stand_qpos
    qpos[:, creature.joints.qpos_adr] += starts.joint_offset
    batch.bind("qvel")[:, creature.joints.dof_adr] = starts.joint_velocity
    return batch


def _gravity(model: mujoco.MjModel, slope: np.ndarray) -> np.ndarray:
    """Return gravity [S, 3], tilted instead of the floor by slopes [S, 2].

    Heights are perpendicular to the slope, and the balance correction takes the slope for level.
    """
    angle = np.linalg.norm(slope, axis=1, keepdims=True)
    uphill = slope / np.where(angle > 0, angle, 1.0)
    change = np.concatenate([-np.sin(angle) * uphill, 1 - np.cos(angle)], 1)
    return model.opt.gravity + np.linalg.norm(model.opt.gravity) * change
