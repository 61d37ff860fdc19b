"""Observations that a controller may read, by name.

Letters: `J` actuated joints, `F` feet.
"""

from collections.abc import Callable, Collection, Mapping

import jax
import jax.numpy as jnp
import numpy as np

from mjxgait.creature.body import Body
from mjxgait.errors import UserError, did_you_mean
from mjxgait.physics.batched_trees.tree import ModularSensed
from mjxgait.types import Sensed

CONTACT_GAP = 0.002
"""m; a foot nearer to the floor is in contact. A resting foot sinks in about a millimetre."""

Sense = Callable[[Body, Sensed, jax.Array], jax.Array]
"""Function from creature, body state and time [] in s to an array."""


def _heading(creature: Body, sensed: Sensed, time: jax.Array) -> jax.Array:
    nose = sensed.trunk_rot @ creature.frame.forward.astype(np.float32)
    forward, left = creature.frame.start_axes
    return jnp.arctan2(nose @ left, nose @ forward)


def _along(creature: Body, sensed: Sensed, axis: int) -> jax.Array:
    return (
        sensed.trunk_pos - creature.frame.stand_pos.astype(np.float32)
    ) @ creature.frame.start_axes[axis]


def _nose(creature: Body, sensed: Sensed) -> tuple[jax.Array, jax.Array]:
    """Return horizontal unit vectors [3] along the nose and to its left.

    They are zero if the nose points straight up or down.
    """
    x, y, _ = sensed.trunk_rot @ creature.frame.forward.astype(np.float32)
    size = jnp.sqrt(x * x + y * y + 1e-12)
    none = jnp.zeros_like(x)
    return jnp.stack([x, y, none]) / size, jnp.stack([-y, x, none]) / size


def foot_places(creature: Body, sensed: Sensed) -> jax.Array:
    """Return foot positions [F, 2] in m: ahead of the trunk along its nose, and to the left."""
    axes = jnp.stack(_nose(creature, sensed), axis=1)
    middles = jnp.stack(
        [jnp.mean(sensed.geom_pos[geoms], axis=0) for geoms in foot_geoms(creature)]
    )
    return (middles - sensed.trunk_pos) @ axes


def _attitude(sensed: Sensed, axis: np.ndarray) -> jax.Array:
    """Return the sine of the angle of a trunk axis above the horizon."""
    return jnp.clip((sensed.trunk_rot @ axis.astype(np.float32))[2], -1.0, 1.0)


def _rate(sensed: Sensed, axis: np.ndarray) -> jax.Array:
    """Return the trunk's angular velocity about one of its own axes."""
    return sensed.trunk_angvel @ (sensed.trunk_rot @ axis.astype(np.float32))


SENSES: Mapping[str, Sense] = {
    "time": lambda creature, sensed, time: time,
    "beat": lambda creature, sensed, time: 2 * (time - jnp.floor(time)) - 1,
    "joint_pos": lambda creature, sensed, time: sensed.joint_pos,
    "joint_vel": lambda creature, sensed, time: sensed.joint_vel,
    "foot_height": lambda creature, sensed, time: foot_heights(creature, sensed),
    "contact": lambda creature, sensed, time: contacts(creature, sensed),
    "trunk_pos": lambda creature, sensed, time: sensed.trunk_pos,
    "trunk_height": lambda creature, sensed, time: trunk_height(sensed),
    "trunk_rot": lambda creature, sensed, time: sensed.trunk_rot,
    "trunk_vel": lambda creature, sensed, time: sensed.trunk_vel,
    "trunk_angvel": lambda creature, sensed, time: sensed.trunk_angvel,
    "heading": _heading,
    "forward": lambda creature, sensed, time: _along(creature, sensed, 0),
    "aside": lambda creature, sensed, time: _along(creature, sensed, 1),
    "forward_vel": lambda creature, sensed, time: sensed.trunk_vel @ creature.frame.start_axes[0],
    "nose_vel": lambda creature, sensed, time: jnp.stack(
        [sensed.trunk_vel @ axis for axis in _nose(creature, sensed)]
    ),
    "foot_place": lambda creature, sensed, time: foot_places(creature, sensed),
    "up_vel": lambda creature, sensed, time: sensed.trunk_vel[2],
    "pitch": lambda creature, sensed, time: -jnp.arcsin(_attitude(sensed, creature.frame.forward)),
    "roll": lambda creature, sensed, time: jnp.arcsin(_attitude(sensed, creature.frame.left)),
    "pitch_rate": lambda creature, sensed, time: _rate(sensed, creature.frame.left),
    "roll_rate": lambda creature, sensed, time: _rate(sensed, creature.frame.forward),
}
"""Observations by name; shapes and units are in docs/reference/controller.md."""


def sense(
    creature: Body, sensed: Sensed, time: jax.Array, names: Collection[str]
) -> dict[str, jax.Array]:
    """Return the observations with these names."""
    return {name: SENSES[name](creature, sensed, time) for name in names if name in SENSES}


def check_observations(reads: Collection[str], added: Collection[str] = ()) -> None:
    """Refuse names of unknown observations. added: names that a task adds.

    Raises:
      UserError: the unknown name, with the closest known one.
    """
    known = [*SENSES, *added]
    for name in reads:
        if name not in known:
            raise UserError(f'there is no observation "{name}"; {did_you_mean(name, known)}')


def forward_way(creature: Body, sensed: Sensed) -> jax.Array:
    """Return the trunk's distance [] in m from the start, along the start's forward axis."""
    return _along(creature, sensed, 0)


def sideways(creature: Body, sensed: Sensed) -> jax.Array:
    """Return the trunk's distance [] in m from the start, to the left of its forward axis."""
    return _along(creature, sensed, 1)


def trunk_height(sensed: Sensed) -> jax.Array:
    """Return the trunk's height [] in m above the ground under it."""
    height = sensed.trunk_pos[2]
    return height if sensed.floor is None else height - sensed.floor


def foot_heights(creature: Body, sensed: Sensed) -> jax.Array:
    """Return the height [F] in m of each foot's lowest point above the ground under it."""
    return jnp.stack([jnp.min(sensed.geom_low[geoms]) for geoms in foot_geoms(creature)])


def contacts(creature: Body, sensed: Sensed) -> jax.Array:
    """Return 1 for each foot [F] in contact with the floor, or the block with another, else 0."""
    gap, own = foot_heights(creature, sensed), sensed.body
    if isinstance(own, ModularSensed) and own.nearest is not None:
        gap = jnp.minimum(gap, own.nearest)
    return (gap < CONTACT_GAP).astype(jnp.float32)


def foot_geoms(creature: Body) -> list[slice]:
    """Return each foot's slice of the watched geoms."""
    groups = [
        np.flatnonzero(creature.feet.foot_of == foot) for foot in range(len(creature.feet.names))
    ]
    return [slice(int(group[0]), int(group[-1]) + 1) for group in groups]
