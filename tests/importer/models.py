"""Two small animals that tests import, and their import.

An MJCF quadruped with what real files hold, and a URDF biped.
"""

from functools import reduce
from pathlib import Path

from mjxgait.api.bodies import write_folder
from mjxgait.creature import Creature, load_creature
from mjxgait.importer import ImportChoices, Imported, import_model

LEG = """
      <body name="{n}_thigh" pos="{x} {y} 0">
        <joint name="{n}_hip" type="hinge" axis="0 1 0" range="-60 60"/>
        <geom type="capsule" fromto="0 0 0 0.05 0 -0.15" size="0.02"/>
        <body name="{n}_shin" pos="0.05 0 -0.15">
          <joint name="{n}_knee" type="hinge" axis="0 1 0" range="-70 70"/>
          <geom type="cylinder" fromto="0 0 0 -0.05 0 -0.16" size="0.015"/>
        </body>
      </body>"""
CORNERS = {"fl": (0.2, 0.1), "fr": (0.2, -0.1), "hl": (-0.2, 0.1), "hr": (-0.2, -0.1)}
ROLL = '<joint name="{n}_roll" axis="1 0 0" range="-40 40"/>'
"""A second hinge at the hip, which swings the leg sideways."""
LEGS = "".join(LEG.format(n=n, x=x, y=y) for n, (x, y) in CORNERS.items())
QUADRUPED = f"""<mujoco model="quad">
  <compiler angle="degree"/>
  <option solver="PGS" integrator="implicit" density="1.2" viscosity="0.00002" timestep="0.002"/>
  <default><geom density="600" friction="1 0.1 0.1"/></default>
  <asset><texture name="t" type="2d" builtin="flat" width="8" height="8"/><material name="m" texture="t" rgba="1 0 0 1"/></asset>
  <worldbody>
    <light pos="0 0 3"/>
    <geom name="ground" type="plane" size="5 5 1"/>
    <body name="torso" pos="0 0 0.35">
      <camera name="eye"/>
      <geom type="box" size="0.25 0.08 0.05" material="m"/>
      <site name="imu"/>{LEGS}
      <body name="head" pos="0.3 0 0.1">
        <joint name="neck" axis="0 1 0" range="-20 20"/>
        <geom type="sphere" size="0.06"/>
      </body>
    </body>
  </worldbody>
  <actuator><motor joint="fl_hip" ctrlrange="-1 1" ctrllimited="true" gear="20"/></actuator>
  <sensor><gyro site="imu"/></sensor>
</mujoco>
"""

ROLLING = reduce(
    lambda text, n: text.replace(hip := f'<joint name="{n}_hip"', ROLL.format(n=n) + hip),
    CORNERS,
    QUADRUPED,
)

LINK = """
  <link name="{name}">
    <inertial><origin xyz="0 0 {com}"/><mass value="{mass}"/><inertia ixx="{i}" ixy="0" ixz="0" iyy="{i}" iyz="0" izz="{i}"/></inertial>
    <visual><geometry><mesh filename="package://biped/meshes/{name}.dae"/></geometry></visual>
    <collision><origin xyz="{at}"/><geometry><box size="{box}"/></geometry></collision>
  </link>"""
HINGE = """
  <joint name="{name}" type="revolute">
    <parent link="{parent}"/><child link="{child}"/><origin xyz="{xyz}"/><axis xyz="{axis}"/>
    <limit lower="-1.2" upper="1.2" effort="40" velocity="10"/>
  </joint>"""


def _biped() -> str:
    parts = [LINK.format(name="trunk", com=0.1, mass=6, i=0.06, at="0 0 0.15", box="0.15 0.25 0.3")]
    for side, y in (("left", 0.09), ("right", -0.09)):
        parts += [
            LINK.format(
                name=f"{side}_thigh",
                com=-0.12,
                mass=1.2,
                i=0.008,
                at="0 0 -0.12",
                box="0.06 0.06 0.2",
            ),
            LINK.format(
                name=f"{side}_shin",
                com=-0.12,
                mass=0.8,
                i=0.006,
                at="0 0 -0.12",
                box="0.05 0.05 0.2",
            ),
            LINK.format(
                name=f"{side}_foot",
                com=-0.02,
                mass=0.5,
                i=0.001,
                at="0.03 0 -0.03",
                box="0.2 0.1 0.03",
            ),
            HINGE.format(
                name=f"{side}_hip_roll",
                parent="trunk",
                child=f"{side}_hip",
                xyz=f"0 {y} 0",
                axis="1 0 0",
            ),
            f'<link name="{side}_hip"><inertial><mass value="0.3"/>'
            '<inertia ixx="1e-3" ixy="0" ixz="0" iyy="1e-3" iyz="0" izz="1e-3"/></inertial></link>',
            HINGE.format(
                name=f"{side}_hip_pitch",
                parent=f"{side}_hip",
                child=f"{side}_thigh",
                xyz="0 0 0",
                axis="0 1 0",
            ),
            HINGE.format(
                name=f"{side}_knee",
                parent=f"{side}_thigh",
                child=f"{side}_shin",
                xyz="0 0 -0.25",
                axis="0 1 0",
            ),
            HINGE.format(
                name=f"{side}_ankle",
                parent=f"{side}_shin",
                child=f"{side}_foot",
                xyz="0 0 -0.25",
                axis="0 1 0",
            ),
        ]
    return f'<?xml version="1.0"?>\n<robot name="biped">{"".join(parts)}\n</robot>\n'


BIPED = _biped()


def bring(folder: Path, text: str, kind: str = "xml", **choices) -> tuple[Creature, Imported]:
    file = folder / f"model.{kind}"
    file.write_text(text, encoding="utf-8")
    imported = import_model(file, ImportChoices(apart=False, **choices))
    write_folder(folder / "mine", imported)
    return load_creature(folder / "mine"), imported


def told(imported: Imported, words: str) -> bool:
    return words in imported.notes.text()
