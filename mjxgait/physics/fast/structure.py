"""What the fast physics needs of a model, as plain Python constants."""

import dataclasses
from collections import Counter
from collections.abc import Sequence

import mujoco
import numpy as np

from mjxgait.physics.fast.lanes import Constants, Matrix, columns, constants
from mjxgait.physics.fast.support import check_supported
from mjxgait.physics.fast.treematrix import Sparsity, sparsity

FREE, BALL, SLIDE, HINGE = (
    int(getattr(mujoco.mjtJoint, f"mjJNT_{name}")) for name in ("FREE", "BALL", "SLIDE", "HINGE")
)
FREEDOMS = {FREE: 6, BALL: 3, SLIDE: 1, HINGE: 1}


@dataclasses.dataclass(frozen=True)
class Joint:
    """kind: FREE, BALL, SLIDE or HINGE. qpos, dof: addresses. axis, anchor: in the body's frame. reference: qpos0 of a slide or hinge."""

    kind: int
    qpos: int
    dof: int
    axis: Constants
    anchor: Constants
    reference: float


@dataclasses.dataclass(frozen=True)
class Body:
    """parent: index among the bodies, -1 for the world. pos, rot: in the parent's frame. com, axes, inertia: principal, in its own."""

    parent: int
    pos: Constants
    rot: Matrix
    joints: tuple[Joint, ...]
    mass: float
    com: Constants
    axes: Matrix
    inertia: Constants


@dataclasses.dataclass(frozen=True)
class Softness:
    """MuJoCo's solver parameters of a constraint: solref, after `refsafe`, as stiffness k and damping b; solimp; the margin in m or rad."""

    stiffness: float
    damping: float
    impedance: tuple[float, float, float, float, float]
    margin: float


@dataclasses.dataclass(frozen=True)
class Contact:
    """A sphere that may touch the floor, z = 0. A capsule is two of them.

    body: index. center: in the body's frame. axis: of the capsule, along which MuJoCo aligns the friction directions, or None.
    weight: body_invweight0, the inverse mass seen by the contact, 1/kg.
    """

    body: int
    center: Constants
    axis: Constants | None
    radius: float
    friction: float
    weight: float
    softness: Softness


@dataclasses.dataclass(frozen=True)
class Limit:
    """Range of a hinge or slide. weight: dof_invweight0."""

    dof: int
    qpos: int
    low: float
    high: float
    weight: float
    softness: Softness


@dataclasses.dataclass(frozen=True)
class Carriers:
    """The part of the tree that moves contacts.

    root: the body of a free root, -1 where there is none; it is not among the following.
    bodies: (body, parent, places of its own degrees of freedom in `dofs`), parents first.
    dofs: degrees of freedom; per one of them body_of: its body, lengths: of its chain down to it,
      path_of: the place in `leaves` of a chain that it belongs to.
    leaves: the last degrees of freedom of chains that together hold all of `dofs`.
    contacts: (body, how many contacts it has), in the order of the contacts.
    """

    root: int
    bodies: tuple[tuple[int, int, tuple[int, ...]], ...]
    dofs: tuple[int, ...]
    body_of: tuple[int, ...]
    lengths: tuple[int, ...]
    path_of: tuple[int, ...]
    leaves: tuple[int, ...]
    contacts: tuple[tuple[int, int], ...]


@dataclasses.dataclass(frozen=True, eq=False)
class Structure:
    """All constants of a model.

    contacts: in the order of their bodies.

    body_chain: per body its degrees of freedom from the root, ancestors' included (its row pattern is the chain of the last of them).
    spring, spring_reference, damping, armature: [nv], linear in the joint's position and velocity.
    """

    bodies: tuple[Body, ...]
    pattern: Sparsity
    body_chain: tuple[tuple[int, ...], ...]
    dof_body: tuple[int, ...]
    dof_qpos: tuple[int, ...]
    spring: tuple[float, ...]
    spring_reference: tuple[float, ...]
    damping: tuple[float, ...]
    armature: tuple[float, ...]
    contacts: tuple[Contact, ...]
    limits: tuple[Limit, ...]
    gravity: Constants
    step: float
    impratio: float
    iterations: int
    line_iterations: int
    tolerance: float
    warm_start: bool
    carriers: Carriers


def read_structure(model: mujoco.MjModel) -> Structure:
    """Reads a model.

    Raises:
      UnsupportedModel: the fast physics does not know something the model uses.
    """
    contact_geoms = check_supported(model)
    chains = _body_chains(model)
    off = model.opt.disableflags
    flag = mujoco.mjtDisableBit
    gravity = (0.0, 0.0, 0.0) if off & flag.mjDSBL_GRAVITY else constants(model.opt.gravity)
    unconstrained = bool(off & flag.mjDSBL_CONSTRAINT)
    joints = model.dof_jntid
    bodies = tuple(_body(model, b) for b in range(1, model.nbody))
    pattern = sparsity([int(p) for p in model.dof_parentid])
    touching = [] if unconstrained or off & flag.mjDSBL_CONTACT else contact_geoms
    contacts = sorted((c for g in touching for c in _contacts(model, g)), key=lambda c: c.body)
    return Structure(
        bodies=bodies,
        pattern=pattern,
        body_chain=chains,
        dof_body=tuple(int(b) - 1 for b in model.dof_bodyid),
        dof_qpos=tuple(
            int(model.jnt_qposadr[j] + k - model.jnt_dofadr[j]) for k, j in enumerate(joints)
        ),
        spring=constants(model.jnt_stiffness[joints].reshape(-1)),
        spring_reference=constants(model.qpos_spring[[int(model.jnt_qposadr[j]) for j in joints]]),
        damping=constants(model.dof_damping),
        armature=constants(model.dof_armature),
        contacts=tuple(contacts),
        limits=() if unconstrained or off & flag.mjDSBL_LIMIT else _limits(model),
        gravity=gravity,
        step=float(model.opt.timestep),
        impratio=float(model.opt.impratio),
        iterations=int(model.opt.iterations),
        line_iterations=int(model.opt.ls_iterations),
        tolerance=float(model.opt.tolerance),
        warm_start=not off & flag.mjDSBL_WARMSTART,
        carriers=_carriers(bodies, pattern, contacts),
    )


def _carriers(bodies: tuple[Body, ...], pattern: Sparsity, contacts: Sequence[Contact]) -> Carriers:
    counts = Counter(contact.body for contact in contacts)
    moved: set[int] = set()
    for body in counts:
        while body >= 0:
            moved.add(body)
            body = bodies[body].parent
    trees = [b for b in moved if bodies[b].parent < 0]
    root = 0 if trees == [0] and [j.kind for j in bodies[0].joints] == [FREE] else -1
    rest = sorted(moved - {root})
    own = {b: [j.dof + n for j in bodies[b].joints for n in range(FREEDOMS[j.kind])] for b in rest}
    dofs = [k for b in rest for k in own[b]]
    above = 6 if root == 0 else 0
    leaf_of: dict[int, int] = {}
    for leaf in reversed(dofs):
        if leaf not in leaf_of:
            leaf_of |= {k: leaf for k in pattern.chains[leaf][above:] if k not in leaf_of}
    leaves = sorted(set(leaf_of.values()))
    return Carriers(
        root=root,
        bodies=tuple((b, bodies[b].parent, tuple(map(dofs.index, own[b]))) for b in rest),
        dofs=tuple(dofs),
        body_of=tuple(b for b in rest for _ in own[b]),
        lengths=tuple(len(pattern.chains[k]) - above for k in dofs),
        path_of=tuple(leaves.index(leaf_of[k]) for k in dofs),
        leaves=tuple(leaves),
        contacts=tuple(sorted(counts.items())),
    )


def _body_chains(model: mujoco.MjModel) -> tuple[tuple[int, ...], ...]:
    chains: list[tuple[int, ...]] = [()]
    for b in range(1, model.nbody):
        own = range(model.body_dofadr[b], model.body_dofadr[b] + model.body_dofnum[b])
        chains.append((*chains[model.body_parentid[b]], *(int(k) for k in own)))
    return tuple(chains[1:])


def _body(model: mujoco.MjModel, b: int) -> Body:
    joints = tuple(
        Joint(
            kind=int(model.jnt_type[j]),
            qpos=int(model.jnt_qposadr[j]),
            dof=int(model.jnt_dofadr[j]),
            axis=constants(model.jnt_axis[j]),
            anchor=constants(model.jnt_pos[j]),
            reference=float(model.qpos0[model.jnt_qposadr[j]]),
        )
        for j in range(model.body_jntadr[b], model.body_jntadr[b] + model.body_jntnum[b])
    )
    return Body(
        parent=int(model.body_parentid[b]) - 1,
        pos=constants(model.body_pos[b]),
        rot=columns(model.body_quat[b]),
        joints=joints,
        mass=float(model.body_mass[b]),
        com=constants(model.body_ipos[b]),
        axes=columns(model.body_iquat[b]),
        inertia=constants(model.body_inertia[b]),
    )


def softness(
    model: mujoco.MjModel, solref: np.ndarray, solimp: np.ndarray, margin: float
) -> Softness:
    """The parameters as MuJoCo's engine uses them (computation docs, "Parameters"; MJX `constraint._kbi`)."""
    time, ratio = (float(x) for x in solref)
    low, high, width, mid, power = (float(x) for x in solimp)
    smallest, largest = mujoco.mjMINIMP, mujoco.mjMAXIMP
    low, high, mid = (min(max(x, smallest), largest) for x in (low, high, mid))
    width, power = max(width, mujoco.mjMINVAL), max(power, 1.0)
    if time > 0 and not model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_REFSAFE:
        time = max(time, 2 * float(model.opt.timestep))
    stiffness = 1 / (high * time * ratio) ** 2 if time > 0 else -time / high**2
    damping = 2 / (high * time) if ratio > 0 else -ratio / high
    return Softness(stiffness, damping, (low, high, width, mid, power), float(margin))


def _contacts(model: mujoco.MjModel, pair: tuple[int, int]) -> list[Contact]:
    floor, geom = pair
    body = int(model.geom_bodyid[geom])
    friction, solref, solimp = _mixed(model, floor, geom)
    soft = softness(model, solref, solimp, model.geom_margin[floor] + model.geom_margin[geom])
    rot = np.array(columns(model.geom_quat[geom])).T
    capsule = int(model.geom_type[geom]) == int(mujoco.mjtGeom.mjGEOM_CAPSULE)
    half = model.geom_size[geom][1] * rot[:, 2]
    centers = (
        [model.geom_pos[geom] + half, model.geom_pos[geom] - half]
        if capsule
        else [model.geom_pos[geom]]
    )
    return [
        Contact(
            body=body - 1,
            center=constants(center),
            axis=constants(rot[:, 2]) if capsule else None,
            radius=float(model.geom_size[geom][0]),
            friction=float(friction),
            weight=float(model.body_invweight0[body, 0]),
            softness=soft,
        )
        for center in centers
    ]


def _mixed(model: mujoco.MjModel, a: int, b: int) -> tuple[float, np.ndarray, np.ndarray]:
    """Friction, solref and solimp of two geoms' contact (modeling docs, "Contact parameters")."""
    if model.geom_priority[a] != model.geom_priority[b]:
        chief = a if model.geom_priority[a] > model.geom_priority[b] else b
        return model.geom_friction[chief][0], model.geom_solref[chief], model.geom_solimp[chief]
    weight_a, weight_b = (float(model.geom_solmix[g]) for g in (a, b))
    tiny = mujoco.mjMINVAL
    if weight_a < tiny or weight_b < tiny:
        mix = 0.5 if weight_a < tiny and weight_b < tiny else float(weight_a >= tiny)
    else:
        mix = weight_a / (weight_a + weight_b)
    ref_a, ref_b = model.geom_solref[a], model.geom_solref[b]
    solref = (
        mix * ref_a + (1 - mix) * ref_b
        if ref_a[0] > 0 and ref_b[0] > 0
        else np.minimum(ref_a, ref_b)
    )
    solimp = mix * model.geom_solimp[a] + (1 - mix) * model.geom_solimp[b]
    return max(model.geom_friction[a][0], model.geom_friction[b][0]), solref, solimp


def _limits(model: mujoco.MjModel) -> tuple[Limit, ...]:
    return tuple(
        Limit(
            dof=int(model.jnt_dofadr[j]),
            qpos=int(model.jnt_qposadr[j]),
            low=float(model.jnt_range[j][0]),
            high=float(model.jnt_range[j][1]),
            weight=float(model.dof_invweight0[model.jnt_dofadr[j]]),
            softness=softness(model, model.jnt_solref[j], model.jnt_solimp[j], model.jnt_margin[j]),
        )
        for j in np.nonzero(model.jnt_limited)[0]
    )
