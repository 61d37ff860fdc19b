"""Champions examined, and their motion as numbers."""

import numpy as np

from mjxgait import certification
from mjxgait.api.make import load_creature
from mjxgait.api.run import Place, Run, opened
from mjxgait.certification import Certificate, CertificateConfig
from mjxgait.certification.validity import differences
from mjxgait.config.tables import build, read_toml
from mjxgait.creature.scale import at_step
from mjxgait.errors import UserError
from mjxgait.files import path_of, write_text
from mjxgait.training.disk import disk_errors
from mjxgait.training.exams import Exams
from mjxgait.training.folder import CERTIFICATE, EXAMS, command
from mjxgait.training.skill_runs import write_skill_runs

LONGEST = 600
"""Longest recorded motion in s."""


def certify(run: Run | Place, config: Place | None = None) -> Certificate:
    """Examine the champion of a run in C MuJoCo, and write `certificate.json` of the run.

    Does the same as `mjxgait certify RUN`. config: as for `examine`.

    Raises:
      UserError: no run, no champion, an invalid file, or the folder cannot be written.
    """
    known = opened(run)
    certificate, path = examine(known, config), known.folder / CERTIFICATE
    with disk_errors(path, "what was there before is as it was", "examine it again"):
        write_skill_runs(known.folder, known.champion, certificate)
        write_text(path, certificate.to_json())
    return certificate


def examine(run: Run | Place, config: Place | None = None) -> Certificate:
    """Examine the champion of a run in C MuJoCo, criterion by criterion; write nothing.

    Args:
      config: TOML file with other thresholds (configs/certificate/default.toml lists all).

    Raises:
      UserError: no run, no champion, or an invalid file.
    """
    known = opened(run)
    table = read_toml(path_of(config)) if config else {}
    champion = known.champion
    attempt = Exams(known.folder / EXAMS).attempt(
        champion.fingerprint, int(champion.origin.get("generation", 0))
    )
    return certification.certify(
        known.creature, champion, build(CertificateConfig, table, str(config)), attempts=attempt
    )


def verify(run: Run | Place) -> list[str]:
    """Return the differences between a second examination of a champion and its certificate.

    One phrase each; empty if all measures are equal (`validity.TOLERANCE`). The second
    examination uses the thresholds of the certificate. Writes nothing.

    Raises:
      UserError: no run, no champion, no certificate, or thresholds of another version.
    """
    known = opened(run)
    stored, path = known.certificate, known.folder / CERTIFICATE
    if stored is None:
        raise UserError(
            f"{path}: not there; {command('certify', known.folder, run=known.folder)} examines the "
            "champion"
        )
    config = build(CertificateConfig, stored.get("config", {}), str(path))
    return differences(
        stored, certification.certify(known.creature, known.champion, config).document()
    )


def examine_expressions(
    env: Place, file: Place, task: str | None = None, config: Place | None = None
) -> Certificate:
    """Examine a program that was written by hand (docs/reference/expressions.md); write nothing.

    Args:
      env: shipped creature, creature folder, or model file; its own settings set how often the
        expressions are evaluated and how the drive follows. file: contains one program. task: by
        default the creature's usual task. config: as for `examine`.

    Raises:
      UserError: a mistake, with its file and line.
    """
    from mjxgait.controllers.expressions.written import written_champion
    from mjxgait.plugins.fit import check_fit
    from mjxgait.tasks.walk.targets import WalkTargets, configured

    table = read_toml(path_of(config)) if config else {}
    thresholds = build(CertificateConfig, table, str(config))
    use = {"controller": "program"} | ({"task": task} if task else {})
    creature = load_creature(env)
    settings = configured(creature, None, use, WalkTargets())
    check_fit(creature, settings)
    creature = at_step(creature, settings.rollout.step).on(settings.rollout.ground)
    return certification.certify(
        creature, written_champion(creature, settings, path_of(file)), thresholds
    )


def walk(run: Run | Place, seconds: float = 12.0) -> dict[str, np.ndarray]:
    """Return the champion's undisturbed motion in C MuJoCo as columns [T], for pandas or a plot.

    `time` s; `trunk_x`, `trunk_y`, `trunk_z` m, forward, left and up from the start; `pitch`,
    `roll` rad; per joint `pos_NAME` rad, `vel_NAME` rad/s, `torque_NAME` N·m; per foot
    `height_NAME` m, `force_NAME` N. The motion ends soon after a fall.

    Raises:
      UserError: no run or no champion.
    """
    from mjxgait.rendering.walk import record_walk

    known = opened(run)
    if not 0 < seconds <= LONGEST:
        raise UserError(f"seconds = {seconds}: must be more than zero, and at most {LONGEST}")
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
