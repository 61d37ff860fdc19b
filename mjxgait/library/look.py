"""Looking at runs: their examination, and their motion as numbers."""

from pathlib import Path

import numpy as np

from mjxgait.certify import Certificate, CertificateConfig, certify
from mjxgait.errors import UserError
from mjxgait.library.run import Place, Run, open
from mjxgait.runs.exams import Exams
from mjxgait.runs.folder import EXAMS
from mjxgait.settings.tables import build, read_toml


def examine(run: Run | Place, config: Place | None = None) -> Certificate:
    """Examines the champion of a run in C MuJoCo, criterion by criterion; writes nothing.

    Args:
      config: TOML file with other thresholds (configs/certificate/default.toml shows all).

    Raises:
      UserError: no run, no champion, or a bad file.
    """
    known = run if isinstance(run, Run) else open(run)
    table = read_toml(Path(config)) if config else {}
    champion = known.champion
    attempt = Exams(known.folder / EXAMS).attempt(
        champion.fingerprint, int(champion.origin.get("generation", 0))
    )
    return certify(
        known.creature, champion, build(CertificateConfig, table, str(config)), attempts=attempt
    )


def walk(run: Run | Place, seconds: float = 12.0) -> dict[str, np.ndarray]:
    """The champion's undisturbed motion in C MuJoCo, as columns [T] for pandas or a plot.

    `time` s; `trunk_x`, `trunk_y`, `trunk_z` m, forward, left and up from the start; `pitch`,
    `roll` rad; per joint `pos_NAME` rad, `vel_NAME` rad/s, `torque_NAME` N·m; per foot
    `height_NAME` m, `force_NAME` N. It ends soon after a fall.

    Raises:
      UserError: no run or no champion.
    """
    from mjxgait.viewing.walk import record_walk

    known = run if isinstance(run, Run) else open(run)
    if not seconds > 0:
        raise UserError(f"seconds = {seconds}: must be more than zero")
    creature = known.creature
    seen = record_walk(creature, known.champion, seconds).recording
    columns = {"time": np.arange(len(seen.pitch)) * seen.time_step}
    columns |= {f"trunk_{axis}": seen.trunk_pos[:, i] for i, axis in enumerate("xyz")}
    columns |= {"pitch": seen.pitch, "roll": seen.roll}
    joints = {"pos": seen.joint_pos, "vel": seen.joint_vel, "torque": seen.torque}
    feet = {"height": seen.foot_height, "force": seen.foot_force}
    for names, values in ((creature.joints.names, joints), (creature.feet.names, feet)):
        columns |= {
            f"{what}_{name}": array[:, i]
            for what, array in values.items()
            for i, name in enumerate(names)
        }
    return columns
