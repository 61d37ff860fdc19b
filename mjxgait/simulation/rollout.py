"""Simulates many episodes: a fixed number of lanes per device, each taking the next waiting episode when its own has ended.

Cost follows the steps that creatures live, memory the number of lanes, whatever the population and the length of the episode. The episodes
may belong to several evolution runs, the rows `B` of every array here, each with its own starts and settings: they share the lanes.
"""

import dataclasses
from collections.abc import Callable
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.sharding import Mesh, PartitionSpec
from jax.typing import ArrayLike

from mjxgait.control import spd
from mjxgait.control.poses import PoseTracker
from mjxgait.creature import Creature
from mjxgait.settings.config import Config
from mjxgait.settings.traced import chosen
from mjxgait.simulation.starts import Starts
from mjxgait.tasks.walk.tally import Judge, Reason, Tally
from mjxgait.types import BodyState, Plant, pytree

CHECK_EVERY = 16
"""Steps between two looks at which lanes are free (a look costs about as much as a step),
and at how deep parts are in each other."""
AXIS = "lanes"


@pytree
class Episodes:
    """All episodes of a generation: tally with leaves [B, N, R, ...], and the steps computed [] for them, those of idle lanes included."""

    tally: Tally
    computed_steps: jax.Array


@pytree
class Rules:
    """What the settings say about an episode; all [].

    stable: stable PD, else plain PD. constraint_forces: whether it counts them. stiffness, damping: factors on kp and kd.
    clearance: m wanted of each foot in each stride.
    """

    stable: jax.Array
    constraint_forces: jax.Array
    stiffness: jax.Array
    damping: jax.Array
    clearance: jax.Array


@pytree
class Lane:
    """One simulation in flight. job: [] place in the device's queue; cycle and control: the controller's own; push as in `Starts`."""

    job: jax.Array
    body: BodyState
    cycle: Any
    control: Any
    tally: Tally
    rules: Rules
    push: jax.Array
    push_step: jax.Array


@dataclasses.dataclass(frozen=True, eq=False)
class Simulator:
    """Everything static about the episodes of one creature. steps: T per episode; lanes: L per device; mesh: the devices."""

    creature: Creature
    plant: Plant
    tracker: PoseTracker
    judge: Judge
    steps: int
    lanes: int
    mesh: Mesh

    def simulate(self, genomes: Any, starts: Starts, settings: Config) -> Episodes:
        """Every genome (leaves [B, N, ...]) on every start [B, R] of its row, under the row's traced settings, leaves [B, ...].

        The order of results is the order of the genomes.
        """
        shape = (*jax.tree.leaves(genomes)[0].shape[:2], starts.friction.shape[1])
        total, devices = int(np.prod(shape)), self.mesh.size
        queue = -(-total // devices)
        jobs = jnp.arange(queue * devices, dtype=jnp.int32).reshape(queue, devices).T.reshape(-1)
        run = jax.shard_map(
            partial(self._run_queue, total=total),
            mesh=self.mesh,
            in_specs=(PartitionSpec(AXIS), PartitionSpec(), PartitionSpec(), PartitionSpec()),
            out_specs=PartitionSpec(AXIS),
            check_vma=False,
        )
        tally, computed = run(jobs, genomes, starts, settings)

        def in_order(leaf: jax.Array) -> jax.Array:
            by_device = leaf.reshape(devices, queue, *leaf.shape[1:])
            return (
                jnp.swapaxes(by_device, 0, 1)
                .reshape(-1, *leaf.shape[1:])[:total]
                .reshape(*shape, *leaf.shape[1:])
            )

        return Episodes(jax.tree.map(in_order, tally), jnp.sum(computed))

    def _run_queue(
        self, jobs: jax.Array, genomes: Any, starts: Starts, settings: Config, *, total: int
    ) -> tuple[Tally, jax.Array]:
        """Works off one device's queue of jobs [Q]: tally with leaves [Q, ...], and the computed steps [1]."""
        queue = jobs.shape[0]
        lanes = min(self.lanes, queue)
        waiting = jnp.sum(jobs < total)

        def fresh(places: jax.Array) -> Lane:
            job = jnp.where(places < waiting, places, queue)
            lane = jax.vmap(partial(self._fresh_lane, genomes, starts, settings))(
                job, jobs[jnp.minimum(places, queue - 1)]
            )
            return jax.tree.map(lambda leaf: jnp.moveaxis(leaf, 0, self.plant.lane_axis), lane)

        def store(results: Tally, place: jax.Array, tally: Tally) -> Tally:
            return jax.tree.map(
                lambda rows, leaf: rows.at[place].set(
                    jnp.moveaxis(leaf, self.plant.lane_axis, 0), mode="drop"
                ),
                results,
                tally,
            )

        def body(
            carry: tuple[Lane, Tally, jax.Array, jax.Array],
        ) -> tuple[Lane, Tally, jax.Array, jax.Array]:
            lane, results, taken, rounds = carry
            lane = jax.lax.fori_loop(0, CHECK_EVERY, lambda _, lane: self._step(lane), lane)
            lane = self._look_for_overlap(lane)
            done = (lane.tally.steps >= self.steps) | (lane.tally.reason != Reason.FINISHED)
            results = store(results, jnp.where(done, lane.job, queue), lane.tally)
            lane = self._per_lane(_choose)(done, fresh(taken + jnp.cumsum(done) - 1), lane)
            return lane, results, taken + jnp.sum(done), rounds + 1

        results = jax.tree.map(
            lambda leaf: jnp.zeros((queue, *leaf.shape), leaf.dtype), self.judge.init()
        )
        carry = (fresh(jnp.arange(lanes)), results, jnp.int32(lanes), jnp.int32(0))
        # Not a while_loop: XLA's CPU compiler aborts on the fast plant's kernels in a loop whose length it does not know. Whenever a lane
        # is free it takes a job, so this many rounds always suffice (Graham 1966); what is left of them costs next to nothing.
        longest = -(-self.steps // CHECK_EVERY) + 1
        most = -(-queue * longest // lanes) + longest
        carry = jax.lax.fori_loop(
            0,
            most,
            lambda _, carry: jax.lax.cond(
                jnp.any(carry[0].job < queue), body, lambda same: same, carry
            ),
            carry,
        )
        return carry[1], (carry[3] * (CHECK_EVERY * lanes))[None]

    def _fresh_lane(
        self, genomes: Any, starts: Starts, settings: Config, job: jax.Array, episode: jax.Array
    ) -> Lane:
        """The lane at the start of an episode []: of row, genome and start, the start changes fastest."""
        count, individuals = starts.friction.shape[1], jax.tree.leaves(genomes)[0].shape[1]
        row, individual = episode // (individuals * count), episode // count % individuals
        start = jax.tree.map(lambda leaf: leaf[row, episode % count], starts)
        mine = jax.tree.map(lambda leaf: leaf[row], settings)
        still = jnp.zeros_like(start.qvel)
        return Lane(
            job=job,
            body=BodyState(
                start.qpos,
                start.qvel,
                warmstart=still,
                constraint_force=still,
                friction=start.friction,
            ),
            cycle=self.tracker.prepare(
                jax.tree.map(lambda leaf: leaf[row, individual], genomes), mine.controller
            ),
            control=self.tracker.init(),
            tally=self.judge.init(),
            rules=self._rules(mine),
            push=start.push,
            push_step=start.push_step,
        )

    def _rules(self, settings: Config) -> Rules:
        law = settings.controller
        return Rules(
            stable=chosen(law.law, "spd"),
            constraint_forces=jnp.asarray(law.constraint_forces),
            stiffness=jnp.asarray(law.stiffness, jnp.float32),
            damping=jnp.asarray(law.damping, jnp.float32),
            clearance=jnp.asarray(
                settings.fitness.clearance * self.creature.hip_height, jnp.float32
            ),
        )

    def _step(self, lane: Lane) -> Lane:
        """All lanes one control step on. A lane whose episode has ended moves on too, but its tally stands still."""
        body = self._per_lane(_push)(lane)
        sensed, workings = self.plant.forward(body)
        target, control = self._per_lane(self.tracker.target)(lane.cycle, lane.control, sensed)
        torque = self.torque(lane.rules, body, sensed, workings, target)
        tally = self._per_lane(self._judge)(lane.rules, lane.tally, sensed, torque)
        body = self.plant.advance(body, workings, self._per_lane(self._lift)(torque))
        return dataclasses.replace(lane, body=body, control=control, tally=tally)

    def _look_for_overlap(self, lane: Lane) -> Lane:
        """The lanes with the deepest that parts were in each other, where an episode goes on."""
        tally, depth = lane.tally, self.plant.overlap(lane.body)
        going = (tally.reason == Reason.FINISHED) & (tally.steps < self.steps)
        # A comparison, not a maximum: a state that is NaN is for the next step to find.
        deeper = jnp.where(going & (depth > tally.overlap), depth, tally.overlap)
        return dataclasses.replace(lane, tally=dataclasses.replace(tally, overlap=deeper))

    def torque(
        self, rules: Rules, body: BodyState, sensed: Any, workings: Any, target: jax.Array
    ) -> jax.Array:
        """Joint torques in N·m, [J] per lane; rules, states and target [J] per lane, too.

        Plain PD is stable PD that looks no step ahead.
        """
        creature, step = self.creature, self.tracker.step
        limit = creature.torque_limit.astype(np.float32)

        def pull(
            rules: Rules, pos: jax.Array, vel: jax.Array, goal: jax.Array
        ) -> tuple[jax.Array, jax.Array, jax.Array]:
            kp, kd = (
                creature.kp.astype(np.float32) * rules.stiffness,
                creature.kd.astype(np.float32) * rules.damping,
            )
            ahead = jnp.where(rules.stable, step, 0.0)
            return spd.pd_force(pos, vel, goal, kp, kd, ahead), ahead * kd, self._lift(step * kd)

        force, braked, damping = self._per_lane(pull)(
            rules, sensed.joint_pos, sensed.joint_vel, target
        )
        pushed = jnp.where(rules.constraint_forces, 1.0, 0.0)
        total = self._per_lane(lambda f, c, on, bias: self._lift(f) + on * c - bias)(
            force, body.constraint_force, pushed, sensed.bias
        )
        acceleration = self.plant.solve_damped(workings, damping, total)
        return self._per_lane(lambda f, a, b: spd.limited_torque(f, a[creature.dof_adr], b, limit))(
            force, acceleration, braked
        )

    def _judge(self, rules: Rules, tally: Tally, sensed: Any, torque: jax.Array) -> Tally:
        going = (tally.reason == Reason.FINISHED) & (tally.steps < self.steps)
        reason = self.judge.examine(sensed)
        updated = self.judge.update(tally, sensed, torque, rules.clearance)
        kept = dataclasses.replace(tally, reason=jnp.where(going, reason, tally.reason))
        return _choose(going & (reason == Reason.FINISHED), updated, kept)

    def _lift(self, joints: ArrayLike) -> jax.Array:
        """Joint values [J] at their places among the degrees of freedom [nv], zero elsewhere."""
        adr, nv = self.creature.dof_adr, self.creature.model.nv
        if np.array_equal(adr, np.arange(adr[0], adr[0] + len(adr))):
            return jnp.pad(jnp.asarray(joints), (adr[0], nv - adr[-1] - 1))
        return jnp.zeros(nv, jnp.float32).at[adr].set(joints)

    def _per_lane(self, function: Callable[..., Any]) -> Callable[..., Any]:
        return jax.vmap(function, in_axes=self.plant.lane_axis, out_axes=self.plant.lane_axis)


def _choose(condition: jax.Array, yes: Any, no: Any) -> Any:
    return jax.tree.map(partial(jnp.where, condition), yes, no)


def _push(lane: Lane) -> BodyState:
    now = lane.tally.steps == lane.push_step
    return dataclasses.replace(lane.body, qvel=lane.body.qvel + jnp.where(now, lane.push, 0.0))
