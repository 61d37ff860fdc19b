"""A small quadruped, champions for it, and a made-up good walk."""

import dataclasses

import numpy as np
from helpers import pose_champion

from mjxgait.controllers.config import DriveConfig
from mjxgait.controllers.key_poses.config import PoseConfig
from mjxgait.reference.measure import Dimensions, Recording

LEG = """
      <body name="{name}_upper" pos="{x} {y} 0">
        <joint name="{name}_hip" axis="0 1 0" range="-1.05 1.05"/>
        <geom type="capsule" size="0.02" fromto="0 0 0 0 0 -0.14" mass="0.3" contype="0" conaffinity="0"/>
        <body name="{name}_lower" pos="0 0 -0.14">
          <joint name="{name}_knee" axis="0 1 0" range="-1.4 1.4"/>
          <geom type="capsule" size="0.015" fromto="0 0 0 0 0 -0.14" mass="0.15" contype="0" conaffinity="0"/>
          <geom name="{name}_foot" type="sphere" size="0.025" pos="0 0 -0.14" mass="0.05" contype="0" conaffinity="1"/>
        </body>
      </body>"""

LEGS = {
    "front_left": (0.2, 0.11),
    "front_right": (0.2, -0.11),
    "hind_left": (-0.2, 0.11),
    "hind_right": (-0.2, -0.11),
}

XML = f"""
<mujoco>
  <compiler angle="radian"/>
  <option timestep="0.005" integrator="Euler" cone="pyramidal" solver="Newton"><flag eulerdamp="disable"/></option>
  <default><joint armature="0.01" damping="0.1" limited="false"/></default>
  <worldbody>
    <geom name="floor" type="plane" size="0 0 1" contype="1" conaffinity="0" friction="0.9 0.005 0.0001" priority="1"/>
    <body name="trunk" pos="0 0 0.305">
      <freejoint/>
      <geom name="trunk" type="box" size="0.25 0.08 0.05" mass="4" contype="0" conaffinity="1"/>
      {"".join(LEG.format(name=name, x=x, y=y) for name, (x, y) in LEGS.items())}
    </body>
  </worldbody>
  <keyframe><key name="stand" qpos="0 0 0.3035 1 0 0 0 {"0 " * 8}"/></keyframe>
</mujoco>
"""

TOML = """
[creature]
name = "tiny"
trunk = "trunk"
feet = ["front_left_foot", "front_right_foot", "hind_left_foot", "hind_right_foot"]

[joints]
kp = 60.0
kd = 2.0
torque_limit = 12.0
range = [-45, 45]

[steering]
bend = { "front_*_hip" = 0.5 }
stride = { "*_left_hip" = 1.0, "*_right_hip" = -1.0 }

[balance]
pitch = { "*_hip" = 1.0 }
roll = { "*_left_knee" = 1.0 }
"""

DRIVE = {field.name for field in dataclasses.fields(DriveConfig)}


def make_champion(creature, key_poses=None, tuning=None, **settings):
    """Champion that stands by default. settings: of the controller or the drive."""
    poses = np.stack([creature.joints.stand] * 2) if key_poses is None else key_poses
    drive = {name: settings.pop(name) for name in DRIVE & settings.keys()}
    return pose_champion(
        creature,
        poses,
        {"period": 0.6} | (tuning or {}),
        PoseConfig(key_poses=len(poses), **settings),
        DriveConfig(**drive),
    )


DOG = Dimensions(
    stand_height=0.4,
    hip_height=0.36,
    body_length=1.0,
    mass=20.0,
    gravity=9.81,
    torque_limit=(30.0,) * 4,
    joint_range=((-0.8, 0.5),) * 4,
    foot_names=tuple(LEGS),
    foot_places=tuple(LEGS.values()),
    partner=(1, 0, 3, 2),
)


def walk(
    period=0.8, speed=0.8, duty=0.6, lift=0.05, phases=(0.0, 0.5, 0.5, 0.0), seconds=22.0
) -> Recording:
    """Steady walk of a dog without physics: every number is a function of the phase."""
    time_step = 0.005
    time = np.arange(round(seconds / time_step)) * time_step
    phase = time / period
    foot_phase = (phase[:, None] + phases) % 1.0
    stance = foot_phase < duty
    swing = np.clip((foot_phase - duty) / (1 - duty), 0, 1)
    sway = 2 * np.pi * phase
    still = np.zeros_like(time)
    joint_phase = 2 * np.pi * (phase[:, None] + phases)
    return Recording(
        dimensions=DOG,
        time_step=time_step,
        trunk_pos=np.stack([speed * time, 0.01 * np.sin(sway), 0.4 + 0.01 * np.sin(2 * sway)], 1),
        trunk_up=np.full_like(time, 0.99),
        pitch=0.02 * np.sin(2 * sway),
        roll=0.02 * np.sin(sway),
        joint_pos=0.3 * np.sin(joint_phase),
        joint_vel=0.3 * 2 * np.pi / period * np.cos(joint_phase),
        torque=5.0 * np.cos(joint_phase),
        foot_force=np.where(stance, 20.0 * 9.81 / (4 * duty), 0.0),
        foot_slip=np.where(stance, 0.02, 0.0),
        foot_height=np.where(stance, -0.001, lift * np.sin(np.pi * swing)),
        touch=still.astype(bool),
        penetration=still + 0.001,
        body_speed=still + 2.0,
        overlap_pairs=(("trunk", "hind_left"), ("front_left", "hind_left")),
        overlap=np.zeros((len(time), 2)),
        heading=still,
    )
