"""Tree of a body as data.

Letters: `n` links, the root first and parents before children; `L` lanes. Every array has the
lanes as one more, innermost axis.
"""

import dataclasses

import jax

from mjxgait.physics.lane_major.treematrix import Sparsity, sparsity
from mjxgait.types import pytree

FAR = 1e3
"""m above the ground, for blocks that are missing, and for all where there is no ground."""


@pytree
class Tree:
    """Numbers of a modular body.

    A link turns about the z axis of its own frame. A part with several hinges is several links in
    a row, and the last of them carries its block. A part that is rigid on its parent is a link that
    does not move. Links that a lane does not have come last, move nothing and weigh nothing.

    parent: [n, n] 1 where the column is the row's parent; above: [n, n] 1 where it is the row
    itself or above it. place: [n, 3] m of the hinge, and turn: [n, 3, 3] the axes (rows) of a link
    at angle 0, in the parent's frame. moves: [n] 1 for a hinge.
    mass: [n] kg; com: [n, 3] m; axes: [n, 3, 3] the block's own axes (rows) in the link's frame;
    inertia: [n, 3] kg·m² about them; half: [n, 3] m, half of the block's sides; solid: [n] 1 for a
    link with a block.
    armature: [n] kg·m²; damping: [n] N·m·s/rad; low, high: [n] rad, where limits' springs begin.
    body_weight: [n] 1/kg, dof_weight: [n] 1/(kg·m²), as MuJoCo's `invweight0`.
    """

    parent: jax.Array
    above: jax.Array
    place: jax.Array
    turn: jax.Array
    moves: jax.Array
    mass: jax.Array
    com: jax.Array
    axes: jax.Array
    inertia: jax.Array
    half: jax.Array
    solid: jax.Array
    armature: jax.Array
    damping: jax.Array
    low: jax.Array
    high: jax.Array
    body_weight: jax.Array
    dof_weight: jax.Array

    @property
    def links(self) -> int:
        """Number of links, n."""
        return self.mass.shape[0]


@dataclasses.dataclass(frozen=True)
class Surroundings:
    """Settings that all lanes share, constants of the program.

    step: s. friction: of the ground. contact: s, time constant of a contact (`solref`). floor:
    whether there is one, z = 0. gravity: m/s². drag: N·s/m³, the resistance of a face to its normal
    velocity, per area; 0 without water. lit: whether there is a light to sense.
    iterations, line_iterations: of the contact solver.
    """

    step: float = 0.005
    friction: float = 0.9
    contact: float = 0.02
    floor: bool = True
    gravity: float = 9.81
    drag: float = 0.0
    iterations: int = 3
    line_iterations: int = 6
    lit: bool = False


@dataclasses.dataclass(frozen=True)
class Hinge:
    """Degree of freedom of a limit, for the solver."""

    dof: int


@dataclasses.dataclass(frozen=True)
class Dense:
    """Shape of the solver's problem; every degree of freedom may move every other."""

    links: int
    iterations: int
    line_iterations: int

    @property
    def pattern(self) -> Sparsity:
        """Single chain of all degrees of freedom."""
        return sparsity(range(-1, self.links + 4))

    @property
    def limits(self) -> tuple[Hinge, ...]:
        """Limits of all hinges."""
        return tuple(Hinge(6 + j) for j in range(self.links - 1))
