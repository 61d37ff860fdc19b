"""Finds what a compiled model consists of: which tree is the creature, which way is up, which limbs
are legs, which joints matter.

Letters: `B` bodies, `J` joints, as in MuJoCo's arrays.
"""

import dataclasses
import fnmatch
from collections.abc import Sequence

import mujoco
import numpy as np

from mjxgait.creature.geometry import ancestors
from mjxgait.errors import UserError
from mjxgait.importing.notes import Notes, listed
from mjxgait.importing.parts import FREE, HINGE, SLIDE, Shape, read_shapes

UP_AXES = {"x": np.array([1.0, 0, 0]), "y": np.array([0, 1.0, 0]), "z": np.array([0, 0, 1.0])}
SAME_LEVEL = 0.2
"""Share of the creature's height within which limbs that end near the lowest point are legs."""
MOST_BODIES, MOST_JOINTS = 400, 60


@dataclasses.dataclass(eq=False)
class Anatomy:
    """qpos: [nq] the pose that everything was measured in. xpos [B, 3], xrot [B, 3, 3]: bodies in
    that pose, up is z, m.

    root: body id. bodies: ids of the creature's bodies, parents first. active: ids of joints that
    move. feet: ids of the last moving body of each leg. scale: m per unit of length. shapes: of
    each body, scaled.
    """

    qpos: np.ndarray
    xpos: np.ndarray
    xrot: np.ndarray
    root: int
    bodies: list[int]
    active: list[int]
    feet: list[int]
    scale: float
    shapes: dict[int, list[Shape]]

    def low(self, model: mujoco.MjModel, bodies: Sequence[int]) -> float:
        """Lowest point in m of some bodies; their frames and centres of mass where they have no
        shapes.
        """
        heights = []
        for b in bodies:
            solid = [s for s in self.shapes[b] if s.solid] or self.shapes[b]
            heights += [
                float((self.xpos[b] + s.points @ self.xrot[b].T)[:, 2].min() - s.radius)
                for s in solid
            ]
            if not solid:
                heights.append(float(self.xpos[b][2]))
        return min(heights)


class NoLegs(UserError):
    """In this pose no limb reaches the floor."""


def find_anatomy(
    model: mujoco.MjModel,
    coupled: Sequence[str],
    keep: Sequence[str],
    freeze: Sequence[str],
    up: str | None,
    notes: Notes,
) -> Anatomy:
    """The anatomy of a compiled model.

    Args:
      coupled: names of joints that follow others. keep, freeze: patterns of joints that the user
        wants active or frozen.

    Raises:
      UserError: no creature that can walk, and why.
    """
    _check_size(model)
    root = _root(model)
    bodies = [b for b in range(1, model.nbody) if root in ancestors(model, b)]
    scale = _scale(model, bodies, notes)
    qpos = reference_pose(model)
    axis = _up_axis(model, bodies, root, qpos, up, notes)
    anatomy = _measure(model, qpos, axis, root, bodies, scale)
    _root_joints(model, root, notes)
    movable = _movable(model, anatomy, coupled, freeze, notes)
    try:
        anatomy.feet = _legs(model, anatomy, movable)
    except NoLegs as error:
        anatomy = _measure(model, lowered_limbs(model, anatomy, movable), axis, root, bodies, scale)
        anatomy.feet = _legs(model, anatomy, movable)
        if len(anatomy.feet) < 2:  # an arm on its base can reach down too
            raise UserError(str(error)) from None
    _choose_joints(model, anatomy, movable, keep, notes)
    _check_loops(model, anatomy)
    return anatomy


def reference_pose(model: mujoco.MjModel) -> np.ndarray:
    """[nq]: the file's zero pose, with each joint that may not be there in the middle of its
    range.
    """
    qpos = model.qpos0.copy()
    for j in range(model.njnt):
        a, (low, high) = int(model.jnt_qposadr[j]), model.jnt_range[j]
        if int(model.jnt_type[j]) in (HINGE, SLIDE) and low < high and not low <= qpos[a] <= high:
            qpos[a] = (low + high) / 2
    return qpos


def _check_size(model: mujoco.MjModel) -> None:
    if model.nbody > MOST_BODIES:
        raise UserError(
            f"the model has {model.nbody} bodies; more than {MOST_BODIES} is not one creature"
        )
    arrays = (
        model.body_pos,
        model.body_mass,
        model.body_inertia,
        model.jnt_range,
        model.geom_size,
        model.geom_pos,
        model.qpos0,
    )
    if not all(
        np.isfinite(a).all() and np.abs(a, dtype=float).max(initial=0) < 1e9 for a in arrays
    ):
        raise UserError(
            "the model has numbers that are infinite, not a number or absurdly large; correct them "
            "in the file"
        )


def _root(model: mujoco.MjModel) -> int:
    """The body whose subtree has the most joints, then the most mass; a chain of bodies that
    only carry root slides is passed over.
    """
    tops = [b for b in range(1, model.nbody) if model.body_parentid[b] == 0]

    def weight(top: int) -> tuple[int, float]:
        inside = [b for b in range(1, model.nbody) if top in ancestors(model, b)]
        return sum(int(model.body_jntnum[b]) for b in inside), float(model.body_subtreemass[top])

    if not tops:
        raise UserError("the model has no body; there is nothing that could walk")
    root = max(tops, key=weight)
    while True:
        children = [
            b for b in range(1, model.nbody) if model.body_parentid[b] == root and b != root
        ]
        slides = _types(model, root) and all(t in (SLIDE, HINGE) for t in _types(model, root))
        carries = len(children) == 1 and model.body_mass[root] < 1e-2 * model.body_subtreemass[root]
        leads_on = children and SLIDE in _types(model, children[0])
        below = children and any(t == SLIDE for t in _types(model, root))
        if carries and (leads_on or (slides and below)):
            root = children[0]
        else:
            return root


def _types(model: mujoco.MjModel, body: int) -> list[int]:
    start = int(model.body_jntadr[body])
    return (
        [int(t) for t in model.jnt_type[start : start + int(model.body_jntnum[body])]]
        if start >= 0
        else []
    )


def in_plane(model: mujoco.MjModel, root: int) -> bool:
    """Whether the file's root can slide and turn in one plane only, or less."""
    types = _types(model, root)
    return SLIDE in types and types.count(HINGE) <= 1


def _root_joints(model: mujoco.MjModel, root: int, notes: Notes) -> None:
    types = _types(model, root)
    if types == [FREE]:
        return
    if not types:
        notes.change(
            f'free joint added to "{model.body(root).name}"',
            "the file fixes the trunk in the world",
        )
    else:
        notes.change(
            f'free joint in place of the {len(types)} root joints of "{model.body(root).name}"',
            "the trunk must be free to fall; a body that lives in a plane gets feet that are wide "
            "across instead",
        )


def _scale(model: mujoco.MjModel, bodies: list[int], notes: Notes) -> float:
    """m per unit: a body of more than 40 m is one in millimetres."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    span = float(np.ptp(data.xpos[bodies], axis=0).max(initial=0))
    if span < 40:
        return 1.0
    notes.change(
        "all lengths divided by 1000",
        f"the body would be {span:.0f} m long, so the file is taken to be in millimetres",
    )
    return 1e-3


def _up_axis(
    model: mujoco.MjModel,
    bodies: list[int],
    root: int,
    qpos: np.ndarray,
    up: str | None,
    notes: Notes,
) -> np.ndarray:
    """[3] unit vector of the file's world that points up."""
    gravity = model.opt.gravity
    if up:
        notes.guess("up", up, "high", "as told")
        return UP_AXES[up]
    strongest = int(np.abs(gravity).argmax())
    if abs(gravity[strongest]) > 1 and strongest != 2:
        notes.change(
            "turned so that z is up", f"the file's gravity is {np.round(gravity, 2).tolist()}"
        )
        notes.guess("up", "xyz"[strongest], "high", "the file's gravity")
        return -np.sign(gravity[strongest]) * np.eye(3)[strongest]
    data = mujoco.MjData(model)
    data.qpos[:] = qpos
    mujoco.mj_kinematics(model, data)
    leaves = [b for b in bodies if not (model.body_parentid == b).any()]
    hips = [
        next(
            (
                b
                for b in reversed(ancestors(model, leaf))
                if b != root and root in ancestors(model, b)
            ),
            leaf,
        )
        for leaf in leaves
    ]
    below = (data.xpos[hips] - data.xpos[leaves]).mean(0) if leaves else np.zeros(3)
    if below[1] > 1.3 * abs(below[2]) and below[1] > abs(below[0]):
        notes.change("turned so that z is up", "the limbs end below the trunk along y, not along z")
        notes.guess("up", "y", "medium", "the limbs hang along it (--up says otherwise)")
        return UP_AXES["y"]
    notes.guess("up", "z", "high", "the convention; the limbs do not say otherwise")
    return UP_AXES["z"]


def _measure(
    model: mujoco.MjModel,
    qpos: np.ndarray,
    axis: np.ndarray,
    root: int,
    bodies: list[int],
    scale: float,
) -> Anatomy:
    data = mujoco.MjData(model)
    data.qpos[:] = qpos
    mujoco.mj_kinematics(model, data)
    turn = _turn_up(axis)
    shapes = {}
    for b in bodies:
        shapes[b] = read_shapes(model, b)
        for s in shapes[b]:
            s.size, s.pos, s.points, s.radius = (
                s.size * scale,
                s.pos * scale,
                s.points * scale,
                s.radius * scale,
            )
    xrot = turn @ data.xmat.reshape(-1, 3, 3)
    return Anatomy(qpos, scale * data.xpos @ turn.T, xrot, root, bodies, [], [], scale, shapes)


def _turn_up(axis: np.ndarray) -> np.ndarray:
    """[3, 3] rotation that takes an axis to z, without a turn where it is z already."""
    if axis[2] > 0.99:
        return np.eye(3)
    side = np.roll(axis, 1) if axis[1] else np.array([0.0, 1.0, 0.0])
    side = side - axis * (side @ axis)
    return np.stack([side, np.cross(axis, side), axis])


def _movable(
    model: mujoco.MjModel,
    anatomy: Anatomy,
    coupled: Sequence[str],
    freeze: Sequence[str],
    notes: Notes,
) -> list[int]:
    """Joints that could be active."""
    joints, slides, told = [], [], []
    followers = _followers(model)
    for j in range(model.njnt):
        name, kind = model.joint(j).name, int(model.jnt_type[j])
        if model.jnt_bodyid[j] not in anatomy.bodies or model.jnt_bodyid[j] == anatomy.root:
            continue
        if kind == SLIDE:
            slides.append(name or f"joint {j}")
        elif any(fnmatch.fnmatchcase(name, pattern) for pattern in freeze):
            told.append(name)
        elif name not in coupled and j not in followers and kind != FREE:
            joints.append(j)
    if slides:
        notes.change(
            f"slide joints {listed(slides)} frozen",
            "the controller's key poses are angles; a sliding limb keeps its length",
        )
    if told:
        notes.change(f"joints {listed(told)} frozen", "as told by --freeze")
    if followers:
        notes.change(
            f"joints {listed([model.joint(j).name for j in sorted(followers)])} frozen",
            "they follow other joints (equality)",
        )
    return joints


def _followers(model: mujoco.MjModel) -> set[int]:
    return {
        int(model.eq_obj1id[e])
        for e in range(model.neq)
        if int(model.eq_type[e]) == int(mujoco.mjtEq.mjEQ_JOINT) and model.eq_obj1id[e] >= 0
    }


def _segment(model: mujoco.MjModel, body: int, movers: set[int]) -> int:
    """The nearest body up the tree, itself included, that has an active joint; the root where
    there is none.
    """
    for b in ancestors(model, body):
        if b in movers:
            return b
    return -1


def _legs(model: mujoco.MjModel, anatomy: Anatomy, movable: list[int]) -> list[int]:
    """The moving bodies at the ends of the limbs that reach the floor."""
    movers = {int(model.jnt_bodyid[j]) for j in movable}
    if not movers:
        raise UserError(
            f'"{model.body(anatomy.root).name}" has no hinge joint below it, so it has no legs; a '
            "creature needs legs with hinges"
        )
    segments: dict[int, list[int]] = {}
    for b in anatomy.bodies:
        segments.setdefault(_segment(model, b, movers), []).append(b)
    ends = [b for b in movers if not any(c != b and b in ancestors(model, c) for c in movers)]
    floor = min(anatomy.low(model, inside) for inside in segments.values())
    top = max(float(anatomy.xpos[b][2]) for b in anatomy.bodies)
    span = float(np.ptp(anatomy.xpos[anatomy.bodies], axis=0).max())
    height = max(top - floor, 0.1 * span, 1e-6)
    ends = _without_toes(model, anatomy, ends, movers)
    feet = sorted(
        b
        for b in ends
        if anatomy.low(model, _below(model, anatomy, b)) <= floor + SAME_LEVEL * height
    )
    if not feet:
        lowest = min(ends, key=lambda b: anatomy.low(model, _below(model, anatomy, b)))
        raise NoLegs(
            f'no limb reaches the floor: "{model.body(anatomy.root).name}" itself lies lowest, the '
            f'lowest limb "{model.body(lowest).name}" '
            "ends above it, so this has no legs to walk on; if the file lies on its side, say --up"
        )
    wheels = [b for b in feet if _is_wheel(model, anatomy, b)]
    if len(wheels) == len(feet):
        raise UserError(
            f'"{model.body(wheels[0]).name}" is a wheel, as are all parts on the floor; a creature '
            "needs legs that step"
        )
    return [b for b in feet if b not in wheels]


def _below(model: mujoco.MjModel, anatomy: Anatomy, body: int) -> list[int]:
    return [b for b in anatomy.bodies if body in ancestors(model, b)]


def lowered_limbs(model: mujoco.MjModel, anatomy: Anatomy, movable: list[int]) -> np.ndarray:
    """[nq]: each limb as low as it gets, of some hundred poses; for files whose zero pose has
    the legs folded or stretched out.
    """
    data, rng = mujoco.MjData(model), np.random.default_rng(0)
    data.qpos[:] = anatomy.qpos
    up = anatomy.xrot[anatomy.root] @ _world_rotation(model, anatomy.qpos, anatomy.root).T
    movers = {int(model.jnt_bodyid[j]) for j in movable}
    for end in (b for b in movers if not any(c != b and b in ancestors(model, c) for c in movers)):
        joints = [
            j
            for j in movable
            if int(model.jnt_bodyid[j]) in ancestors(model, end) and int(model.jnt_type[j]) == HINGE
        ]
        adr = model.jnt_qposadr[joints]
        limits = np.array(
            [
                model.jnt_range[j] if model.jnt_range[j][0] < model.jnt_range[j][1] else (-1.6, 1.6)
                for j in joints
            ]
        )
        low, high = (
            np.maximum(limits[:, 0], data.qpos[adr] - 2.0),
            np.minimum(limits[:, 1], data.qpos[adr] + 2.0),
        )
        best, lowest = data.qpos[adr].copy(), np.inf
        for _ in range(300):
            data.qpos[adr] = rng.uniform(np.minimum(low, high), np.maximum(low, high))
            mujoco.mj_kinematics(model, data)
            clouds = [(b, s) for b in _below(model, anatomy, end) for s in anatomy.shapes[b]]
            points = [
                data.xpos[b] + (s.points / anatomy.scale) @ data.xmat[b].reshape(3, 3).T
                for b, s in clouds
            ] or [data.xpos[[end]]]
            height = float((np.concatenate(points) @ up.T)[:, 2].min())
            if height < lowest:
                best, lowest = data.qpos[adr].copy(), height
        data.qpos[adr] = best
    return data.qpos.copy()


def _world_rotation(model: mujoco.MjModel, qpos: np.ndarray, body: int) -> np.ndarray:
    data = mujoco.MjData(model)
    data.qpos[:] = qpos
    mujoco.mj_kinematics(model, data)
    return data.xmat[body].reshape(3, 3)


def _without_toes(
    model: mujoco.MjModel, anatomy: Anatomy, ends: list[int], movers: set[int]
) -> list[int]:
    """Several ends that branch off one moving body near each other are toes or fingers: that
    body is the end.
    """
    span = max(float(np.ptp(anatomy.xpos[anatomy.bodies], axis=0).max()), 1e-6)
    result: list[int] = []
    for end in ends:
        parent = _segment(model, int(model.body_parentid[end]), movers)
        brothers = [e for e in ends if parent > 0 and parent in ancestors(model, e)]
        near = len(brothers) > 1 and np.ptp(anatomy.xpos[brothers], axis=0).max() < 0.1 * span
        chosen = parent if near else end
        if chosen not in result:
            result.append(chosen)
    return result


def _is_wheel(model: mujoco.MjModel, anatomy: Anatomy, body: int) -> bool:
    """A round part on an unlimited hinge through its middle."""
    start = int(model.body_jntadr[body])
    if model.body_jntnum[body] != 1 or model.jnt_limited[start]:
        return False
    axis, anchor = model.jnt_axis[start], model.jnt_pos[start] * anatomy.scale
    clouds = [s.points for s in anatomy.shapes[body] if s.solid or s.seen]
    if not clouds:
        return False
    points = np.concatenate(clouds) - anchor
    away = np.linalg.norm(points - np.outer(points @ axis, axis), axis=1)
    centre = np.linalg.norm((points - np.outer(points @ axis, axis)).mean(0))
    return bool(away.max() > 0 and centre < 0.1 * away.max() and len(points) > 2)


def _choose_joints(
    model: mujoco.MjModel, anatomy: Anatomy, movable: list[int], keep: Sequence[str], notes: Notes
) -> None:
    """Active are the joints between the trunk and a foot, and those that the user keeps."""
    on_legs = {b for foot in anatomy.feet for b in ancestors(model, foot)}
    frozen = []
    for j in movable:
        wanted = any(fnmatch.fnmatchcase(model.joint(j).name, pattern) for pattern in keep)
        if model.jnt_bodyid[j] in on_legs or wanted:
            anatomy.active.append(j)
        else:
            frozen.append(model.joint(j).name or f"joint {j}")
    if frozen:
        notes.change(
            f"joints {listed(frozen)} frozen",
            "no leg hangs on them, so they have no part in walking (--keep PATTERN keeps some)",
        )
    if len(anatomy.active) > MOST_JOINTS:
        raise UserError(
            f"{len(anatomy.active)} joints would move; freeze those that do not matter with "
            f"--freeze (at most {MOST_JOINTS})"
        )


def _check_loops(model: mujoco.MjModel, anatomy: Anatomy) -> None:
    """Refuses a loop that a moving joint is part of."""
    moved = {
        b
        for b in anatomy.bodies
        if any(int(model.jnt_bodyid[j]) in ancestors(model, b) for j in anatomy.active)
    }
    for e in range(model.neq):
        if int(model.eq_type[e]) not in (
            int(mujoco.mjtEq.mjEQ_CONNECT),
            int(mujoco.mjtEq.mjEQ_WELD),
        ):
            continue
        objects = [int(model.eq_obj1id[e]), int(model.eq_obj2id[e])]
        if int(model.eq_objtype[e]) == int(mujoco.mjtObj.mjOBJ_SITE):
            objects = [int(model.site_bodyid[o]) for o in objects]
        if any(o in moved for o in objects):
            a, b = (model.body(max(o, 0)).name for o in objects)
            name = model.equality(e).name or f"equality constraint {e}"
            raise UserError(
                f'"{name}" closes a loop between "{a}" and "{b}", and only trees can be simulated '
                "here; "
                "take one of the two rods out, or the constraint, and import again"
            )
