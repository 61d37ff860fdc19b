"""Controller with the weights of a neural network as genome (docs/reference/network.md).

On a symmetric body the network is applied to the observations and to their mirror image half a
period later, and the command is the mean of both: so the left side does what the right side does.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from mjxgait.controllers.base import Bounds, Genes, RealController, Senses
from mjxgait.controllers.network.config import (
    MIRRORED,
    READS,
    SIGNS,
    NetworkConfig,
    layers,
    parts,
)
from mjxgait.creature.body import Body

Plan = Mapping[str, jax.Array]
"""The genome, and `period` [] in s."""


class Network(RealController):
    """Implementation of `Controller`. Genome: `weight_i` [inputs, outputs], `bias_i` [outputs]."""

    Settings = NetworkConfig
    reads = READS

    def __init__(self, creature: Body, step: float, settings: NetworkConfig | None = None) -> None:
        super().__init__(creature, step)
        shape = settings or NetworkConfig()
        self.every = shape.every  # type: ignore[misc]  # the class has a default for users' own
        self.layers = layers(len(creature.joints.names), shape.hidden)

    @classmethod
    def with_settings(
        cls, creature: Body, step: float, settings: NetworkConfig, added: Sequence[str]
    ) -> "Network":
        """Return the controller of a network of this size."""
        return cls(creature, step, settings)

    def bounds(self, settings: NetworkConfig) -> Bounds:
        """See `RealController`."""
        edge: dict[str, jax.Array] = {}
        for i, (inputs, outputs) in enumerate(self.layers):
            most = jnp.asarray(settings.weight) / np.sqrt(inputs)
            edge[f"weight_{i}"] = jnp.full((inputs, outputs), most)
            edge[f"bias_{i}"] = jnp.full(outputs, most)
        return {name: (-most, most) for name, most in edge.items()}

    def prepare(self, genome: Genes, settings: NetworkConfig) -> Plan:
        """See `Controller`."""
        return {**genome, "period": jnp.asarray(settings.period, jnp.float32)}

    def act(self, plan: Plan, memory: Any, senses: Senses) -> tuple[jax.Array, Any]:
        """See `Controller`."""
        return self.angles(self.outputs(plan, self.inputs(senses, plan["period"]))), memory

    def inputs(self, senses: Senses, period: jax.Array | float) -> jax.Array:
        """Return the inputs [I]: joint angles from the standing pose, the rest as it is."""
        turn = 2 * jnp.pi * senses["time"] / period
        seen = dict(senses) | {"joint_pos": senses["joint_pos"] - self.creature.joints.stand}
        read = [jnp.atleast_1d(seen[name]) for name in READS if name != "time"]
        return jnp.concatenate([*read, jnp.stack([jnp.sin(turn), jnp.cos(turn)])])

    def outputs(self, plan: Plan, x: jax.Array) -> jax.Array:
        """Return the outputs [J] of inputs [I]."""
        here = self._forward(plan, x)
        if not self.creature.mirror.symmetric:
            return here
        return 0.5 * (here + self._other_side(self._forward(plan, self._image(x))))

    def angles(self, outputs: jax.Array) -> jax.Array:
        """Return joint angles [J] in rad: the standing pose at 0, within the pose ranges."""
        joints = self.creature.joints
        low, high = jnp.asarray(joints.pose_low), jnp.asarray(joints.pose_high)
        return jnp.clip(joints.stand + 0.5 * (high - low) * jnp.tanh(outputs), low, high)

    def _image(self, x: jax.Array) -> jax.Array:
        """Return the inputs [I] of the mirrored body, half a period later."""
        joints = len(self.creature.joints.names)
        pos, vel, rest = x[:joints], x[joints : 2 * joints], x[2 * joints :]
        signs = jnp.asarray(SIGNS)
        return jnp.concatenate([self._other_side(pos), self._other_side(vel), signs * rest])

    def _other_side(self, joints: jax.Array) -> jax.Array:
        """Return values [J] of the joints in the mirror image."""
        mirror = self.creature.mirror
        return jnp.asarray(mirror.sign) * joints[mirror.partner]

    def _forward(self, plan: Plan, x: jax.Array) -> jax.Array:
        for i in range(len(self.layers)):
            x = x @ plan[f"weight_{i}"] + plan[f"bias_{i}"]
            x = x if i == len(self.layers) - 1 else jnp.tanh(x)
        return x


def split(observation: jax.Array, joints: int) -> Senses:
    """Return the observations by name of an environment that observes `READS`."""
    sizes = parts(joints)
    pieces = jnp.split(observation, np.cumsum(list(sizes.values()))[:-1])
    alone = (*MIRRORED, "time")
    return {
        name: piece[0] if name in alone else piece
        for name, piece in zip(sizes, pieces, strict=True)
    }
