"""A body whose tree is data.

Letters: `n` links, the root first and parents before children; `L` lanes, an axis that every array
has besides the documented ones, innermost.
"""

import dataclasses

import jax

from mjxgait.physics.lane_major.treematrix import Sparsity, sparsity
from mjxgait.types import pytree

FAR = 1e3
"""m, how high above the ground a block is that there is not, or where there is no ground."""


@pytree
class Tree:
    """The numbers of a body of blocks.

    A link turns about the z axis of its own frame. A part with several hinges is several links in
    a row, of which the last carries its block; a part that is rigid on its parent is a link that
    does not move. Links that a lane does not have come last, move nothing and weigh nothing.

    parent: [n, n] 1 where the column is the row's parent; above: [n, n] 1 where it is the row
    itself or above it. place: [n, 3] m of the hinge, and turn: [n, 3, 3] the axes (rows) of a link
    at angle 0, in the parent's frame. moves: [n] 1 for a hinge.
    mass: [n] kg; com: [n, 3] m; axes: [n, 3, 3] the block's own axes (rows) in the link's frame;
    inertia: [n, 3] kg·m² about them; half: [n, 3] m, half of the block's sizes; solid: [n] 1 where
    there is a block.
    armature: [n] kg·m²; damping: [n] N·m·s/rad; low, high: [n] rad, where the limits' springs begin.
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
        """How many there are, n."""
        return self.mass.shape[0]


@dataclasses.dataclass(frozen=True)
class Surroundings:
    """What is the same in all lanes, and constant in the program.

    step: s. friction: of the ground. contact: s, time constant of a touch (`solref`). floor:
    whether there is one, z = 0. gravity: m/s². drag: N·s/m³, the resistance of a face to its normal
    velocity, per area; 0 without water. lit: whether there is something to see.
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
    """A limit's degree of freedom, for the solver."""

    dof: int


@dataclasses.dataclass(frozen=True)
class Dense:
    """The shape of the solver's problem: every degree of freedom may move every other."""

    links: int
    iterations: int
    line_iterations: int

    @property
    def pattern(self) -> Sparsity:
        """One chain of all degrees of freedom."""
        return sparsity(range(-1, self.links + 4))

    @property
    def limits(self) -> tuple[Hinge, ...]:
        """Of all hinges."""
        return tuple(Hinge(6 + j) for j in range(self.links - 1))
