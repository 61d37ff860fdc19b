"""Opponent of a modular body in a contest: it grows, and acts, as the body does."""

import jax
import jax.numpy as jnp

from mjxgait.controllers.observations import sense
from mjxgait.controllers.sims_brain.brain import wired
from mjxgait.controllers.sims_brain.controller import LIGHT, Brains, directions
from mjxgait.controllers.sims_brain.genotype import Capacity, Graph
from mjxgait.controllers.sims_brain.operators import Genotype
from mjxgait.controllers.sims_brain.phenotype import GrownBody, body_of
from mjxgait.controllers.sims_brain.reference_body import (
    CUBE,
    CUBE_DENSITY,
    DISTANCE,
    HALF_A_TURN,
)
from mjxgait.creature.body import Body
from mjxgait.physics.batched_trees.arena import Act, Arena, cube_tree, reach, resting
from mjxgait.physics.batched_trees.plant import TreePlant
from mjxgait.physics.batched_trees.tree import Tree
from mjxgait.types import Sensed


def acting(controller: Brains, body: Body) -> Act:
    """Return the function by which the opponent acts. The cube is its light."""

    def act(brain: object, mind: object, sensed: Sensed) -> tuple[jax.Array, object]:
        senses = sense(body, sensed, jnp.zeros(()), ("joint_pos", "contact"))
        senses[LIGHT] = directions(sensed.body.cube, sensed)
        return controller.act(brain, mind, senses)  # type: ignore[arg-type]

    return act


def grown_both(own: Graph, other: Graph, capacity: Capacity) -> tuple[GrownBody, GrownBody]:
    """Return the bodies that grow from two graphs. In one go, which halves the compilation."""
    both = jax.tree.map(lambda a, b: jnp.stack([a, b]), own, other)
    bodies = jax.vmap(lambda graph: body_of(graph, capacity))(both)
    first, second = (jax.tree.map(lambda leaf, at=k: leaf[at], bodies) for k in range(2))
    return first, second


def arena_of(
    plant: TreePlant, controller: Brains, genome: Genotype, start: jax.Array
) -> tuple[Tree, jax.Array, Arena]:
    """Return a body's tree, its start [nq] on the ground, and the opponent and the cube around it.

    start: [nq], before the body that grows is put on the ground. Between the cube and a plane that
    leans back over each body lies `DISTANCE`, so a tall body gains nothing by falling.
    """
    theirs = genome.opponent
    assert theirs is not None
    own, other = grown_both(genome.graph, theirs.graph, controller.capacity)
    mine_tree, its_tree = plant.prepared(own.tree), plant.prepared(other.tree)
    trees = jax.tree.map(lambda a, b: jnp.stack([a, b]), mine_tree, its_tree)
    mine, its = jax.vmap(reach)(trees)
    still, none, half = jnp.zeros(own.tree.links - 1), jnp.zeros(()), CUBE / 2
    middle = mine + DISTANCE + half
    far = jnp.stack([middle + half + DISTANCE + its, none, none])
    facing = jnp.concatenate([far, jnp.asarray(HALF_A_TURN), still])
    bent = jnp.concatenate([start[:7], start[7:] * own.tree.moves[1:]])
    rested = jax.vmap(plant.rested)(trees, jnp.stack([bent, facing]))
    cube = jnp.stack([middle, none, none + half])
    cube = jnp.concatenate([cube, jnp.asarray([1.0, 0.0, 0.0, 0.0, 0.0])])
    arena = Arena(
        opponent=resting(its_tree, rested[1]),
        cube=resting(plant.prepared(cube_tree(CUBE, CUBE_DENSITY)), cube),
        brain=wired(theirs.nerves, theirs.centre, other, controller.room),
        mind=controller.init(),
        torque=still,
        count=jnp.int32(0),
    )
    return mine_tree, rested[0], arena
