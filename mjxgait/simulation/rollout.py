"""Simulation of many episodes on a fixed number of lanes per device.

Each lane takes the next waiting episode when its own has ended. Cost follows the number of
simulated steps, memory the number of lanes, whatever the population and the length of the episode.
The episodes may belong to several evolution runs, the rows `B` of every array here. Each row has
its own starts and settings; the rows share the lanes.
"""

import dataclasses
from collections.abc import Callable
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.sharding import Mesh, PartitionSpec

from mjxgait.config.schema import Config
from mjxgait.controllers.base import Controller
from mjxgait.controllers.observations import sense
from mjxgait.controllers.spd import Drive, Function, per_lane
from mjxgait.creature.body import Body
from mjxgait.simulation.episode import (
    Lane,
    Late,
    arriving,
    deepened,
    first_body,
    is_going,
    pushed,
    reason_of,
)
from mjxgait.tasks.base import EpisodeStats, Task
from mjxgait.tasks.falls import Reason
from mjxgait.tasks.starts import Starts
from mjxgait.types import BodyState, Plant, Sensed, choose, pytree

CHECK_EVERY = 16
"""Steps between checks for free lanes, which cost about a step each, and for overlap of parts."""
AXIS = "lanes"


@pytree
class Episodes:
    """All episodes of a generation.

    stats: leaves [B, N, R, ...]. computed_steps: [], those of idle lanes included.
    """

    stats: Any
    computed_steps: jax.Array


@dataclasses.dataclass(frozen=True, eq=False)
class Simulator:
    """Static part of the episodes of one creature.

    steps: T per episode. lanes: L per device. mesh: the devices. grow: maps a genome and a start
    to that start with the genome's own body; None where all have the plant's.
    """

    creature: Body
    plant: Plant
    controller: Controller
    drive: Drive
    task: Task
    steps: int
    lanes: int
    mesh: Mesh
    grow: Callable[[object, Starts], Starts] | None = None

    def simulate(
        self, genomes: object, starts: Starts, settings: Config, wanted: jax.Array | None = None
    ) -> Episodes:
        """Simulate every genome (leaves [B, N, ...]) on every start [B, R] of its row.

        settings: traced, leaves [B, ...]. Results are in the order of the genomes. wanted: [B, N,
        R] episodes to simulate; None is all. The statistics of the others are all zero.
        """
        shape = (*jax.tree.leaves(genomes)[0].shape[:2], starts.friction.shape[1])
        total, devices = int(np.prod(shape)), self.mesh.size
        queue = -(-total // devices)
        dealt = jnp.arange(queue * devices, dtype=jnp.int32).reshape(queue, devices).T.reshape(-1)
        run = jax.shard_map(
            partial(self._run_queue, total=total),
            mesh=self.mesh,
            in_specs=(PartitionSpec(AXIS), *[PartitionSpec()] * 4),
            out_specs=PartitionSpec(AXIS),
            check_vma=False,
        )
        plans = jax.vmap(jax.vmap(self.controller.prepare, (0, None)))(genomes, settings.controller)
        turns = self._turns(plans, shape, wanted)
        padding = jnp.arange(total, len(dealt), dtype=jnp.int32)
        queued = dealt if turns is None else jnp.concatenate([turns, padding])[dealt]
        if wanted is not None:
            queued = jnp.where(dealt < jnp.sum(wanted), queued, total)
        stats, computed = run(queued, plans, starts, settings, self._own_starts(genomes, starts))

        def in_order(leaf: jax.Array) -> jax.Array:
            by_device = leaf.reshape(devices, queue, *leaf.shape[1:])
            by_turn = jnp.swapaxes(by_device, 0, 1).reshape(-1, *leaf.shape[1:])[:total]
            found = by_turn if turns is None else jnp.zeros_like(by_turn).at[turns].set(by_turn)
            return found.reshape(*shape, *leaf.shape[1:])

        return Episodes(jax.tree.map(in_order, stats), jnp.sum(computed))

    def _turns(
        self, plans: object, shape: tuple[int, ...], wanted: jax.Array | None = None
    ) -> jax.Array | None:
        """Return the order [B * N * R] in which episodes are simulated; None where all are alike.

        Plans [B, N, ...] with the slowest commands come first, unwanted episodes last.
        """
        loads = jax.vmap(jax.vmap(self.controller.load))(plans)
        if loads is None and wanted is None:
            return None
        each = jnp.zeros(shape) if loads is None else jnp.broadcast_to(-loads[..., None], shape)
        last = each if wanted is None else jnp.where(wanted, each, jnp.inf)
        return jnp.argsort(last.reshape(-1)).astype(jnp.int32)

    def _own_starts(self, genomes: object, starts: Starts) -> Starts | None:
        """Return each genome's own starts [B, N, R, ...]; None where all bodies are the plant's."""
        if self.grow is None:
            return None
        each = jax.vmap(jax.vmap(self.grow, (None, 0)), (0, None))
        return jax.vmap(each)(genomes, starts)

    def _run_queue(
        self,
        episodes: jax.Array,
        plans: object,
        starts: Starts,
        settings: Config,
        own: Starts | None,
        *,
        total: int,
    ) -> tuple[EpisodeStats, jax.Array]:
        """Run one device's queue of episodes [Q].

        Return the statistics, leaves [Q, ...], and the computed steps [1].

        episodes: numbers over (row, individual, start), the start fastest; those of at least
        `total` are padding and come last.
        """
        queue = episodes.shape[0]
        lanes = min(self.lanes, queue)
        waiting = jnp.sum(episodes < total)

        def fresh(places: jax.Array) -> Lane:
            place = jnp.where(places < waiting, places, queue)
            lane = jax.vmap(partial(self._fresh_lane, plans, starts, settings, own))(
                place, episodes[jnp.minimum(places, queue - 1)]
            )
            return jax.tree.map(lambda leaf: jnp.moveaxis(leaf, 0, self.plant.lane_axis), lane)

        def body(
            carry: tuple[Lane, EpisodeStats, jax.Array, jax.Array],
        ) -> tuple[Lane, EpisodeStats, jax.Array, jax.Array]:
            lane, results, taken, rounds = carry
            lane = jax.lax.fori_loop(0, CHECK_EVERY, self._step, lane)
            lane = self._look_for_overlap(lane)
            done = (lane.stats.steps >= self.steps) | (lane.stats.reason != Reason.FINISHED)
            results = self._stored(results, jnp.where(done, lane.place, queue), lane.stats)
            lane = self._per_lane(choose)(done, fresh(taken + jnp.cumsum(done) - 1), lane)
            return lane, results, taken + jnp.sum(done), rounds + 1

        results = jax.tree.map(
            lambda leaf: jnp.zeros((queue, *leaf.shape), leaf.dtype), self.task.init()
        )
        carry = (fresh(jnp.arange(lanes)), results, jnp.int32(lanes), jnp.int32(0))
        # Not a while_loop: XLA's CPU compiler aborts on the lane_major kernels in a loop of unknown
        # length. Rounds left over cost next to nothing.
        carry = jax.lax.fori_loop(
            0,
            self._most_rounds(queue, lanes),
            lambda _, carry: jax.lax.cond(
                jnp.any(carry[0].place < queue), body, lambda same: same, carry
            ),
            carry,
        )
        return carry[1], (carry[3] * (CHECK_EVERY * lanes))[None]

    def _stored(self, results: EpisodeStats, place: jax.Array, stats: EpisodeStats) -> EpisodeStats:
        """Write the lanes' statistics at their places in the queue; places outside are dropped."""
        return jax.tree.map(
            lambda rows, leaf: rows.at[place].set(
                jnp.moveaxis(leaf, self.plant.lane_axis, 0), mode="drop"
            ),
            results,
            stats,
        )

    def _most_rounds(self, queue: int, lanes: int) -> int:
        """Rounds that suffice for a queue: a free lane always takes an episode (Graham 1966)."""
        longest = -(-self.steps // CHECK_EVERY) + 1
        return -(-queue * longest // lanes) + longest

    def _fresh_lane(
        self,
        plans: object,
        starts: Starts,
        settings: Config,
        own: Starts | None,
        place: jax.Array,
        episode: jax.Array,
    ) -> Lane:
        """Return the lane at the start of an episode.

        place: [] in the queue. episode: [] its number, see `_run_queue`. plans: leaves [B, N,
        ...], the controller's. own: each genome's own starts, if any.
        """
        count, individuals = starts.friction.shape[1], jax.tree.leaves(plans)[0].shape[1]
        row, individual = episode // (individuals * count), episode // count % individuals
        here = (row, episode % count) if own is None else (row, individual, episode % count)
        start = jax.tree.map(lambda leaf: leaf[here], starts if own is None else own)
        mine = jax.tree.map(lambda leaf: leaf[row], settings)
        joints = len(self.creature.joints.names)
        return Lane(
            place=place,
            body=first_body(start),
            plan=jax.tree.map(lambda leaf: leaf[row, individual], plans),
            memory=self.controller.init(),
            stats=self.task.init(),
            goal=self.task.goal(start),
            params=self.task.params(mine.fitness),
            rules=self.drive.rules(mine.drive, start.stiffness, start.damping),
            push=start.push,
            push_step=start.push_step,
            command=jnp.zeros(joints) if self._holds else None,
            late=None
            if start.delay is None
            else Late(start.delay, jnp.zeros((mine.rollout.latency, joints))),
        )

    @property
    def _holds(self) -> bool:
        """Return whether a command is held for several steps."""
        return self.controller.every > 1

    def _step(self, k: jax.Array, lane: Lane) -> Lane:
        """Advance all lanes by one control step; statistics of ended episodes stay the same.

        k: [] steps since lanes took their latest episodes, the same for all lanes.
        """
        body = self._per_lane(_push)(lane)
        sensed, step_data = self.plant.forward(body)
        command, memory = self._command(k, lane, sensed)
        torque = self.drive.torque(self.plant, lane.rules, body, sensed, step_data, command)
        late = lane.late
        if late is not None:
            torque, late = self._per_lane(arriving)(late, lane.stats.steps, torque)
        stats = self._per_lane(self._updated_stats)(lane, sensed, torque)
        body = self.plant.advance(body, step_data, self._per_lane(self.drive.lift)(torque))
        goal = self._per_lane(self.task.next_goal)(lane.goal, sensed)
        kept = command if self._holds else None
        return dataclasses.replace(
            lane, body=body, memory=memory, stats=stats, goal=goal, command=kept, late=late
        )

    def _command(self, k: jax.Array, lane: Lane, sensed: Sensed) -> tuple[jax.Array, object]:
        """Return the commands of a step, and the controllers' memories."""

        def acted() -> tuple[jax.Array, object]:
            return self._per_lane(self._act)(lane, sensed)

        if not self._holds:
            return acted()
        due = k % self.controller.every == 0
        return jax.lax.cond(due, acted, lambda: (lane.command, lane.memory))

    def _act(self, lane: Lane, sensed: Sensed) -> tuple[jax.Array, object]:
        """Return the controller's command [J] and its memory."""
        time, names = lane.stats.steps * self.drive.step, self.controller.reads
        senses = sense(self.creature, sensed, time, names)
        senses |= self.task.observations(lane.goal, sensed)
        return self.controller.act(lane.plan, lane.memory, senses)

    def _look_for_overlap(self, lane: Lane) -> Lane:
        """Record the deepest overlap of parts where an episode is still running."""
        depth = self.plant.overlap(lane.body)
        return dataclasses.replace(lane, stats=deepened(lane.stats, depth, self.steps))

    def _updated_stats(self, lane: Lane, sensed: Sensed, torque: jax.Array) -> EpisodeStats:
        """Update the statistics after a step, unless the episode has ended."""
        stats, going = lane.stats, is_going(lane.stats, self.steps)
        reason = reason_of(self.task, sensed, lane.goal)
        updated = self.task.update(stats, sensed, torque, lane.params, lane.goal)
        kept = dataclasses.replace(stats, reason=jnp.where(going, reason, stats.reason))
        return choose(going & (reason == Reason.FINISHED), updated, kept)

    def _per_lane(self, function: Function) -> Function:
        return per_lane(self.plant, function)


def _push(lane: Lane) -> BodyState:
    return pushed(lane.body, lane.push, lane.stats.steps == lane.push_step)
