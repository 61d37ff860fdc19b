"""Parts of a model that shape its program: tree, slots for contacts and limits, solver.

Two models of equal topology differ in numbers only (`parameters`), so one program serves both.
Bodies are counted without the world, which is -1.
"""

import dataclasses
import functools

import mujoco
import numpy as np

from mjxgait.creature.overlap import Crossings
from mjxgait.physics.derived import ObservationLayout
from mjxgait.physics.lane_major.model import (
    CAPSULE,
    Fused,
    Model,
    check_supported,
    contact_softness,
    limit_softness,
)
from mjxgait.physics.lane_major.treematrix import (
    FREEDOMS,
    BodySlot,
    Carriers,
    ContactSlot,
    Ends,
    JointSlot,
    LimitSlot,
    Sparsity,
    WatchedSlot,
    find_carriers,
    sparsity,
)


@dataclasses.dataclass(frozen=True)
class Topology:
    """All of a model that is not a number.

    bodies, contacts (in the order of their bodies), limits, watched: the slots.
    dof_parent: [nv] parent of each degree of freedom, -1 for none.
    contact_power, limit_power: per slot, the power in MuJoCo's impedance.
    trunk: body. joint_qpos, joint_dof: [J] addresses of the actuated joints.
    bar_body: [S], first, second: [Q]; see `Crossings`.
    step: s. iterations, line_iterations: maxima of Newton's method and its line search.
    warm_start: whether the solver starts from the previous step's solution.
    water: whether a fluid resists. open_pairs: whether bars and pairs are numbers (`padded`).
    names: of the bodies, for messages only. moving: [B] their indices in the model.
    welded: whether they carry others.
    """

    bodies: tuple[BodySlot, ...]
    dof_parent: tuple[int, ...]
    contacts: tuple[ContactSlot, ...]
    limits: tuple[LimitSlot, ...]
    watched: tuple[WatchedSlot, ...]
    contact_power: tuple[float, ...]
    limit_power: tuple[float, ...]
    trunk: int
    joint_qpos: tuple[int, ...]
    joint_dof: tuple[int, ...]
    bar_body: tuple[int, ...]
    first: tuple[int, ...]
    second: tuple[int, ...]
    step: float
    iterations: int
    line_iterations: int
    warm_start: bool
    water: bool
    open_pairs: bool
    names: tuple[str, ...] = dataclasses.field(compare=False)
    moving: tuple[int, ...] = dataclasses.field(compare=False)
    welded: bool = dataclasses.field(compare=False)

    @functools.cached_property
    def joints(self) -> tuple[JointSlot, ...]:
        """Joints of all bodies, in their order."""
        return tuple(joint for body in self.bodies for joint in body.joints)

    @functools.cached_property
    def dof_body(self) -> tuple[int, ...]:
        """[nv] body that each degree of freedom moves."""
        return tuple(
            b
            for b, body in enumerate(self.bodies)
            for joint in body.joints
            for _ in range(FREEDOMS[joint.kind])
        )

    @functools.cached_property
    def dof_qpos(self) -> tuple[int, ...]:
        """[nv] position address of a slide or hinge; meaningless for other joints."""
        return tuple(joint.qpos + n for joint in self.joints for n in range(FREEDOMS[joint.kind]))

    @functools.cached_property
    def pattern(self) -> Sparsity:
        """Sparsity of the mass matrix."""
        return sparsity(self.dof_parent)

    @functools.cached_property
    def carriers(self) -> Carriers:
        """Part of the tree that moves contacts."""
        return find_carriers(self.bodies, self.pattern, self.contacts)


def read_topology(model: Model, layout: ObservationLayout, crossings: Crossings | None) -> Topology:
    """Read a model's topology, with what `layout` senses and the pairs in `crossings`.

    Raises:
      UnsupportedModel: the lane-major physics does not support something that the model uses.
    """
    ends, limited = contact_ends(model), limited_joints(model)
    pairs = crossings if crossings is not None and len(crossings.first) else None
    return Topology(
        bodies=tuple(_body(model, b) for b in range(1, model.nbody)),
        dof_parent=integers(model.dof_parentid),
        contacts=tuple(
            ContactSlot(int(model.geom_bodyid[end.geom]) - 1, bool(end.side)) for end in ends
        ),
        limits=tuple(
            LimitSlot(int(model.jnt_dofadr[j]), int(model.jnt_qposadr[j])) for j in limited
        ),
        watched=tuple(
            WatchedSlot(int(model.geom_bodyid[g]) - 1, int(model.geom_type[g]))
            for g in layout.watched
        ),
        contact_power=tuple(contact_softness(model, e.floor, e.geom).power for e in ends),
        limit_power=tuple(limit_softness(model, j).power for j in limited),
        trunk=layout.trunk - 1,
        joint_qpos=integers(layout.qpos_adr),
        joint_dof=integers(layout.dof_adr),
        bar_body=() if pairs is None else integers(np.asarray(pairs.body) - 1),
        first=() if pairs is None else integers(pairs.first),
        second=() if pairs is None else integers(pairs.second),
        step=float(model.opt.timestep),
        iterations=int(model.opt.iterations),
        line_iterations=int(model.opt.ls_iterations),
        warm_start=not model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_WARMSTART,
        water=bool(model.opt.density or model.opt.viscosity),
        open_pairs=False,
        names=tuple(model.body(b).name or f"body {b}" for b in range(1, model.nbody)),
        moving=integers(model.kept - 1)
        if isinstance(model, Fused)
        else tuple(range(model.nbody - 1)),
        welded=isinstance(model, Fused),
    )


def contact_ends(model: Model) -> list[Ends]:
    """Find the spheres that may touch the floor, in the order of their bodies; a capsule is two."""
    touching = check_supported(model.model if isinstance(model, Fused) else model)
    flag = mujoco.mjtDisableBit
    if model.opt.disableflags & (flag.mjDSBL_CONSTRAINT | flag.mjDSBL_CONTACT):
        return []
    ends = [
        Ends(floor, geom, side)
        for floor, geom in touching
        for side in ((1, -1) if int(model.geom_type[geom]) == CAPSULE else (0,))
    ]
    return sorted(ends, key=lambda end: int(model.geom_bodyid[end.geom]))


def limited_joints(model: Model) -> list[int]:
    """Find the hinges and slides that have a limit."""
    flag = mujoco.mjtDisableBit
    if model.opt.disableflags & (flag.mjDSBL_CONSTRAINT | flag.mjDSBL_LIMIT):
        return []
    return [int(j) for j in np.nonzero(model.jnt_limited)[0]]


def joints_of(model: Model, body: int) -> range:
    """Return the joints of a body, by MuJoCo's numbers."""
    first = int(model.body_jntadr[body])
    return range(first, first + int(model.body_jntnum[body]))


def integers(values: np.ndarray) -> tuple[int, ...]:
    """Convert values to a tuple of Python integers."""
    return tuple(int(value) for value in values)


def _body(model: Model, b: int) -> BodySlot:
    joints = (
        JointSlot(int(model.jnt_type[j]), int(model.jnt_qposadr[j]), int(model.jnt_dofadr[j]))
        for j in joints_of(model, b)
    )
    return BodySlot(int(model.body_parentid[b]) - 1, tuple(joints))
