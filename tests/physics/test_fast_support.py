"""Models that lane-major physics rejects, and its messages."""

from typing import Any

import jax.numpy as jnp
import mujoco
import numpy as np
import pytest

from mjxgait.physics.derived import ObservationLayout
from mjxgait.physics.lane_major import UnsupportedModel, lane_major_plant
from mjxgait.physics.lane_major.lanes import sin_cos

FLAG = '<flag eulerdamp="disable"/>'
FOOT = '<geom name="foot" type="sphere" size="0.05" pos="0 0 -0.2" contype="0" conaffinity="1"/>'
HINGE = '<joint name="knee" axis="0 1 0"/>'


def _model(
    flag: str = FLAG,
    floor: str = "",
    foot: str = FOOT,
    joint: str = HINGE,
    more: str = "",
    **option: float,
) -> mujoco.MjModel:
    model = mujoco.MjModel.from_xml_string(f"""
    <mujoco>
      <option integrator="Euler" solver="Newton" cone="pyramidal">{flag}</option>
      <worldbody>
        <geom name="floor" type="plane" size="0 0 1" contype="1" conaffinity="0" {floor}/>
        <body name="trunk" pos="0 0 1">
          <freejoint/>
          <geom size="0.1" contype="0" conaffinity="0"/>
          <body name="shin">{joint}<geom size="0.03" contype="0" conaffinity="0"/>{foot}</body>
        </body>
      </worldbody>
      {more}
    </mujoco>""")
    for name, value in option.items():
        setattr(model.opt, name, value)
    return model


def _plant(model: mujoco.MjModel) -> None:
    lane_major_plant(model, ObservationLayout(1, np.array([7]), np.array([6]), np.array([1])))


def test_accepts_a_plain_creature() -> None:
    _plant(_model())


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"integrator": mujoco.mjtIntegrator.mjINT_IMPLICITFAST}, "integrator is not Euler"),
        ({"solver": mujoco.mjtSolver.mjSOL_CG}, "solver is not Newton"),
        ({"cone": mujoco.mjtCone.mjCONE_ELLIPTIC}, "cone is not pyramidal"),
        ({"wind": (1.0, 0.0, 0.0)}, "wind"),
        ({"flag": "", "joint": '<joint name="knee" damping="1"/>'}, "eulerdamp"),
        ({"joint": '<joint name="knee" frictionloss="1"/>'}, "dry friction"),
        (
            {"joint": '<joint name="knee" type="ball" range="0 60" limited="true"/>'},
            "ball joint has a limit",
        ),
        ({"joint": '<joint name="knee" type="ball" stiffness="1"/>'}, "stiffness"),
        ({"floor": 'quat="0.9 0.1 0 0"'}, "not the floor z = 0"),
        ({"floor": 'pos="0 0 0.1"'}, "not the floor z = 0"),
        (
            {"foot": FOOT.replace("sphere", "box").replace("0.05", ".1 .1 .1")},
            "floor and foot can touch: only spheres and capsules",
        ),
        (
            {"foot": FOOT.replace("/>", ' condim="1"/>'), "floor": 'condim="1"'},
            "condim other than 3",
        ),
        (
            {"foot": FOOT, "more": '<contact><pair geom1="floor" geom2="foot"/></contact>'},
            "explicit contact pairs",
        ),
        ({"more": '<actuator><motor joint="knee"/></actuator>'}, "actuators"),
        ({"more": '<equality><joint joint1="knee"/></equality>'}, "equality"),
    ],
)
def test_rejects_unsupported_models(changes: dict[str, Any], words: str) -> None:
    with pytest.raises(UnsupportedModel, match=words):
        _plant(_model(**changes))


def test_sine_and_cosine_are_exact_in_every_quadrant():
    angle = np.linspace(-20.0, 20.0, 4001, dtype=np.float32)
    sine, cosine = sin_cos(jnp.asarray(angle))
    np.testing.assert_allclose(sine, np.sin(angle.astype(float)), atol=3e-7)
    np.testing.assert_allclose(cosine, np.cos(angle.astype(float)), atol=3e-7)
