"""A walk as numbers for a robot: base, joints and contacts at every control step.

Letters: `T` control steps, `J` joints.
"""

import csv
import io
import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from mjxgait.files import write_text, writing
from mjxgait.rendering.walk import Walk

BASE = ("x", "y", "z", "qw", "qx", "qy", "qz")
"""Place in m and rotation of the trunk in the world, Z up."""


def export_motion(walk: Walk, path: Path) -> None:
    """Write the whole walk as .csv (columns) or .json (columns, gains and the loop).

    Raises:
      UserError: the file cannot be written.
    """
    columns = motion(walk)
    text = _csv(columns) if path.suffix.lower() == ".csv" else json.dumps(document(walk, columns))
    with writing(path):
        write_text(path, text)


def motion(walk: Walk) -> dict[str, np.ndarray]:
    """Return the columns [T] by name.

    `time` s; `base_*`, see `BASE`; for each joint `NAME_target` and `NAME_pos` rad (the target only
    of controllers that command angles), `NAME_vel` rad/s, `NAME_torque` N·m; for each foot
    `NAME_contact`, 0 or 1.
    """
    creature, film, seen = walk.creature, walk.trajectory, walk.recording
    columns = {"time": np.arange(len(walk.qpos)) * walk.time_step}
    columns |= {f"base_{name}": walk.qpos[:, i] for i, name in enumerate(BASE)}
    joints = {"target": film.target[0], "pos": seen.joint_pos, "vel": seen.joint_vel}
    joints["torque"] = seen.torque
    if not np.isfinite(film.target[0]).all():
        del joints["target"]
    for j, name in enumerate(creature.joints.names):
        columns |= {f"{name}_{what}": values[:, j] for what, values in joints.items()}
    contact = seen.contact.astype(int)
    columns |= {f"{n}_contact": contact[:, i] for i, n in enumerate(creature.feet.names)}
    return columns


def document(walk: Walk, columns: Mapping[str, np.ndarray]) -> dict[str, object]:
    """Return the columns with what a player needs to track them.

    `loop`: first step of a stride after the walk has settled, and first step of a later one; None
    without strides.
    """
    creature, gains, count = walk.creature, walk.creature.gains, len(walk.creature.joints.names)
    names = ("kp", "kd", "torque_limit")
    return {
        "creature": creature.name,
        "time_step": walk.time_step,
        "joints": list(creature.joints.names),
        **{name: np.broadcast_to(getattr(gains, name), count).tolist() for name in names},
        "loop": walk.steady_strides(1),
        "columns": {name: np.round(values, 6).tolist() for name, values in columns.items()},
    }


def _csv(columns: Mapping[str, np.ndarray]) -> str:
    text = io.StringIO()
    rows = csv.writer(text, lineterminator="\n")
    rows.writerow(columns)
    rows.writerows([f"{value:.6g}" for value in row] for row in zip(*columns.values(), strict=True))
    return text.getvalue()
