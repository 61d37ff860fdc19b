"""Measurements of a MuJoCo model in its standing pose: support points, leg lengths, mirror map."""

from collections.abc import Collection

import mujoco
import numpy as np

from mjxgait.errors import UserError

GEOM = mujoco.mjtGeom
DOWN = np.array([0.0, 0.0, -1.0])
PARALLEL = 0.99999
"""Cosine from which two axes count as parallel.

The axes of twenty joints within it are of rank one to within 0.01, the limit of certification.
"""


def posed(model: mujoco.MjModel, qpos: np.ndarray) -> mujoco.MjData:
    """Data of a model with bodies, joints and geoms placed for one pose [nq], and no more."""
    data = mujoco.MjData(model)
    data.qpos[:] = qpos
    mujoco.mj_kinematics(model, data)
    return data


def support_extents(geom_type: int, size: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
    """Parameters `(r, b, e)` of a geom's support function.

    The geom's reach from its centre in the direction `u` of its own frame is
    `r + sum(abs(u) * b) + sqrt(sum((u * e)**2))`: the Minkowski sum of a sphere, a box and an
    ellipsoid.

    Args:
      size: [3] MuJoCo's sizes. A mesh is measured by the box in `size`.

    Returns:
      r [], b [3], e [3] in m.
    """
    a, b, c = (float(s) for s in size)
    zero = np.zeros(3)
    match geom_type:
        case GEOM.mjGEOM_SPHERE:
            return a, zero, zero
        case GEOM.mjGEOM_CAPSULE:
            return a, np.array([0.0, 0.0, b]), zero
        case GEOM.mjGEOM_CYLINDER:
            return 0.0, np.array([0.0, 0.0, b]), np.array([a, a, 0.0])
        case GEOM.mjGEOM_ELLIPSOID:
            return 0.0, zero, np.array([a, b, c])
        case _:
            return 0.0, np.array([a, b, c]), zero


def geom_reach(
    model: mujoco.MjModel, data: mujoco.MjData, geom: int, direction: np.ndarray
) -> float:
    """Reach of a geom along a world direction [3], from the world's origin; m."""
    r, box, ellipsoid = support_extents(model.geom_type[geom], model.geom_size[geom])
    u = data.geom_xmat[geom].reshape(3, 3).T @ direction
    return float(
        data.geom_xpos[geom] @ direction
        + r
        + np.abs(u) @ box
        + np.sqrt(((u * ellipsoid) ** 2).sum())
    )


def shapes(model: mujoco.MjModel) -> list[int]:
    """Geoms that may touch something, without the world's."""
    collides = (model.geom_contype != 0) | (model.geom_conaffinity != 0)
    return [int(g) for g in np.flatnonzero(collides & (model.geom_bodyid != 0))]


def lowest(model: mujoco.MjModel, data: mujoco.MjData, body: int | None = None) -> float:
    """Height of the lowest point, of all bodies or one, that may touch something; m.

    Infinite for a body without such a point.
    """
    own = [g for g in shapes(model) if body is None or model.geom_bodyid[g] == body]
    return min((-geom_reach(model, data, g, DOWN) for g in own), default=np.inf)


def body_length(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    forward: np.ndarray,
    bodies: Collection[int] | None = None,
) -> float:
    """Distance from the foremost to the hindmost point along a world direction [3]; m.

    bodies: only their shapes count; None: those of all.
    """
    counted = range(1, model.nbody) if bodies is None else bodies
    parts = [g for g in range(model.ngeom) if model.geom_bodyid[g] in counted]
    front = max(geom_reach(model, data, g, forward) for g in parts)
    return front + max(geom_reach(model, data, g, -forward) for g in parts)


def ancestors(model: mujoco.MjModel, body: int) -> list[int]:
    """The bodies from `body` up to, but without, the world."""
    chain = []
    while body:
        chain.append(body)
        body = int(model.body_parentid[body])
    return chain


def moving_body(model: mujoco.MjModel, body: int) -> int:
    """The nearest body from `body` up with a joint; the topmost one if none has."""
    chain = ancestors(model, body)
    return next((b for b in chain if model.body_jntnum[b]), chain[-1] if chain else body)


def subtree(model: mujoco.MjModel, body: int) -> list[int]:
    """The body and all bodies below it."""
    return [b for b in range(body, model.nbody) if body in ancestors(model, b)]


def leg_lengths(
    model: mujoco.MjModel, data: mujoco.MjData, feet: list[int], joints: list[int]
) -> np.ndarray:
    """Height [feet] in m of each leg's first joint above the floor.

    A leg is the part of the tree that leads to one foot body only. A body that stands on its trunk
    has no leg: its highest joint counts.
    """
    if {model.jnt_bodyid[j] for j in joints}.isdisjoint(
        b for foot in feet for b in ancestors(model, foot)
    ):
        return np.full(len(feet), max(data.xanchor[j][2] for j in joints))
    chains = {foot: ancestors(model, foot) for foot in feet}
    lengths = []
    for foot, chain in chains.items():
        shared = {b for other, c in chains.items() if other != foot for b in c}
        own = [
            j
            for j in joints
            if model.jnt_bodyid[j] in chain
            and (model.jnt_bodyid[j] not in shared or len(feet) == 1)
        ]
        heights = [data.xanchor[j][2] for j in own] or [data.xpos[foot][2]]
        lengths.append(max(heights))
    return np.array(lengths)


def parallel(axes: np.ndarray) -> np.ndarray:
    """Flags [J] of the axes that are parallel to the first. axes: [J, 3] of length 1."""
    found: np.ndarray = np.abs(axes @ axes[0]) >= PARALLEL
    return found


def mirror_map(
    anchors: np.ndarray,
    axes: np.ndarray,
    slides: np.ndarray,
    carried: np.ndarray,
    names: list[str],
    tolerance: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Partner and sign of every joint, reflected in the vertical plane through the trunk.

    A rotation axis is a pseudo-vector: reflected in y it becomes `(-x, y, -z)`; a slide's direction
    becomes `(x, -y, z)`.

    Args:
      anchors, axes: [J, 3] in the creature's frame (forward, left, up) in the standing pose, m.
      slides: [J] whether the joint is a slide.
      carried: [J, 3] m, in the same frame: the centre of mass of all that hangs on the joint. It
        distinguishes a left and a right joint with the same anchor and axis.
      tolerance: m, largest distance of a mirrored anchor from its partner's, or of a mirrored hinge
        from its partner and of what they carry.

    Returns:
      partner [J] and sign [J]: joint `j` of the mirror image moves as `sign[j] * partner[j]`.

    Raises:
      UserError: names the joint that has no partner.
    """
    partner, sign = mirror_images(anchors, axes, slides, carried, tolerance)
    for j, name in enumerate(names):
        if partner[j] < 0:
            raise UserError(
                f'joint "{name}" has no mirror partner: no joint has its mirrored anchor and axis; '
                "say which in [mirror] pairs, or set symmetric = false"
            )
    return partner, sign


def mirror_images(
    anchors: np.ndarray,
    axes: np.ndarray,
    slides: np.ndarray,
    carried: np.ndarray,
    tolerance: float,
    slack: float = 1.0,
) -> tuple[np.ndarray, np.ndarray]:
    """Partner [J] of every joint as in `mirror_map`, -1 where there is none, and sign [J].

    slack: tolerance of the axes, in units of the usual one.
    """
    mirror = [1, -1, 1]
    turned = axes * np.where(slides[:, None], [1.0, -1.0, 1.0], [-1.0, 1.0, -1.0])
    distance, load = (
        np.linalg.norm((places * mirror)[:, None] - places[None], axis=-1)
        for places in (anchors, carried)
    )
    parallel = turned @ axes.T
    apart = (anchors * mirror)[:, None] - anchors[None]
    # A hinge may have its anchor anywhere on its line: servos on one side have it on that side.
    # Left and right knees share a line, so it counts only where what hangs on them is mirrored too.
    one_line = ~slides & (off_axis(apart, axes) < tolerance) & (load < tolerance)
    fits = (
        ((distance < tolerance) | one_line)
        & (np.abs(parallel) > 1 - 0.01 * slack)
        & (slides[:, None] == slides[None])
    )
    score = np.where(fits, distance + (1 - np.abs(parallel)) + load, np.inf)
    partner, places = score.argmin(axis=1), np.arange(len(anchors))
    mutual = fits.any(axis=1) & (partner[partner] == places)
    sign = np.sign(parallel[places, partner]).astype(int)
    return np.where(mutual, partner, -1), sign


def off_axis(vectors: np.ndarray, axes: np.ndarray) -> np.ndarray:
    """Lengths [...] of vectors [..., 3] across axes [..., 3] of length 1."""
    across = vectors - (vectors * axes).sum(-1, keepdims=True) * axes
    length: np.ndarray = np.linalg.norm(across, axis=-1)
    return length


WAY_OUT = "only one creature on a flat floor is simulated"


def beside(model: mujoco.MjModel, names: Collection[str]) -> np.ndarray:
    """Return which bodies [nbody] belong to others than the creature, given the roots' names."""
    found: np.ndarray = np.isin(model.body_rootid, [model.body(name).id for name in names])
    return found


def check_world(
    model: mujoco.MjModel, trunk: int, floor: int, beside: Collection[int] = ()
) -> None:
    """Refuse what evolution would ignore: other moving bodies, and touchable geoms but the floor.

    Args:
      trunk: body id. floor: geom id. beside: ids of other bodies that may move, with all on them.

    Raises:
      UserError: names the body or geom, and the remedy.
    """
    own = int(model.body_treeid[trunk])
    known = {own, *(int(model.body_treeid[body]) for body in beside)}
    for body in np.flatnonzero(model.body_treeid >= 0):
        if own >= 0 and int(model.body_treeid[body]) not in known:
            raise UserError(
                f'body "{model.body(body).name or body}" moves but is no part of '
                f'"{model.body(trunk).name}": {WAY_OUT}; '
                "take the body out of creature.xml, or join it to the creature"
            )
    still = model.body_weldid[model.geom_bodyid] == 0
    for geom in np.flatnonzero(still):
        if geom != floor and _can_be_touched(model, int(geom), still):
            raise UserError(
                f"{_called(model, int(geom))} stands in the world where the creature can touch it: "
                f"{WAY_OUT}; take the geom out of creature.xml, or make it decoration with "
                'contype="0" conaffinity="0"'
            )


def _can_be_touched(model: mujoco.MjModel, geom: int, still: np.ndarray) -> bool:
    """True if MuJoCo would collide the geom with something that moves."""
    masks = (model.geom_contype[geom] & model.geom_conaffinity) | (
        model.geom_contype & model.geom_conaffinity[geom]
    )
    pairs = np.stack([model.pair_geom1, model.pair_geom2], 1)
    return bool((masks[~still] != 0).any() or (pairs == geom).any())


def _called(model: mujoco.MjModel, geom: int) -> str:
    if name := model.geom(geom).name:
        return f'geom "{name}"'
    body = model.body(model.geom_bodyid[geom]).name
    return f'a geom without name (number {geom}, in body "{body}")'


def rotation(quat: np.ndarray) -> np.ndarray:
    """Rotation [3, 3] of a quaternion [4] (w, x, y, z)."""
    result = np.zeros(9)
    mujoco.mju_quat2Mat(result, np.asarray(quat, float))
    return result.reshape(3, 3)


def quaternion(matrix: np.ndarray) -> np.ndarray:
    """Quaternion [4] (w, x, y, z) of a rotation [3, 3]."""
    result = np.zeros(4)
    mujoco.mju_mat2Quat(result, np.ascontiguousarray(matrix, float).ravel())
    return result
