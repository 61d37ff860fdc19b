"""Joints of models that no shipped robot has: balls, names that clash, gains of a gram."""

import mujoco
import numpy as np

from mjxgait.importer.legs import limits_around
from mjxgait.importer.spec import _joint_names
from mjxgait.importer.write_toml import _rounded

CLASH = """
<mujoco>
  <worldbody>
    <body>
      <freejoint/>
      <geom size="0.1"/>
      <body><joint name="hip" type="ball"/><geom size="0.1"/>
        <body><joint name="hip_x"/><geom size="0.1"/>
          <body><joint name="root"/><geom size="0.1"/></body>
        </body>
      </body>
    </body>
  </worldbody>
</mujoco>
"""


def test_hinges_of_a_ball_joint_have_names_of_their_own():
    model = mujoco.MjModel.from_xml_string(CLASH)
    names = _joint_names(model, [1, 2, 3])
    assert names == {1: ["hip_x", "hip_y", "hip_z"], 2: ["hip_x_2"], 3: ["root_2"]}


def test_a_limb_without_hinges_has_no_bounds():
    low, high = limits_around(mujoco.MjModel.from_xml_string(CLASH), [], np.zeros(0))
    assert (low.shape, high.shape) == ((0,), (0,))


def test_gains_of_small_robots_are_not_rounded_away():
    assert _rounded(np.array([8.8123e-6, 0.00123456, 0.0, 12.345678])).tolist() == [
        8.812e-6,
        0.001235,
        0.0,
        12.3457,
    ]
