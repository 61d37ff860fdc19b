"""Proximal policy optimization (Schulman et al. 2017) in JAX, after brax's.

Clipped loss, generalized advantage estimation, running normalization of observations, a Gaussian
of learned width around the policy, and a value network. One compiled program is an iteration: every
environment takes `unroll` actions, then `epochs` passes over them update both networks.

Letters: `B` environments, `T` actions of an unroll, `I` inputs, `J` joints.
"""

import dataclasses
import itertools
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import optax

from mjxgait.types import pytree

AXIS = "devices"
"""Axis of the mesh over which the environments are spread."""
Net = dict[str, jax.Array]
"""Weights by name: `weight_i`, `bias_i`."""


@dataclasses.dataclass(frozen=True)
class Settings:
    """Hyper-parameters, by default like those of MuJoCo Playground's quadrupeds."""

    envs: int = 4096
    unroll: int = 20
    epochs: int = 4
    minibatches: int = 16
    discount: float = 0.97
    gae: float = 0.95
    clip: float = 0.2
    entropy: float = 5e-3
    learning_rate: float = 3e-4
    value_weight: float = 0.5
    most_gradient: float = 1.0
    deviation: float = 0.5
    value_hidden: tuple[int, ...] = (128, 128)


@pytree
class Learner:
    """What is learned. deviation: [J] logarithm. mean, square: [I] of the inputs so far."""

    policy: Net
    value: Net
    deviation: jax.Array
    optimizer: Any
    mean: jax.Array
    square: jax.Array
    count: jax.Array

    @property
    def spread(self) -> jax.Array:
        """Standard deviation [I] of the inputs."""
        return jnp.sqrt(jnp.maximum(self.square - self.mean**2, 1e-4))

    @property
    def actor(self) -> Net:
        """The policy for inputs as they are: its first layer also normalizes them."""
        weight = self.policy["weight_0"] / self.spread[:, None]
        bias = self.policy["bias_0"] - self.mean @ weight
        return {**self.policy, "weight_0": weight, "bias_0": bias}

    def worth(self, x: jax.Array) -> jax.Array:
        """Return the value [...] of inputs [..., I]."""
        return forward(self.value, (x - self.mean) / self.spread)[..., 0]


class Taken(NamedTuple):
    """Actions with what came of them, [T, B, ...]. fell, over: 1 after a fall; after any end."""

    seen: jax.Array
    then: jax.Array
    action: jax.Array
    chance: jax.Array
    reward: jax.Array
    fell: jax.Array
    over: jax.Array


class Batch(NamedTuple):
    """Samples for the update, [T * B, ...]."""

    seen: jax.Array
    action: jax.Array
    chance: jax.Array
    advantage: jax.Array
    goal: jax.Array


@dataclasses.dataclass(frozen=True, eq=False)
class World:
    """What PPO trains on. Functions are for all environments.

    step: from states and actions [B, J] to states. observe: inputs [B, I]. outcome: reward, fell,
    over [B]. restart: fresh states where [B]. policy: the middle of the actions [B, J] under a
    network and inputs [B, I].
    """

    step: Callable[[Any, jax.Array], Any]
    observe: Callable[[Any], jax.Array]
    outcome: Callable[[Any], tuple[jax.Array, jax.Array, jax.Array]]
    restart: Callable[[jax.Array, Any, Any], Any]
    policy: Callable[[Net, jax.Array], jax.Array]


@dataclasses.dataclass(frozen=True, eq=False)
class Agent:
    """PPO on a world."""

    world: World
    settings: Settings

    @property
    def _optimizer(self) -> optax.GradientTransformation:
        settings = self.settings
        return optax.chain(
            optax.clip_by_global_norm(settings.most_gradient), optax.adam(settings.learning_rate)
        )

    def init(self, key: jax.Array, inputs: int, hidden: tuple[int, ...], joints: int) -> Learner:
        """Return a learner with a policy that hardly moves."""
        one, other = jax.random.split(key)
        policy = network(one, (inputs, *hidden, joints), last=0.01)
        value = network(other, (inputs, *self.settings.value_hidden, 1), last=1.0)
        deviation = jnp.full(joints, np.log(self.settings.deviation), jnp.float32)
        optimizer = self._optimizer.init((policy, value, deviation))
        nothing = jnp.zeros(inputs)
        return Learner(policy, value, deviation, optimizer, nothing, nothing + 1, jnp.zeros(()))

    def iterate(
        self, learner: Learner, states: Any, fresh: Any, key: jax.Array
    ) -> tuple[Learner, Any, dict[str, jax.Array]]:
        """Act, then learn. fresh: states [B] in which environments that end begin anew."""
        key = jax.random.fold_in(key, jax.lax.axis_index(AXIS))
        act_key, learn_key = jax.random.split(key)

        def step(states: Any, key: jax.Array) -> tuple[Any, tuple[Taken, Any]]:
            return self._act(learner, states, fresh, key)

        keys = jax.random.split(act_key, self.settings.unroll)
        states, (taken, ends) = jax.lax.scan(step, states, keys)
        learner, losses = self._learn(learner, self._batch(learner, taken), learn_key)
        learner = _observed(learner, taken.seen)
        spread = jnp.exp(learner.deviation).mean()
        found = {**losses, "deviation": spread}
        return learner, states, ends_mean(ends) | jax.lax.pmean(found, AXIS)

    def _act(
        self, learner: Learner, states: Any, fresh: Any, key: jax.Array
    ) -> tuple[Any, tuple[Taken, Any]]:
        world = self.world
        seen = world.observe(states)
        middle, spread = world.policy(learner.actor, seen), jnp.exp(learner.deviation)
        action = middle + spread * jax.random.normal(key, middle.shape)
        after = world.step(states, action)
        reward, fell, over = world.outcome(after)
        chance = log_chance(action, middle, learner.deviation)
        taken = Taken(seen, world.observe(after), action, chance, reward, fell, over)
        metrics = {name: value * over for name, value in after.metrics.items()}
        return world.restart(over > 0, fresh, after), (taken, {**metrics, "ended": over})

    def _batch(self, learner: Learner, taken: Taken) -> Batch:
        """Estimate the advantages; the time's end is no fall, so what would follow counts."""
        settings = self.settings
        here, there = learner.worth(taken.seen), learner.worth(taken.then)
        error = taken.reward + settings.discount * (1 - taken.fell) * there - here
        keep = settings.discount * settings.gae * (1 - taken.over)

        def back(later: jax.Array, one: tuple[jax.Array, jax.Array]) -> tuple[jax.Array, jax.Array]:
            now = one[0] + one[1] * later
            return now, now

        _, advantage = jax.lax.scan(back, jnp.zeros_like(error[0]), (error, keep), reverse=True)
        batch = Batch(taken.seen, taken.action, taken.chance, advantage, advantage + here)
        return jax.tree.map(lambda leaf: leaf.reshape(-1, *leaf.shape[2:]), batch)

    def _learn(
        self, learner: Learner, batch: Batch, key: jax.Array
    ) -> tuple[Learner, dict[str, jax.Array]]:
        settings, size = self.settings, len(batch.goal)

        def epoch(learner: Learner, key: jax.Array) -> tuple[Learner, dict[str, jax.Array]]:
            order = jax.random.permutation(key, size).reshape(settings.minibatches, -1)
            return jax.lax.scan(
                lambda learner, rows: self._update(learner, jax.tree.map(lambda x: x[rows], batch)),
                learner,
                order,
            )

        learner, losses = jax.lax.scan(epoch, learner, jax.random.split(key, settings.epochs))
        return learner, jax.tree.map(jnp.mean, losses)

    def _update(self, learner: Learner, batch: Batch) -> tuple[Learner, dict[str, jax.Array]]:
        def loss(nets: tuple[Net, Net, jax.Array]) -> tuple[jax.Array, dict[str, jax.Array]]:
            policy, value, deviation = nets
            trial = dataclasses.replace(learner, policy=policy, value=value, deviation=deviation)
            return self._loss(trial, batch)

        nets = (learner.policy, learner.value, learner.deviation)
        slope, losses = jax.grad(loss, has_aux=True)(nets)
        slope = jax.lax.pmean(slope, AXIS)
        change, optimizer = self._optimizer.update(slope, learner.optimizer)
        policy, value, deviation = optax.apply_updates(nets, change)
        after = dataclasses.replace(
            learner, policy=policy, value=value, deviation=deviation, optimizer=optimizer
        )
        return after, losses

    def _loss(self, learner: Learner, batch: Batch) -> tuple[jax.Array, dict[str, jax.Array]]:
        settings = self.settings
        middle = self.world.policy(learner.actor, batch.seen)
        advantage = (batch.advantage - batch.advantage.mean()) / (batch.advantage.std() + 1e-8)
        change = log_chance(batch.action, middle, learner.deviation) - batch.chance
        ratio = jnp.exp(change)
        clipped = jnp.clip(ratio, 1 - settings.clip, 1 + settings.clip)
        gain = jnp.minimum(ratio * advantage, clipped * advantage).mean()
        missed = jnp.square(learner.worth(batch.seen) - batch.goal).mean()
        total = settings.value_weight * missed - gain - settings.entropy * learner.deviation.sum()
        away = (ratio - 1 - change).mean()
        return total, {"value_loss": missed, "divergence": away}


def network(key: jax.Array, widths: tuple[int, ...], last: float) -> Net:
    """Draw the weights of a network. last: factor on those of the last layer."""
    draw = jax.nn.initializers.orthogonal(np.sqrt(2))
    net: Net = {}
    for i, (inputs, outputs) in enumerate(itertools.pairwise(widths)):
        scale = last if i == len(widths) - 2 else 1.0
        weight = draw(jax.random.fold_in(key, i), (inputs, outputs))
        net |= {f"weight_{i}": scale * weight, f"bias_{i}": jnp.zeros(outputs)}
    return net


def forward(net: Net, x: jax.Array) -> jax.Array:
    """Return the outputs of a network."""
    depth = len(net) // 2
    for i in range(depth):
        x = x @ net[f"weight_{i}"] + net[f"bias_{i}"]
        x = x if i == depth - 1 else jnp.tanh(x)
    return x


def log_chance(action: jax.Array, middle: jax.Array, deviation: jax.Array) -> jax.Array:
    """Return the logarithm of a Gaussian's density, less a constant."""
    return jnp.sum(-0.5 * jnp.square((action - middle) / jnp.exp(deviation)) - deviation, -1)


def ends_mean(ends: dict[str, jax.Array]) -> dict[str, jax.Array]:
    """Return the mean of each metric over the episodes that ended, and their number."""
    total = jax.lax.psum({name: value.sum() for name, value in ends.items()}, AXIS)
    count = total["ended"]
    return {name: value / jnp.maximum(count, 1) for name, value in total.items()} | {"ended": count}


def _observed(learner: Learner, seen: jax.Array) -> Learner:
    """Return the learner with these observations [T, B, I] in its running mean."""
    rows = seen.reshape(-1, seen.shape[-1])
    now, squared = jax.lax.pmean((rows.mean(0), jnp.square(rows).mean(0)), AXIS)
    count = learner.count + len(rows)
    share = len(rows) / count
    mean = learner.mean + share * (now - learner.mean)
    square = learner.square + share * (squared - learner.square)
    return dataclasses.replace(learner, mean=mean, square=square, count=count)
