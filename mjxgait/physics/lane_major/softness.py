"""Solver parameters of a constraint from the model's solref and solimp, as in MuJoCo's engine."""

import dataclasses

import mujoco
import numpy as np


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

    Computation docs, "Parameters"; MJX `constraint._kbi`.
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
