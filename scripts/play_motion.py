"""Track an exported motion with PD control in MuJoCo, as a robot would: no other feedback.

    mjxgait export RUN --out motion.json
    python scripts/play_motion.py motion.json RUN/creature/creature.xml --seconds 5

Prints the distance that the trunk covers, and how far that is from the recording.
"""

import argparse
import json
from pathlib import Path

import mujoco
import numpy as np


def main() -> None:
    """Play a motion and print where it leads."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("motion", type=Path)
    parser.add_argument("model", type=Path)
    parser.add_argument("--seconds", type=float, default=5.0)
    options = parser.parse_args()
    motion = json.loads(options.motion.read_text(encoding="utf-8"))
    columns = {name: np.array(values) for name, values in motion["columns"].items()}
    kp, kd, limit = (np.array(motion[name]) for name in ("kp", "kd", "torque_limit"))
    model = mujoco.MjModel.from_xml_path(str(options.model))
    data, step = mujoco.MjData(model), motion["time_step"]
    joints = [model.joint(name) for name in motion["joints"]]
    at, of = (np.array([getattr(j, a)[0] for j in joints]) for a in ("qposadr", "dofadr"))
    base = np.stack([columns[f"base_{n}"] for n in ("x", "y", "z", "qw", "qx", "qy", "qz")], 1)
    target, begin = (
        np.stack([columns[f"{name}_{what}"] for name in motion["joints"]], 1)
        for what in ("target", "pos")
    )
    data.qpos[:7], data.qpos[at] = base[0], begin[0]
    # MuJoCo integrates joint damping implicitly, which keeps PD control stable
    # (docs/reference/controller.md).
    model.dof_damping[of] += kd
    for k in range(min(round(options.seconds / step), len(target) - 1)):
        torque = kp * (target[k] - data.qpos[at] - step * data.qvel[of])
        data.qfrc_applied[of] = np.clip(torque, -limit, limit)
        mujoco.mj_step(model, data)
    way, off = data.qpos[:3] - base[0, :3], np.linalg.norm(data.qpos[:3] - base[k + 1, :3])
    print(f"{np.linalg.norm(way[:2]):.2f} m in {data.time:.1f} s, {off:.2f} m from the recording")


if __name__ == "__main__":
    main()
