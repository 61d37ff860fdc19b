"""Overlap of a creature's parts: pairs that can pass through each other, and their depth.

Parts do not collide in evolution: such contacts would cost too much. Instead their depth is
measured on bars (capsules, spheres) inside each shape, between parts that are not neighbours.
Letters: `S` bars, `Q` pairs of bars.
"""

import collections
import dataclasses
import functools
import hashlib
from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np

from mjxgait.creature.bars import Bar, bars_of
from mjxgait.creature.creature import Creature
from mjxgait.creature.geometry import posed
from mjxgait.lru import LruCache

NEAR = 0.1
"""Hip heights; joints nearer to each other count as one place, like the three of an Euler hip."""
SAMPLES = 384
BEYOND = 0.1
"""Share of a pose range by which balance corrections and lag may take joints beyond it."""
CLOSE = 0.05
"""Hip heights; pairs that stay farther apart in all sampled poses are left out."""
MOST_PAIRS = 256
"""Largest number of measured pairs of bars."""

Numbers = Any
"""np.ndarray | jax.Array"""
Vector = tuple[Numbers, Numbers, Numbers]


@dataclasses.dataclass(frozen=True, eq=False)
class Crossings:
    """The pairs of bars to measure.

    body: [S] ids. centre, half: [S, 3] m in the body's frame, a bar's middle, and from there to an
    end. radius: [S] m. first, second: [Q] the bars of each pair. allowed: [Q] m, the depth of their
    shapes in the standing pose.
    """

    body: np.ndarray
    centre: np.ndarray
    half: np.ndarray
    radius: np.ndarray
    first: np.ndarray
    second: np.ndarray
    allowed: np.ndarray

    @property
    def reach(self) -> np.ndarray:
        """Reach [Q] in m; a pair's depth is this minus the distance of the two axes."""
        return self.radius[self.first] + self.radius[self.second] - self.allowed

    def only(self, pairs: np.ndarray | list[int]) -> "Crossings":
        """Some of the pairs."""
        chosen = {name: getattr(self, name)[pairs] for name in ("first", "second", "allowed")}
        return dataclasses.replace(self, **chosen)

    def lengths(self) -> tuple[np.ndarray, np.ndarray]:
        """Squared half lengths [Q] of the first and the second bars; m²."""
        squared = (self.half**2).sum(1)
        return squared[self.first], squared[self.second]


def bar_distance(
    apart: Vector, first: Vector, second: Vector, lengths: tuple[Numbers, Numbers]
) -> Numbers:
    """Distance of two segments in m, elementwise, of NumPy or JAX arrays.

    Ericson 2005, "Real-Time Collision Detection", section 5.1.9.

    Args:
      apart: from the second's middle to the first's, three components.
      first, second: from each middle to its end.
      lengths: squared, of `first` and `second`; zero for a point.
    """
    inverse = [(x > 0) / (x + (x == 0)) for x in lengths]
    along = _dot(first, second)
    lead, back = _dot(first, apart), _dot(second, apart)
    # For parallel segments any start will do: the two projections find the nearest points.
    skew = (lengths[0] * lengths[1] - along * along).clip(1e-12, None)
    s = ((along * back - lead * lengths[1]) / skew).clip(-1.0, 1.0)
    t = ((along * s + back) * inverse[1]).clip(-1.0, 1.0)
    s = ((along * t - lead) * inverse[0]).clip(-1.0, 1.0)
    gap = [a + s * u - t * v for a, u, v in zip(apart, first, second, strict=True)]
    return (_dot(gap, gap)) ** 0.5


def find_crossings(creature: Creature) -> Crossings:
    """Pairs of bars that come near each other in the pose ranges; deterministic.

    The search takes up to half a second, so the latest results are kept.
    """
    return _FOUND.find(_search_key(creature), lambda: _search(creature))


_FOUND: LruCache[Crossings] = LruCache(32)


def _search_key(creature: Creature) -> bytes:
    """Hash of all that the search reads."""
    model = np.zeros(mujoco.mj_sizeModel(creature.model), np.uint8)
    mujoco.mj_saveModel(creature.model, None, model)
    joints, planar = creature.joints, creature.settings.creature.planar
    ranges = (joints.low, joints.high, joints.pose_low, joints.pose_high, joints.qpos_adr)
    text = f"{creature.frame.hip_height} {planar} {SAMPLES}".encode()
    return hashlib.sha256(
        text + b"".join(array.tobytes() for array in (model, creature.stand_qpos, *ranges))
    ).digest()


def _search(creature: Creature) -> Crossings:
    model = creature.model
    data = posed(model, creature.stand_qpos)
    geoms, bars = all_bars(model)
    near = NEAR * creature.frame.hip_height
    strangers = ~neighbours(model, data, near, creature.settings.creature.planar)
    body = model.geom_bodyid[geoms]
    first, second = np.nonzero(np.triu(strangers[body][:, body], 1))
    everything = _joined(model, geoms, bars, first, second)
    stand, deepest = _standing_and_deepest(creature, everything)
    shapes = geoms[first] * model.ngeom + geoms[second]
    allowed = _of_their_shapes(shapes, stand)
    kept = _deepest_of_each(shapes, deepest - allowed, -CLOSE * creature.frame.hip_height)
    return _joined(model, geoms, bars, first[kept], second[kept], allowed[kept])


def all_bars(model: mujoco.MjModel) -> tuple[np.ndarray, list[Bar]]:
    """Bars of all moving geoms: geom id [S] and bar of each."""
    moving = np.flatnonzero(model.body_weldid[model.geom_bodyid] != 0)
    pairs = [(int(g), bar) for g in moving for bar in bars_of(model, int(g))]
    return np.array([g for g, _ in pairs], dtype=int), [bar for _, bar in pairs]


def neighbours(
    model: mujoco.MjModel, data: mujoco.MjData, near: float, planar: bool = False
) -> np.ndarray:
    """Flags [nbody, nbody] of the pairs of bodies that count as neighbours.

    Neighbours are one body, are parent and child, have all joints between them at one place, or
    belong to two limbs of a planar body, which can only pass each other. near: m, largest distance
    of joints at one place in the pose of `data`.
    """
    weld = model.body_weldid
    joined = np.zeros((model.nbody, model.nbody), dtype=bool)
    for a in range(model.nbody):
        for b in range(a + 1):
            links = _links(model, int(weld[a]), int(weld[b]))
            anchors = [_anchors(model, data, link) for link in links]
            spots = np.concatenate(anchors) if anchors else np.zeros((0, 3))
            spread = np.ptp(spots, axis=0) if len(spots) else np.zeros(3)
            one_place = len(links) < 2 or np.linalg.norm(spread) < near
            joined[a, b] = joined[b, a] = one_place or (planar and _two_limbs(model, links))
    return joined


def _two_limbs(model: mujoco.MjModel, links: list[int]) -> bool:
    """True if the bodies between two others, as of `_links`, belong to two limbs."""
    tops = [
        body for body in links if int(model.body_weldid[model.body_parentid[body]]) not in links
    ]
    return len(tops) == 2


def _links(model: mujoco.MjModel, a: int, b: int) -> list[int]:
    """The bodies with the joints between two others; none of them is welded to its parent."""
    links = []
    while a != b:
        links.append(max(a, b))  # a parent's id is smaller than its child's
        parent = int(model.body_weldid[model.body_parentid[links[-1]]])
        a, b = (parent, b) if a > b else (a, parent)
    return links


def _anchors(model: mujoco.MjModel, data: mujoco.MjData, body: int) -> np.ndarray:
    start = int(model.body_jntadr[body])
    return np.asarray(data.xanchor[start : start + int(model.body_jntnum[body])])


def _joined(
    model: mujoco.MjModel,
    geoms: np.ndarray,
    bars: list[Bar],
    first: np.ndarray,
    second: np.ndarray,
    allowed: np.ndarray | None = None,
) -> Crossings:
    """Crossings of these pairs, without unused bars."""
    used, places = np.unique(np.concatenate([first, second]), return_inverse=True)
    chosen = [bars[i] for i in used]
    return Crossings(
        body=model.geom_bodyid[geoms[used]],
        centre=np.array([bar.centre for bar in chosen]).reshape(-1, 3),
        half=np.array([bar.half for bar in chosen]).reshape(-1, 3),
        radius=np.array([bar.radius for bar in chosen]),
        first=places[: len(first)],
        second=places[len(first) :],
        allowed=np.zeros(len(first)) if allowed is None else allowed,
    )


def _standing_and_deepest(creature: Creature, pairs: Crossings) -> tuple[np.ndarray, np.ndarray]:
    """Depth [Q] in the standing pose, and the greatest over this and random poses.

    Negative: a gap. -inf where the bars stay far apart.
    """
    poses = _poses(creature)
    length = np.linalg.norm(pairs.half, axis=1) + pairs.radius
    most = length[pairs.first] + length[pairs.second] + CLOSE * creature.frame.hip_height
    near = np.zeros(len(pairs.first), dtype=bool)
    placed = [bar_places(creature.model, qpos, pairs) for qpos in poses]
    for centre, _ in placed:
        apart = centre[pairs.first] - centre[pairs.second]
        near |= (apart**2).sum(1) < most**2
    some = np.flatnonzero(near)
    chosen = pairs.only(some)
    stand, deepest = np.full(len(near), -np.inf), np.full(len(near), -np.inf)
    depths = (pair_depths(chosen, *place) for place in placed)
    stand[some] = next(depths)
    deepest[some] = functools.reduce(np.maximum, depths, stand[some])
    return stand, deepest


def _poses(creature: Creature) -> list[np.ndarray]:
    """The standing pose [nq], then random poses in the pose ranges and somewhat beyond.

    They are uniform; in every other one each joint is at an end of its range.
    """
    rng = np.random.default_rng(0)
    wide = BEYOND * (creature.joints.pose_high - creature.joints.pose_low)
    low = np.maximum(creature.joints.pose_low - wide, creature.joints.low)
    high = np.minimum(creature.joints.pose_high + wide, creature.joints.high)
    share = rng.uniform(size=(SAMPLES, len(low)))
    share[::2] = np.round(share[::2])
    poses = np.tile(creature.stand_qpos, (SAMPLES + 1, 1))
    poses[1:, creature.joints.qpos_adr] = low + share * (high - low)
    return list(poses)


def bar_places(
    model: mujoco.MjModel, qpos: np.ndarray, pairs: Crossings
) -> tuple[np.ndarray, np.ndarray]:
    """Middle and half axis of every bar in a pose [nq], both [S, 3] m in the world."""
    data = posed(model, qpos)
    rot = data.xmat[pairs.body].reshape(-1, 3, 3)
    turned = [np.einsum("sij,sj->si", rot, x) for x in (pairs.centre, pairs.half)]
    return data.xpos[pairs.body] + turned[0], turned[1]


def pair_depths(pairs: Crossings, centre: np.ndarray, half: np.ndarray) -> np.ndarray:
    """Depth [Q] of each pair in m beyond that of the standing pose; negative where apart."""
    apart = _parts((centre[pairs.first] - centre[pairs.second]).T)
    first, second = _parts(half[pairs.first].T), _parts(half[pairs.second].T)
    return np.asarray(pairs.reach - bar_distance(apart, first, second, pairs.lengths()))


def _of_their_shapes(shapes: np.ndarray, stand: np.ndarray) -> np.ndarray:
    """Standing depth [Q] of the two shapes that a pair of bars belongs to, at least 0."""
    _, group = np.unique(shapes, return_inverse=True)
    depth = np.zeros(group.max(initial=-1) + 1)
    np.maximum.at(depth, group, stand)
    return depth[group]


def _deepest_of_each(shapes: np.ndarray, depth: np.ndarray, least: float) -> np.ndarray:
    """Pairs to measure: the deepest of every two shapes, then the second, up to `MOST_PAIRS`."""
    order = [k for k in np.argsort(-depth, kind="stable") if depth[k] > least]
    turn = collections.Counter[int]()
    ranks = []
    for k in order:
        ranks.append(turn[int(shapes[k])])
        turn[int(shapes[k])] += 1
    chosen = np.argsort(ranks, kind="stable")[:MOST_PAIRS]
    return np.sort(np.array(order, dtype=int)[chosen])


def _parts(rows: np.ndarray) -> Vector:
    return rows[0], rows[1], rows[2]


def _dot(a: Sequence[Numbers], b: Sequence[Numbers]) -> Numbers:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
