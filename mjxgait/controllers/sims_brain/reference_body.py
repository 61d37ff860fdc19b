"""Reference growth of a modular body, without JAX: a list that grows while it is read.

A genome is its arrays by name, as checkpoints and champions store them: `graph.half`, … (see
`mjxgait.controllers.sims_brain.genotype.Graph`).
"""

import dataclasses
import itertools
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

JOINTS = ("rigid", "revolute", "twist", "universal", "bend-twist", "twist-bend", "spherical")
"""Sims' joint types, by number."""
AXES = ((), (2,), (0,), (1, 2), (2, 0), (0, 2), (0, 1, 2))
"""Hinge axes of each joint type, in the part's own axes, the first nearest to the parent."""
NEURONS = (
    *("sum", "product", "divide", "sum-threshold", "greater-than", "sign-of", "min", "max", "abs"),
    *("if", "interpolate", "sin", "cos", "atan", "log", "expt", "sigmoid", "integrate"),
    *("differentiate", "smooth", "memory", "oscillate-wave", "oscillate-saw"),
)
"""Sims' neuron functions, by number."""
INPUTS = 3
SENSORS = 7
"""Sensors of a part: the angles of up to three hinges, ground contact, and the light's direction
along its own three axes."""
SMALLEST, LARGEST = 0.02, 0.3
"""m; limits of half sizes after scaling."""
ROOM = 0.01
"""Largest overlap depth at rest with a block other than the parent, relative to the smaller one's
size (the cube root of its volume); a block that overlaps more does not grow."""
DENSITY = 1000.0
"""kg/m³; that of water."""
STRENGTH = 3000.0
"""N/m: largest torque of a hinge over the cross-section of the part it moves (Sims 1994)."""
DAMPING = 0.1
"""s: a hinge's damping over its strength; its own torque turns it at 10 rad/s at most."""
ROTOR = 0.01
"""s: a hinge's armature over its damping, so that the smallest blocks can be simulated."""
GRAVITY, FRICTION = 9.81, 0.9
"""m/s², and friction of the ground; neither acts in water."""
CONTACT_TIME_CONSTANT = 2.0
"""Contact time constant (`solref`) in steps: the smallest that MuJoCo simulates as given."""
DRAG = 500.0
"""N·s/m³; drag of water on a face per area and normal velocity."""
IN_LIGHT = ("follow", "follow-on-land", "compete")
"""Tasks with a light (in a contest the cube); without one its observations are zero."""
LIGHT = 10.0
"""m from a creature to its light: too far to be reached."""
CUBE, CUBE_DENSITY = 0.25, 500.0
"""m and kg/m³: side and density of the cube of a contest."""
HALF_A_TURN = (0.0, 0.0, 0.0, 1.0)
"""Quaternion about the vertical: the opponent faces the body."""
THEIRS = "opponent_"
"""Beginning of the names of the opponent's bodies, joints and geoms in a model."""
DISTANCE = 0.8
"""m between the cube and each of two opponents at the start; see `reach`."""


@dataclasses.dataclass(frozen=True)
class Box:
    """Block at rest in the root's frame. middle, half: [3] m. axes: [3, 3], columns."""

    middle: np.ndarray
    half: np.ndarray
    axes: np.ndarray

    @property
    def size(self) -> float:
        """Cube root of its volume, in m."""
        return float(np.cbrt(8 * self.half.prod()))

    @property
    def corners(self) -> np.ndarray:
        """Corners [8, 3] in m."""
        signs = np.array(list(itertools.product((-1.0, 1.0), repeat=3)))
        return self.middle + (signs * self.half) @ self.axes.T


def inside(one: Box, other: Box) -> float:
    """Return the overlap depth over the smaller one's size; negative if a face separates them."""
    deep = min(_behind(one, other), _behind(other, one))
    return deep / min(one.size, other.size)


def _behind(one: Box, other: Box) -> float:
    """Return the smallest depth in m of the other's corners behind a face of `one`.

    The depth behind a face is that of the deepest corner.
    """
    corners = (other.corners - one.middle) @ one.axes
    return float(min((one.half - corners.min(0)).min(), (one.half + corners.max(0)).min()))


MIRROR = np.diag([1.0, -1.0, 1.0])
IMAGES = ((False,), (True,), (False, True))
"""Copies that grow (mirrored or not), by the gene `mirror`."""


@dataclasses.dataclass(frozen=True)
class Part:
    """Block with its joint.

    node: of the graph. parent: number of the parent part, -1 for the root. mirrored: whether it is
    the mirror image of its node. half: [3] m. place: [3] m of the joint in the parent's frame.
    axes: [3, 3] the part's own (columns) there, before the joint turns. kind: of the joint.
    swing: [hinges] rad to either side. branch: occurrences of each node from the root to here.
    scale: of its node's sizes. box: its block at rest.
    """

    node: int
    parent: int
    mirrored: bool
    half: np.ndarray
    place: np.ndarray
    axes: np.ndarray
    kind: int
    swing: np.ndarray
    branch: Mapping[int, int]
    scale: float
    box: Box

    @property
    def hinges(self) -> tuple[int, ...]:
        """Hinge axes, as indices of the part's own axes."""
        return () if self.parent < 0 else AXES[self.kind]

    @property
    def joint(self) -> str:
        """Type of the joint to the parent."""
        return "none" if self.parent < 0 else JOINTS[self.kind]

    @property
    def middle(self) -> np.ndarray:
        """Middle [3] in m of its block, from its joint; zero for the root."""
        return np.array([0.0 if self.parent < 0 else self.half[0], 0.0, 0.0])

    @property
    def strength(self) -> float:
        """Strength of each hinge in N·m."""
        return float(STRENGTH * 4 * self.half[1] * self.half[2])


def grow(genome: Mapping[str, np.ndarray], most_parts: int, most_links: int) -> list[Part]:
    """Return the parts of a genome, parents first; parts without room do not grow."""
    graph = {n.removeprefix("graph."): a for n, a in genome.items() if n.startswith("graph.")}
    parts = [_root(graph)]
    links = 1
    for number, part in enumerate(parts):
        for place in _growing(graph, part):
            node, images = int(graph["target"][place]), IMAGES[int(graph["mirror"][place])]
            needed = len(images) * max(len(AXES[int(graph["joint"][node])]), 1)
            if len(parts) + len(images) > most_parts or links + needed > most_links:
                continue
            children = [_child(graph, part, number, place, image) for image in images]
            if _crowded(parts, children, number):
                continue
            links += needed
            parts += children
    return parts


def reach(parts: Sequence[Part]) -> float:
    """Return the largest sum in m of x and height over the corners of a body at rest.

    A plane at 45° over the body, that leans towards it, meets the ground there; opponents start
    with this plane at `DISTANCE` from the cube, so a tall body gains nothing by falling.
    """
    corners = np.concatenate([part.box.corners for part in parts])
    return float((corners[:, 0] + corners[:, 2]).max() - corners[:, 2].min())


def opponent_genome(genome: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return the arrays of the opponent's own genome; empty without one."""
    start = "opponent."
    return {name.removeprefix(start): a for name, a in genome.items() if name.startswith(start)}


def _crowded(parts: Sequence[Part], children: Sequence[Part], parent: int) -> bool:
    """Return whether a child would overlap a block other than its parent's."""
    boxes = [part.box for number, part in enumerate(parts) if number != parent]
    new = [child.box for child in children]
    pairs = [*itertools.product(boxes, new), *itertools.combinations(new, 2)]
    return any(inside(one, other) > ROOM for one, other in pairs)


def _growing(graph: Mapping[str, np.ndarray], part: Part) -> Iterator[tuple[int, int]]:
    """Yield the connections that a part's recursion allows, as (node, index of the connection)."""
    for own in np.flatnonzero(graph["used"][part.node]):
        place = part.node, int(own)
        target = int(graph["target"][place])
        may_recur = part.branch.get(target, 0) <= graph["recursion"][target]
        at_the_end = part.branch[part.node] > graph["recursion"][part.node]
        if may_recur and (at_the_end or not graph["terminal"][place]):
            yield place


def _root(graph: Mapping[str, np.ndarray]) -> Part:
    half = np.clip(graph["half"][0], SMALLEST, LARGEST)
    return Part(
        node=0,
        parent=-1,
        mirrored=False,
        half=half,
        place=np.zeros(3),
        axes=np.eye(3),
        kind=0,
        swing=np.zeros(0),
        branch={0: 1},
        scale=1.0,
        box=Box(np.zeros(3), half, np.eye(3)),
    )


def _child(
    graph: Mapping[str, np.ndarray], parent: Part, number: int, at: tuple[int, int], image: bool
) -> Part:
    node = int(graph["target"][at])
    scale = parent.scale * float(graph["scale"][at])
    place, axes = joined(parent.half, graph["place"][at], graph["turn"][at])
    mirrored = parent.mirrored != image
    if mirrored:
        place, axes = MIRROR @ place, MIRROR @ axes @ MIRROR
    kind = int(graph["joint"][node])
    half = np.clip(graph["half"][node] * scale, SMALLEST, LARGEST)
    on, own = parent.box, parent.box.axes @ axes
    return Part(
        node=node,
        parent=number,
        mirrored=mirrored,
        half=half,
        place=place + parent.middle,
        axes=axes,
        kind=kind,
        swing=graph["swing"][node][: len(AXES[kind])],
        branch={**parent.branch, node: parent.branch.get(node, 0) + 1},
        scale=scale,
        box=Box(on.middle + on.axes @ place + half[0] * own[:, 0], half, own),
    )


def joined(half: np.ndarray, place: np.ndarray, turn: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return a child's joint [3] in m from a block's middle, and the child's axes [3, 3] (columns).

    A ray from the block's middle along `place`, in half sizes, leaves the block at the joint. The
    first axis is normal to the face; the axes are then turned about the first, second and third.
    """
    face = int(np.argmax(np.abs(place)))
    outward = (-1.0 if place[face] < 0 else 1.0) * np.eye(3)[face]
    side = np.eye(3)[(face + 1) % 3]
    frame = np.column_stack([outward, side, np.cross(outward, side)])
    turned = frame @ _about(0, turn[0]) @ _about(1, turn[1]) @ _about(2, turn[2])
    return half * place / max(abs(place[face]), 1e-6), turned


def _about(axis: int, angle: float) -> np.ndarray:
    """Return a rotation matrix, by Rodrigues' formula."""
    x, y, z = np.eye(3)[axis]
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
