"""Bodies, joints, feet and shapes of a compiled model in one pose.

Letters: `B` bodies, `J` joints, as in MuJoCo's arrays.
"""

import dataclasses
from collections.abc import Sequence

import mujoco
import numpy as np

from mjxgait.creature.geometry import ancestors, posed, subtree
from mjxgait.errors import UserError
from mjxgait.importer.notes import Notes
from mjxgait.importer.shapes import Shape

FREE, BALL, SLIDE, HINGE = (
    int(getattr(mujoco.mjtJoint, f"mjJNT_{name}")) for name in ("FREE", "BALL", "SLIDE", "HINGE")
)
UP_AXES = {"x": np.array([1.0, 0, 0]), "y": np.array([0, 1.0, 0]), "z": np.array([0, 0, 1.0])}


def find_root(model: mujoco.MjModel) -> int:
    """Return the body with the most joints in its subtree, then the most mass.

    A chain of bodies that only carry root slides is skipped.
    """
    tops = [b for b in range(1, model.nbody) if model.body_parentid[b] == 0]

    def weight(top: int) -> tuple[int, float]:
        joints = int(model.body_jntnum[subtree(model, top)].sum())
        return joints, float(model.body_subtreemass[top])

    if not tops:
        raise UserError("the model has no body; there is nothing that could walk")
    root = max(tops, key=weight)
    while True:
        children = [int(b) for b in np.flatnonzero(model.body_parentid == root)]
        if len(children) != 1 or model.body_mass[root] >= 1e-2 * model.body_subtreemass[root]:
            return root
        own, slides_on = _types(model, root), SLIDE in _types(model, children[0])
        if not slides_on and not (SLIDE in own and set(own) <= {SLIDE, HINGE}):
            return root
        root = children[0]


def _types(model: mujoco.MjModel, body: int) -> list[int]:
    return [int(t) for t in model.jnt_type[model.jnt_bodyid == body]]


def in_plane(model: mujoco.MjModel, root: int) -> bool:
    """Return whether the file's root can slide and turn in at most one plane."""
    types = _types(model, root)
    return SLIDE in types and types.count(HINGE) <= 1


def report_root_joints(model: mujoco.MjModel, root: int, notes: Notes) -> None:
    """Report the replacement of the joints that hold the root in the world."""
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


def unit_length(model: mujoco.MjModel, bodies: list[int], notes: Notes) -> float:
    """Unit of length in m: a body of more than 40 m is in millimetres."""
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


def up_axis(
    model: mujoco.MjModel,
    bodies: list[int],
    root: int,
    qpos: np.ndarray,
    up: str | None,
    notes: Notes,
) -> np.ndarray:
    """Up unit vector [3] in the file's world."""
    gravity = model.opt.gravity
    if up:
        notes.guess("up", up, "high", "as given")
        return UP_AXES[up]
    strongest = int(np.abs(gravity).argmax())
    if abs(gravity[strongest]) > 1 and strongest != 2:
        notes.change(
            "turned so that z is up", f"the file's gravity is {np.round(gravity, 2).tolist()}"
        )
        notes.guess("up", "xyz"[strongest], "high", "the file's gravity")
        return -np.sign(gravity[strongest]) * np.eye(3)[strongest]
    data = posed(model, qpos)
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


def turn_up(axis: np.ndarray) -> np.ndarray:
    """Rotation [3, 3] that takes an axis to z, the identity if it is z already."""
    if axis[2] > 0.99:
        return np.eye(3)
    side = np.roll(axis, 1) if axis[1] else np.array([0.0, 1.0, 0.0])
    side = side - axis * (side @ axis)
    return np.stack([side, np.cross(axis, side), axis])


@dataclasses.dataclass(eq=False)
class Anatomy:
    """Anatomy of a creature in one pose, up is z.

    spec: editable copy of its bodies, in the order of `bodies`. qpos: [nq] that pose. xpos [B, 3]
    m, xrot [B, 3, 3]: bodies in it. root: body id. bodies: ids of the creature's bodies, parents
    first. active: ids of joints that move. feet: ids of the last moving body of each leg. scale: m
    per unit of length. shapes: of each body. lowered: whether qpos has the limbs let down instead
    of the file's zero pose. swinging: ids of the joints by which arms swing.
    """

    spec: mujoco.MjSpec
    qpos: np.ndarray
    xpos: np.ndarray
    xrot: np.ndarray
    root: int
    bodies: list[int]
    active: list[int]
    feet: list[int]
    scale: float
    shapes: dict[int, list[Shape]]
    lowered: bool = False
    swinging: Sequence[int] = ()

    def turn(self, data: mujoco.MjData) -> np.ndarray:
        """Rotation [3, 3] from the world of the file, in a pose of it, to that of the anatomy."""
        found: np.ndarray = self.xrot[self.root] @ data.xmat[self.root].reshape(3, 3).T
        return found

    def low(self, bodies: Sequence[int]) -> float:
        """Lowest point in m of some bodies; the lowest body frame where they have no shapes."""
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


def measured(
    model: mujoco.MjModel,
    qpos: np.ndarray,
    axis: np.ndarray,
    scale: float,
    spec: mujoco.MjSpec,
    shapes: dict[int, list[Shape]],
) -> Anatomy:
    """Measure the creature in one pose, without joints and feet. axis: [3], up in the file."""
    data = posed(model, qpos)
    turn, bodies = turn_up(axis), list(shapes)
    xpos, xrot = scale * data.xpos @ turn.T, turn @ data.xmat.reshape(-1, 3, 3)
    return Anatomy(spec, qpos, xpos, xrot, bodies[0], bodies, [], [], scale, shapes)
