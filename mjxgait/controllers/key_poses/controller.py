"""Key-pose controller: mirroring, interpolation, corrections, advance.

Specification: docs/reference/controller.md.

Every function is for one creature; the rollout maps it over its lanes.
"""

import dataclasses
from collections.abc import Mapping
from typing import ClassVar

import jax
import jax.numpy as jnp
import numpy as np

from mjxgait.config.evolution import EvolutionConfig
from mjxgait.config.traced import chosen
from mjxgait.controllers.base import Command, Senses
from mjxgait.controllers.key_poses.config import STEPPING, TUNING, PoseConfig
from mjxgait.controllers.key_poses.operators import pose_variation
from mjxgait.creature.body import Body
from mjxgait.evolution.variation import Box, Variation, in_ranges, projected
from mjxgait.types import Number, pytree

THRESHOLD, PERIOD, STEER, PITCH, PITCH_RATE, ROLL, ROLL_RATE = range(len(TUNING))
READS = ("joint_pos", "heading", "aside", "pitch", "roll", "pitch_rate", "roll_rate")
STEP_READS = ("foot_height", "foot_place", "nose_vel")
LIFTED = 0.02
"""Foot height, in hip heights, above which a foot is fully in swing."""
GRAVITY = 9.81
"""m/s²; scales speeds by hip height, to compare bodies."""
MAX_CORRECTION = 0.5
"""rad, or relative stride length: largest change of the target by one correction."""


@pytree
class Genome:
    """Evolvable values. key_poses: [..., K, J] rad. tuning: [..., E] in the order of `TUNING`."""

    key_poses: jax.Array
    tuning: jax.Array


@pytree
class PoseCycle:
    """Plan of an episode, from a genome and the settings.

    poses: [C, J] rad; the first `count` [] are the cycle. tuning: [E]. interpolation: [] steps
    between neighbours. clocked: [] whether the clock advances the target. steering: factor on the
    steering weights.
    """

    poses: jax.Array
    tuning: jax.Array
    count: jax.Array
    interpolation: jax.Array
    clocked: jax.Array
    steering: float = dataclasses.field(default=1.0, metadata={"static": True})


@pytree
class GaitState:
    """Controller memory: position [] in interpolation steps, control steps [] since the start."""

    position: jax.Array
    steps: jax.Array


@dataclasses.dataclass(frozen=True, eq=False)
class PoseTracker:
    """Controller that tracks a creature's cycle of key poses. step: s between two control steps."""

    creature: Body
    step: float
    command: ClassVar[Command] = "pose"
    every: ClassVar[int] = 1

    @property
    def reads(self) -> tuple[str, ...]:
        """See `Controller`."""
        return READS + (STEP_READS if self.creature.corrections.steps else ())

    def bounds(self, config: PoseConfig) -> tuple[Genome, Genome]:
        """Return the lowest and highest genome: key_poses [K, J], tuning [E]."""
        low, high = (
            jnp.stack([jnp.float32(ends[end]) for ends in self._ranges(config)]) for end in (0, 1)
        )
        shape = (config.key_poses, len(self.creature.joints.names))

        def genome(pose: Number, tuning: jax.Array) -> Genome:
            return Genome(jnp.broadcast_to(jnp.asarray(pose, jnp.float32), shape), tuning)

        joints = self.creature.joints
        lowest, highest = genome(joints.pose_low, low), genome(joints.pose_high, high)
        if not config.around:
            return lowest, highest
        middle, width = self._original(config), jnp.radians(config.within)
        return (
            dataclasses.replace(lowest, key_poses=jnp.maximum(lowest.key_poses, middle - width)),
            dataclasses.replace(highest, key_poses=jnp.minimum(highest.key_poses, middle + width)),
        )

    def _ranges(self, config: PoseConfig) -> list[tuple[Number, Number]]:
        """Return the ranges of the tuning genes."""
        usual = [getattr(config.tuning, name) for name in TUNING]
        if not self.creature.corrections.steps:
            return usual
        return [*usual, *(getattr(config.stepping, name) for name in STEPPING)]

    def _original(self, config: PoseConfig) -> jax.Array:
        """Return the key poses [K, J] of `config.around`, clipped to the pose ranges."""
        joints, shape = self.creature.joints, (config.key_poses, len(self.creature.joints.names))
        given = jnp.stack([jnp.float32(angle) for angle in config.around]).reshape(shape)
        low, high = (edge.astype(np.float32) for edge in (joints.pose_low, joints.pose_high))
        return jnp.clip(given, low, high)

    def variation(self, settings: PoseConfig, evolution: EvolutionConfig) -> Variation:
        """The first created genome has the key poses of `settings.around`."""
        usual = pose_variation(Box(*self.bounds(settings)), evolution)
        if settings.around:
            created = usual.create

            def create(key: jax.Array, count: int) -> Genome:
                made = created(key, count)
                poses = made.key_poses.at[0].set(self._original(settings))
                return dataclasses.replace(made, key_poses=poses)

            usual = dataclasses.replace(usual, create=create)
        elif self.creature.joints.swings:
            usual = projected(usual, self._swinging)
        if settings.in_phase and self.creature.mirror.symmetric:
            usual = projected(usual, self._in_phase)
        return usual

    def _swinging(self, genome: Genome) -> Genome:
        """Return genomes with arms that swing with legs (`Joints.swings`)."""
        joints, poses = self.creature.joints, genome.key_poses
        for arm, leg, share in joints.swings:
            angle = joints.stand[arm] + share * (poses[..., leg] - joints.stand[leg])
            angle = jnp.clip(angle, joints.pose_low[arm], joints.pose_high[arm])
            poses = poses.at[..., arm].set(angle)
        return dataclasses.replace(genome, key_poses=poses)

    def _in_phase(self, genome: Genome) -> Genome:
        """Return genomes with the mean of each pose [..., K, J] and its mirror image."""
        poses = genome.key_poses
        mean = 0.5 * (poses + mirrored(self.creature, poses))
        return dataclasses.replace(genome, key_poses=mean)

    def genes(self, genomes: Genome, settings: PoseConfig) -> np.ndarray:
        """See `Controller`."""
        return in_ranges(genomes, Box(*self.bounds(settings)))

    def genome_statistics(self, genomes: Genome) -> Mapping[str, np.ndarray]:
        """Report no quantities."""
        return {}

    def prepare(self, genome: Genome, config: PoseConfig) -> PoseCycle:
        """Return the whole cycle of a genome [K, J] under the settings, plain or traced."""
        poses = pose_cycle(self.creature, genome.key_poses)
        count = jnp.where(config.mirror, poses.shape[0], config.key_poses)
        return PoseCycle(
            poses,
            genome.tuning,
            count,
            jnp.int32(config.interpolation),
            chosen(config.advance, "clock"),
            config.steering,
        )

    def load(self, plan: PoseCycle) -> None:
        """Equal for all individuals."""

    def init(self) -> GaitState:
        """Return the state at the start of an episode."""
        return GaitState(position=jnp.zeros((), jnp.int32), steps=jnp.zeros((), jnp.int32))

    def act(
        self, cycle: PoseCycle, state: GaitState, senses: Senses
    ) -> tuple[jax.Array, GaitState]:
        """Return the target pose [J] of this control step, and the next state."""
        creature = self.creature
        target = interpolate(cycle.poses, state.position, cycle.interpolation, cycle.count)
        if creature.corrections.steps:
            stand = jnp.asarray(creature.joints.stand, jnp.float32)
            target = stand + begun(cycle.tuning, state.steps, self.step) * (target - stand)
        target = target + corrections(creature, cycle.tuning, target, senses, cycle.steering)
        target = jnp.clip(
            target, creature.joints.low.astype(np.float32), creature.joints.high.astype(np.float32)
        )
        steps = state.steps + 1
        positions = cycle.count * cycle.interpolation
        reached = jnp.mean((target - senses["joint_pos"]) ** 2) < cycle.tuning[THRESHOLD] ** 2
        by_clock = clock_position(steps, self.step, cycle.tuning[PERIOD], positions)
        position = jnp.where(cycle.clocked, by_clock, state.position + reached) % positions
        return target, GaitState(position, steps)


def pose_cycle(creature: Body, key_poses: jax.Array) -> jax.Array:
    """Return the cycle [C, J]: key poses [K, J] and, if symmetric, their mirror images."""
    if not creature.mirror.symmetric:
        return key_poses
    return jnp.concatenate([key_poses, mirrored(creature, key_poses)])


def mirrored(creature: Body, poses: jax.Array) -> jax.Array:
    """Return the mirror images of poses [..., J]."""
    return poses[..., creature.mirror.partner] * creature.mirror.sign.astype(np.float32)


def clock_position(
    steps: jax.Array, step: float, period: jax.Array, positions: jax.Array
) -> jax.Array:
    """Return the position [] in a cycle after `steps` [] of `step` s.

    The cycle has `positions` [] and lasts `period` [] s.
    Uses integers that overflow at the end of a cycle: float32 time would drift away from the
    reference controller's.
    """
    turns = step / period
    turn = ((turns - jnp.floor(turns)) * 2.0**32).astype(jnp.uint32)
    phase = steps.astype(jnp.uint32) * turn
    place = ((phase >> 16) + 1) * positions.astype(jnp.uint32) >> 16
    return place.astype(jnp.int32) % positions


def interpolate(
    poses: jax.Array, position: jax.Array, n: jax.Array | int, count: jax.Array | int
) -> jax.Array:
    """Return the target pose [J] at a position [] of a cycle with n steps between neighbours.

    The cycle is the first `count` [] of the poses [C, J]. A weighted sum over all poses replaces
    two look-ups: with lanes innermost a look-up would be a gather per lane.
    """
    places = np.arange(poses.shape[0])
    ahead = (position / n - places) % count
    behind = (places - position / n) % count
    weight = jnp.where(places < count, jnp.maximum(0.0, 1.0 - jnp.minimum(ahead, behind)), 0.0)
    return jnp.sum(weight[:, None] * poses, axis=0)


def begun(tuning: jax.Array, steps: jax.Array, step: float) -> jax.Array:
    """Return the blend [] from standing pose (0) to cycle (1) after `steps` [] of `step` s."""
    over = tuning[len(TUNING) + STEPPING.index("begin")]
    return jnp.minimum(1.0, (steps + 1) * step / jnp.maximum(over, step))


def corrections(
    creature: Body,
    tuning: jax.Array,
    target: jax.Array,
    senses: Senses,
    steering: float = 1.0,
) -> jax.Array:
    """Return the change [J] of the target pose by steering and balance; zero if the genes are zero.

    steering: factor on the creature's steering weights.
    """
    wrong = off_the_way(creature, senses)
    steer = _clip(tuning[STEER] * wrong)
    pitch, roll = (
        _clip(tuning[angle] * senses[name] + tuning[rate] * senses[f"{name}_rate"])
        for name, angle, rate in (("pitch", PITCH, PITCH_RATE), ("roll", ROLL, ROLL_RATE))
    )
    bend, stride, on_pitch, on_roll, stand = (
        value.astype(np.float32)
        for value in (
            creature.corrections.steer_bend * steering,
            creature.corrections.steer_stride * steering,
            creature.corrections.balance_pitch,
            creature.corrections.balance_roll,
            creature.joints.stand,
        )
    )
    change = (target - stand) * steer * stride + steer * bend + pitch * on_pitch + roll * on_roll
    if not creature.corrections.steps:
        return change
    return change + stepping(creature, tuning[len(TUNING) :], senses)


def stepping(creature: Body, genes: jax.Array, senses: Senses) -> jax.Array:
    """Return the change [J] of the target pose by stepping under a fall.

    genes: [10] in the order of `STEPPING`.
    After SIMBICON (Yin, Loken & van de Panne 2007): the swing leg steps further, by the trunk's
    offset from its support and its speed. The stance hip turns the trunk upright and back to its
    path.
    """
    weights, hip = creature.corrections.stepping, creature.frame.hip_height
    assert weights is not None
    step, step_rate, side, side_rate, hold, hold_rate, sway, sway_rate, _, turn = genes
    swing = jnp.clip(senses["foot_height"] / (LIFTED * hip), 0.0, 1.0)
    stance = 1.0 - swing
    moved = senses["foot_place"] - creature.feet.places.astype(np.float32)
    share = stance / jnp.maximum(jnp.sum(stance), 1.0)
    over = -jnp.sum(share[:, None] * moved, axis=0) / hip
    speed = senses["nose_vel"] / jnp.sqrt(GRAVITY * hip)
    ahead = _clip(step * over[0] + step_rate * speed[0])
    aside = _clip(side * over[1] + side_rate * speed[1])
    pitch = _clip(hold * senses["pitch"] + hold_rate * senses["pitch_rate"])
    roll = _clip(sway * senses["roll"] + sway_rate * senses["roll_rate"])
    yaw = _clip(turn * off_the_way(creature, senses))
    wanted = (
        (swing * ahead - stance * pitch, weights.ahead),
        (swing * aside + stance * roll, weights.aside),
        ((stance - swing) * yaw, weights.turn),
    )
    by_joint = ((jnp.stack([feet[leg] for leg in weights.legs]), by) for feet, by in wanted)
    return sum((of * by.astype(np.float32) for of, by in by_joint), start=jnp.zeros(()))


def off_the_way(creature: Body, senses: Senses) -> jax.Array:
    """Return the deviation [] in rad left of the path: heading plus scaled lateral offset."""
    aside = senses["aside"] / (2 * creature.frame.body_length)
    return senses["heading"] + aside


def _clip(correction: jax.Array) -> jax.Array:
    return jnp.clip(correction, -MAX_CORRECTION, MAX_CORRECTION)
