"""What a MuJoCo model contains for this step: supported elements, solver parameters, merged bodies.

A body without a joint needs no place in the equations. Robots have many: sensors, rotors, feet.
"""

import dataclasses
from collections.abc import Sequence
from typing import Any, TypeAlias

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from mjxgait.creature import geometry
from mjxgait.creature.overlap import Crossings
from mjxgait.errors import listed
from mjxgait.physics.derived import ObservationLayout

PLANE, SPHERE, CAPSULE = (
    int(t)
    for t in (
        mujoco.mjtGeom.mjGEOM_PLANE,
        mujoco.mjtGeom.mjGEOM_SPHERE,
        mujoco.mjtGeom.mjGEOM_CAPSULE,
    )
)
FREE, BALL = int(mujoco.mjtJoint.mjJNT_FREE), int(mujoco.mjtJoint.mjJNT_BALL)


class UnsupportedModel(Exception):
    """Error for a model that the lane-major physics does not support; the message says why."""


def check_supported(model: mujoco.MjModel) -> list[tuple[int, int]]:
    """Return the pairs (floor, geom) of geoms that may touch.

    Raises:
      UnsupportedModel: the lane-major physics does not support the model.
    """
    _check_options(model)
    _check_elements(model)
    _check_joints(model)
    return _contact_pairs(model)


def _refuse(when: ArrayLike, reason: str, names: Sequence[str] = ()) -> None:
    """Raise if `when` [n] holds anywhere, and list the names of the elements for which it holds."""
    if np.any(when):
        found = [name for name, guilty in zip(names, np.ravel(when), strict=False) if guilty]
        raise UnsupportedModel(f"{reason}: {listed(found, 3)}" if found else reason)


def _check_options(model: mujoco.MjModel) -> None:
    option, flag = model.opt, mujoco.mjtDisableBit
    off = option.disableflags
    _refuse(option.integrator != mujoco.mjtIntegrator.mjINT_EULER, "the integrator is not Euler")
    _refuse(option.solver != mujoco.mjtSolver.mjSOL_NEWTON, "the solver is not Newton")
    _refuse(option.cone != mujoco.mjtCone.mjCONE_PYRAMIDAL, "the friction cone is not pyramidal")
    _refuse(
        (model.dof_damping != 0) & (not off & flag.mjDSBL_EULERDAMP),
        "joints have damping and eulerdamp is on (disable it: damping is explicit)",
        _dof_names(model),
    )
    _refuse(off & (flag.mjDSBL_SPRING | flag.mjDSBL_DAMPER), "springs or dampers are disabled")
    _refuse(option.noslip_iterations, "noslip iterations")
    _refuse(option.wind, "wind")
    _refuse(
        option.enableflags & ~int(mujoco.mjtEnableBit.mjENBL_ENERGY),
        "an enable flag other than energy",
    )


def _check_elements(model: mujoco.MjModel) -> None:
    for name, count in {
        "actuators (joint torques are applied directly)": model.nu,
        "equality constraints": model.neq,
        "tendons": model.ntendon,
        "explicit contact pairs": model.npair,
        "mocap bodies": model.nmocap,
        "flexible bodies": model.nflex,
        "plugins": model.nplugin,
    }.items():
        _refuse(count, f"the model has {name}")
    _refuse(model.nv == 0, "nothing in the model can move")
    _refuse(model.body_gravcomp, "gravity compensation")
    _refuse(model.geom_fluid, "a geom has a fluid shape (only MuJoCo's inertia boxes are known)")
    for name in ("geom_adhesion", "geom_surfacevel"):
        _refuse(getattr(model, name, 0), f"a geom uses {name}")


def _check_joints(model: mujoco.MjModel) -> None:
    rotates = np.isin(model.jnt_type, (FREE, BALL))
    joints = [model.joint(j).name for j in range(model.njnt)]
    _refuse(model.jnt_limited.astype(bool) & rotates, "a ball joint has a limit", joints)
    _refuse(
        (model.jnt_stiffness.reshape(model.njnt, -1) != 0).any(axis=1) & rotates,
        "a ball or free joint has stiffness",
        joints,
    )
    _refuse(model.dof_frictionloss, "joints have dry friction (frictionloss)", _dof_names(model))
    _refuse(getattr(model, "jnt_stiffnesspoly", 0), "joints have nonlinear stiffness")
    _refuse(getattr(model, "dof_dampingpoly", 0), "joints have nonlinear damping")
    balls = np.nonzero(model.jnt_type == BALL)[0]
    _refuse(
        model.body_jntnum[model.jnt_bodyid[balls]] > 1,
        "a ball joint shares its body with another joint",
        [joints[j] for j in balls],
    )


def _dof_names(model: mujoco.MjModel) -> list[str]:
    """Joint of each degree of freedom."""
    return [model.joint(j).name for j in model.dof_jntid]


def _contact_pairs(model: mujoco.MjModel) -> list[tuple[int, int]]:
    pairs = []
    for a in range(model.ngeom):
        for b in range(a + 1, model.ngeom):
            if _may_touch(model, a, b):
                pair = (a, b) if model.geom_type[a] == PLANE else (b, a)
                _check_pair(model, *pair)
                pairs.append(pair)
    _refuse(len({floor for floor, _ in pairs}) > 1, "there are several floors")
    return pairs


def _check_pair(model: mujoco.MjModel, floor: int, geom: int) -> None:
    names = " and ".join(model.geom(g).name or f"geom {g}" for g in (floor, geom))
    _refuse(model.geom_type[floor] != PLANE, f"{names} can touch, and neither is a plane")
    _refuse(
        not _is_floor(model, floor),
        f"{names} can touch, and the plane is not the floor z = 0 of the world",
    )
    known = np.isin(model.geom_type[geom], (SPHERE, CAPSULE))
    _refuse(not known, f"{names} can touch: only spheres and capsules may touch the floor")
    condim, priority = model.geom_condim[[floor, geom]], model.geom_priority[[floor, geom]]
    chosen = max(condim) if priority[0] == priority[1] else condim[np.argmax(priority)]
    _refuse(chosen != 3, f"{names} touch with condim other than 3")
    _refuse(model.geom_gap[[floor, geom]], f"{names} touch with a gap")


def _is_floor(model: mujoco.MjModel, plane: int) -> bool:
    level = np.allclose(model.geom_quat[plane], (1, 0, 0, 0)) or np.allclose(
        model.geom_quat[plane][1:3], 0
    )
    return bool(model.geom_bodyid[plane] == 0 and model.geom_pos[plane][2] == 0 and level)


def _may_touch(model: mujoco.MjModel, a: int, b: int) -> bool:
    """MuJoCo's collision filter (computation docs, "Selection")."""
    if not (
        model.geom_contype[a] & model.geom_conaffinity[b]
        or model.geom_contype[b] & model.geom_conaffinity[a]
    ):
        return False
    body_a, body_b = sorted((int(model.geom_bodyid[a]), int(model.geom_bodyid[b])))
    weld_a, weld_b = model.body_weldid[body_a], model.body_weldid[body_b]
    if weld_a == weld_b or (body_a << 16) + body_b in set(model.exclude_signature):
        return False
    if (
        model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_FILTERPARENT
        or weld_a == 0
        or weld_b == 0
    ):
        return True
    parent_a, parent_b = (
        model.body_weldid[model.body_parentid[weld_a]],
        model.body_weldid[model.body_parentid[weld_b]],
    )
    return bool(weld_a != parent_b and weld_b != parent_a)


@dataclasses.dataclass(frozen=True)
class Softened:
    """Solver parameters of a constraint, as MuJoCo uses them.

    stiffness, damping: solref, after `refsafe`. impedance: solimp without its power: least, most,
    width in m or rad, midpoint. power: of solimp. margin: m or rad.
    """

    stiffness: float
    damping: float
    impedance: tuple[float, float, float, float]
    power: float
    margin: float


def contact_softness(model: mujoco.MjModel, floor: int, geom: int) -> Softened:
    """Softness of two geoms' contact."""
    _, solref, solimp = mixed(model, floor, geom)
    return softened(model, solref, solimp, model.geom_margin[floor] + model.geom_margin[geom])


def limit_softness(model: mujoco.MjModel, joint: int) -> Softened:
    """Softness of a joint's limit."""
    return softened(
        model, model.jnt_solref[joint], model.jnt_solimp[joint], model.jnt_margin[joint]
    )


def softened(
    model: mujoco.MjModel, solref: np.ndarray, solimp: np.ndarray, margin: float
) -> Softened:
    """Convert the parameters as MuJoCo's engine does.

    Computation docs, "Parameters"; `mujoco.mjx._src.constraint._kbi`.
    """
    time, ratio = (float(x) for x in solref)
    low, high, width, mid, power = (float(x) for x in solimp)
    smallest, largest = mujoco.mjMINIMP, mujoco.mjMAXIMP
    low, high, mid = (min(max(x, smallest), largest) for x in (low, high, mid))
    width, power = max(width, mujoco.mjMINVAL), max(power, 1.0)
    if time > 0 and not model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_REFSAFE:
        time = max(time, 2 * float(model.opt.timestep))
    stiffness = 1 / (high * time * ratio) ** 2 if time > 0 else -time / high**2
    damping = 2 / (high * time) if ratio > 0 else -ratio / high
    return Softened(stiffness, damping, (low, high, width, mid), power, float(margin))


def mixed(model: mujoco.MjModel, a: int, b: int) -> tuple[float, np.ndarray, np.ndarray]:
    """Combine friction, solref and solimp of two geoms (modeling docs, "Contact parameters")."""
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


class Fused:
    """Model with merged bodies; all but bodies and places of shapes reads as in the original.

    model: the original. carrier: [nbody] the body here that each original body is part of.
    kept: [n] the original bodies of those here, without the world.
    """

    def __init__(self, model: mujoco.MjModel, kept: np.ndarray) -> None:
        self.model, self.kept = model, kept
        self.carrier, place, turn = _carried(model, kept)
        self.nbody = len(kept) + 1
        rows = [0, *kept]
        self.body_jntadr, self.body_jntnum = model.body_jntadr[rows], model.body_jntnum[rows]
        parents = model.body_parentid[kept]
        self.body_parentid = np.append(0, self.carrier[parents])
        self.body_pos = model.body_pos[rows].copy()
        self.body_quat = model.body_quat[rows].copy()
        for i, (body, parent) in enumerate(zip(kept, parents, strict=True), 1):
            self.body_pos[i] = place[parent] + turn[parent] @ model.body_pos[body]
            self.body_quat[i] = _compose(turn[parent], model.body_quat[body])
        self.jnt_bodyid = self.carrier[model.jnt_bodyid]
        bodies = model.geom_bodyid
        self.geom_bodyid = self.carrier[bodies]
        self.geom_pos = place[bodies] + np.einsum("gij,gj->gi", turn[bodies], model.geom_pos)
        pairs = zip(bodies, model.geom_quat, strict=True)
        self.geom_quat = np.array([_compose(turn[b], quat) for b, quat in pairs])
        self.geom_invweight = model.body_invweight0[bodies, 0]
        self._weigh(place, turn)
        self.place, self.turn = place, turn

    def __getattr__(self, name: str) -> Any:
        return getattr(self.model, name)

    def body(self, place: int) -> Any:
        """Return MuJoCo's body, by its index here."""
        return self.model.body(int(np.append(0, self.kept)[place]))

    def _weigh(self, place: np.ndarray, turn: np.ndarray) -> None:
        """Masses, centres and moments of all that moves together."""
        model, rows = self.model, [0, *self.kept]
        self.body_mass = model.body_mass[rows].copy()
        self.body_ipos, self.body_iquat = (
            model.body_ipos[rows].copy(),
            model.body_iquat[rows].copy(),
        )
        self.body_inertia = model.body_inertia[rows].copy()
        for i in range(1, self.nbody):
            group = np.flatnonzero(self.carrier == i)
            heavy = group[model.body_mass[group] > 0]
            if len(group) == 1 or not len(heavy):
                continue
            mass = model.body_mass[heavy]
            centres = place[heavy] + np.einsum("bij,bj->bi", turn[heavy], model.body_ipos[heavy])
            centre = mass @ centres / mass.sum()
            tensor = np.zeros((3, 3))
            for b, m, c in zip(heavy, mass, centres - centre, strict=True):
                axes = turn[b] @ geometry.rotation(model.body_iquat[b])
                tensor += axes @ np.diag(model.body_inertia[b]) @ axes.T
                tensor += m * (c @ c * np.eye(3) - np.outer(c, c))
            moments, axes = np.linalg.eigh(tensor)
            axes[:, 2] = np.cross(axes[:, 0], axes[:, 1])
            self.body_mass[i], self.body_ipos[i] = mass.sum(), centre
            self.body_inertia[i], self.body_iquat[i] = moments, geometry.quaternion(axes)


Model: TypeAlias = Any
"""mujoco.MjModel | Fused"""


def fuse(
    model: mujoco.MjModel, layout: ObservationLayout, crossings: Crossings | None
) -> tuple[Model, ObservationLayout, Crossings | None]:
    """Merge the welded bodies; return all as it is if none is welded, or in a fluid.

    A fluid resists each body by itself.
    """
    bodies = np.arange(1, model.nbody)
    kept = bodies[(model.body_jntnum[1:] > 0) | (bodies == layout.trunk)]
    if len(kept) == len(bodies) or model.opt.density or model.opt.viscosity:
        return model, layout, crossings
    fused = Fused(model, kept)
    layout = dataclasses.replace(layout, trunk=int(fused.carrier[layout.trunk]))
    if crossings is None or not len(crossings.body):
        return fused, layout, crossings
    place, turn = fused.place[crossings.body], fused.turn[crossings.body]
    return (
        fused,
        layout,
        dataclasses.replace(
            crossings,
            body=fused.carrier[crossings.body],
            centre=place + np.einsum("sij,sj->si", turn, crossings.centre),
            half=np.einsum("sij,sj->si", turn, crossings.half),
        ),
    )


def geom_weights(model: Model, geoms: list[int]) -> np.ndarray:
    """Inverse mass [n] 1/kg that a contact of each geom sees."""
    if isinstance(model, Fused):
        return np.array(model.geom_invweight[geoms])
    return np.array(model.body_invweight0[model.geom_bodyid[geoms], 0])


def _carried(model: mujoco.MjModel, kept: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Find the carrier [nbody] of each body, and its pose there: [nbody, 3] m, [nbody, 3, 3]."""
    carrier = np.zeros(model.nbody, int)
    place, turn = np.zeros((model.nbody, 3)), np.tile(np.eye(3), (model.nbody, 1, 1))
    for body in range(1, model.nbody):
        if body in kept:
            carrier[body] = int(np.searchsorted(kept, body)) + 1
            continue
        parent = model.body_parentid[body]
        carrier[body] = carrier[parent]
        place[body] = place[parent] + turn[parent] @ model.body_pos[body]
        turn[body] = turn[parent] @ geometry.rotation(model.body_quat[body])
    return carrier, place, turn


def _compose(turn: np.ndarray, quat: np.ndarray) -> np.ndarray:
    """Turn a quaternion; without a turn its numbers stay the same."""
    return (
        quat
        if np.array_equal(turn, np.eye(3))
        else geometry.quaternion(turn @ geometry.rotation(quat))
    )
