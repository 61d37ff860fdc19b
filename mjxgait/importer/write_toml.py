"""Text of creature.toml: the guesses, each with its confidence beside it."""

from collections.abc import Mapping

import numpy as np
import tomli_w

from mjxgait.config.tables import Table
from mjxgait.creature.geometry import rotation
from mjxgait.creature.settings import RigSettings
from mjxgait.importer.drive import Drive
from mjxgait.importer.notes import one_line
from mjxgait.importer.standing import Candidate

FINE = 0.005
"""Gains below this are written with four digits instead of four decimals."""
GAIT = "gait"
"""Guess that a character walks as an animal of its number of feet does."""


def creature_toml(
    name: str,
    best: Candidate,
    symmetric: bool,
    pairs: Mapping[str, tuple[str, int]],
    body_length: float | None,
    planar: bool,
    rig: RigSettings,
    train: Table,
) -> str:
    """Return the text of creature.toml.

    Args:
      best: the creature in its standing pose. pairs: stated mirror pairs, joint to partner and
        sign. body_length: m, None if the loader measures it. planar: whether its legs are in one
        plane and pass each other. rig: the model file, and the bones of a skeleton. train: settings
        that differ from the defaults.
    """
    joints, drive, notes = best.kinematics.names, best.drive, best.notes
    root = best.kinematics.bodies[0]
    forward = rotation(root.quat).T @ [1.0, 0.0, 0.0]
    feet = [_quoted(geom) for foot in best.feet for geom in foot]
    remark = {
        guess.what: f"  # {guess.confidence}: {one_line(guess.reason)}" for guess in notes.guesses
    }
    about = f"imported from {rig.file}: {len(joints)} joints"
    lines = [
        f"# Made by `mjxgait import` from {rig.file}. The words after each guess say how sure it "
        "is; change what is wrong.",
        "# `mjxgait check` draws it. Mass, inertias, joint axes and positions in creature.xml are "
        f"those of {rig.file}.",
        "[creature]",
        f"name = {_quoted(name)}",
        f"description = {_quoted(about)}",
        f"trunk = {_quoted(root.name)}{remark.get('trunk', '')}",
        f"forward = {[round(float(v), 6) + 0.0 for v in forward]}{remark.get('forward', '')}",
        f"feet = [{', '.join(feet)}]{remark.get('feet', '')}",
        'keyframe = "stand"',
    ]
    if body_length is not None:
        lines.append(f"body_length = {body_length:.4g}{remark.get('body_length', '')}")
    if planar:
        lines.append("planar = true  # high: its legs are drawn in one plane, and pass each other")
    lines += ["", *_joints(joints, drive, remark), *_mirror(symmetric, pairs, remark)]
    lines += _rig(rig)
    if gait := remark.get(GAIT):
        lines += ["[usual]", f'gait = "natural"{gait}', ""]
    lines += [*_corrections(drive), "[termination]", "min_up = 0.5", "height = [0.5, 1.5]"]
    heading, *settings = tomli_w.dumps({"train": train}).splitlines()
    lines += ["touch = true", "", heading + remark.get("train", ""), *settings, ""]
    return "\n".join(lines)


def _rounded(gains: np.ndarray) -> np.ndarray:
    """Round to four decimals, and those that this would spoil to four digits."""
    digits = np.array([float(f"{gain:.4g}") for gain in gains])
    return np.where(np.abs(gains) < FINE, digits, np.round(gains, 4))


def _joints(joints: list[str], drive: Drive, remark: Mapping[str, str]) -> list[str]:
    """Lines of the common joint values and of each joint's own."""
    kp, kd, torque = (_rounded(v) for v in (drive.kp, drive.kd, drive.torque))
    ranges = np.round(drive.ranges, 4)
    lines = [
        "[joints]",
        f"kp = {_usual(kp)}{remark.get('kp, kd', '')}",
        f"kd = {_usual(kd)}",
        f"torque_limit = {_usual(torque)}{remark.get('torque_limit', '')}",
        "range = [-40, 40]",
        "",
    ]
    for j, joint in enumerate(joints):
        low, high = (round(float(v), 1) for v in ranges[j])
        lines += [
            "[[joint]]",
            f"match = {_quoted(joint)}",
            f"range = [{low}, {high}]  # low: what it does: {drive.role[j]}",
        ]
        if torque[j] != _usual(torque):
            lines.append(f"torque_limit = {float(torque[j])}")
        if kp[j] != _usual(kp) or kd[j] != _usual(kd):
            lines += [f"kp = {float(kp[j])}", f"kd = {float(kd[j])}"]
        lines.append("")
    return lines


def _mirror(
    symmetric: bool, pairs: Mapping[str, tuple[str, int]], remark: Mapping[str, str]
) -> list[str]:
    lines = ["[mirror]", f"symmetric = {str(symmetric).lower()}{remark.get('mirror', '')}"]
    rows = [
        f"    {{ joint = {_quoted(a)}, partner = {_quoted(b)}, sign = {sign} }},"
        for a, (b, sign) in pairs.items()
    ]
    return [*lines, *(["pairs = [", *rows, "]"] if rows else ["pairs = []"]), ""]


def _corrections(drive: Drive) -> list[str]:
    """Lines of the weights for steering, balance and stepping."""
    lines = [
        "[steering]  # low: from which way each joint moves its foot",
        f"bend = {_table(drive.bend)}",
        f"stride = {_table(drive.stride)}",
        "",
        "[balance]  # low: likewise",
        f"pitch = {_table(drive.pitch)}",
        f"roll = {_table(drive.roll)}",
        "",
    ]
    if drive.ahead or drive.aside:
        lines += [
            "[stepping]  # low: likewise; two feet and less, and narrow bodies, step under a fall",
            f"ahead = {_table(drive.ahead)}",
            f"aside = {_table(drive.aside)}",
            f"turn = {_table(drive.turn)}",
            "",
        ]
    if drive.swing:
        rows = [
            f"{_quoted(arm)} = {{ leg = {_quoted(leg)}, share = {share} }}"
            for arm, (leg, share) in drive.swing.items()
        ]
        lines += ["[swing]  # medium: arms swing with the leg of the other side", *rows, ""]
    return lines


def _rig(rig: RigSettings) -> list[str]:
    """Lines of a skeleton's bones by part; none for other models."""
    if not rig.bones:
        return []
    rows = [f"{_quoted(part)} = {_quoted(bone)}" for part, bone in rig.bones.items()]
    about = "# what each part is called in the file, for `mjxgait export --onto`"
    lines = ["[rig]", f"file = {_quoted(rig.file)}", "", f"[rig.bones]  {about}", *rows, ""]
    if rig.turned:
        lines.append("[rig.turned]  # w, x, y, z from the file's rest to hanging arms")
        lines += [f"{_quoted(part)} = {list(quat)}" for part, quat in rig.turned.items()]
        lines.append("")
    return lines


def _usual(values: np.ndarray) -> float:
    """Most common value."""
    found, counts = np.unique(values, return_counts=True)
    return float(found[counts.argmax()])


def _quoted(text: str) -> str:
    """Quote a text as TOML does; unlike JSON, it allows no lone surrogates and no raw 0x7f."""
    return tomli_w.dumps({"_": text}).removeprefix("_ = ").removesuffix("\n")


def _table(weights: dict[str, float]) -> str:
    return (
        "{ " + ", ".join(f"{_quoted(k)} = {v}" for k, v in weights.items()) + " }"
        if weights
        else "{}"
    )
