"""Text of creature.toml: the guesses, each with its confidence beside it."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import tomli_w

from mjxgait.config.schema import Config
from mjxgait.config.tables import Table
from mjxgait.controllers.key_poses.config import unhurried
from mjxgait.creature.geometry import rotation
from mjxgait.importer.drive import Drive
from mjxgait.importer.notes import Confidence, Notes, one_line
from mjxgait.importer.standing import Candidate
from mjxgait.tasks.walk.config import WalkConfig
from mjxgait.tasks.walk.gaits import stride_limit

STARTS, ALIVE = 6, 6.0
"""Evaluated trials, and weight of staying up to the end, of bodies that must step to catch a fall.
"""
LATE, HASTY = 1, 8.0
"""Largest torque delay in control steps, which is what first fells such a body in its examination.
Weight of a hasty stride frequency, twice the default.
"""
BRISK = 1.2
"""Target speed of such a body in body lengths per second: slower, it has to stand on one foot."""
STRIDE = 0.7
"""Target stride length at that speed, in hip heights."""
LEAST = 0.5
"""Least stride length of the certificate in hip heights: a cycle of shorter strides is a buzz."""

LEAPING, RISES = 1.6, 8
"""Target hopping speed in body lengths per second of one-legged bodies, and hardening steps.

The rhythm is that of two-legged bodies. The disturbances grow in these steps as the body learns to
bear them. At the two-legged speed the hops are short, and with full disturbances at once it falls.
"""

WHIPPED = 4.0
"""Weight of swinging a foot too fast, in body lengths per √(g·h).

Most robots that fail a single criterion fail by the speed of their fastest part, a foot.
"""
MANY = 6
"""Hinges per leg above which few random poses stand.

For such robots falling forward would otherwise score better than standing.
"""
GENERATIONS = 150
"""Largest number of generations, twice the default."""
SMALLER = 0.03
"""Mutation step as a share of a joint's range, half of that on four feet."""
ENOUGH = 0.1
"""Margin with which a run may end in its first half: these bodies are hasty, so few reach 0.2."""

FLICKER, LEISURE = 2.0, 0.65
"""Weight of feet that lose the floor for moments, of characters on more than two feet: their mass
rests on small paws and hooves, which shake. And their target speed in body lengths per second: at
the usual one they gallop.
"""

GAIT = "gait"
"""Guess that a character walks as an animal of its number of feet does."""

Settings = dict[str, Any]
"""Tables of settings, as in creature.toml below `[train]`."""
Told = tuple[str, Confidence, str]
"""The choice, its confidence and its reason."""


def manner(
    steps: bool,
    legs: int,
    hinges: int,
    symmetric: bool,
    hip: float,
    length: float,
    mass: float,
    time_step: float,
    rotor: float,
    skeleton: bool,
    notes: Notes,
) -> Settings:
    """Return the table `[train]` of an imported creature, and report its reason.

    Args:
      steps: whether it must step to catch a fall. legs, hinges: their numbers. hip: m, height.
        length: m, of the body. mass: kg. time_step: s. rotor: kg m², the inertia of its typical
        motor. skeleton: whether it was made from one.
    """
    bounces = rotor > mass * hip**2
    if steps:
        settings, told = few_feet(legs, hip, length, mass, time_step)
    elif hinges > MANY * legs:
        settings, told = many_hinges(bounces, hip, length, time_step)
    else:
        settings, told = four_feet(bounces)
    if skeleton and not steps:
        settings["fitness"]["speed"] = LEISURE
        settings["fitness"]["weights"]["patter"] = FLICKER
        told = (f"{told[0]}; feet that flicker cost; {LEISURE:g} body lengths/s", *told[1:])
    notes.guess("train", *told)
    table: Settings = {"base": "other_starts", "examination": {"enough": ENOUGH}} | settings
    if not symmetric:
        table.setdefault("controller", {})["key_poses"] = 2 * Config().controller.key_poses
    return table


def four_feet(bounces: bool) -> tuple[Settings, Told]:
    """Settings of a body that stands on its feet; see `manner`.

    bounces: whether its motors are heavier to turn than all of it. A foot counts as down if it
    bears weight, because a foot near the floor need not. Other bodies learn more slowly with that
    rule.
    """
    fitness: Settings = {"weights": {"foot_speed": WHIPPED}}
    what = "other starts in each generation; small mutations; feet that swing too fast cost"
    why = "of what robots' joints do at random little stands, and much of it whips"
    if bounces:
        fitness["contact"] = 0.0
        what += "; feet are down that bear weight"
        why += ": its motors are heavier to turn than all of it"
    return {"fitness": fitness}, (what, "high", why)


def many_hinges(
    bounces: bool, hip: float, length: float, time_step: float
) -> tuple[Settings, Told]:
    """Settings of a body that stands on its feet, but in few poses of many; see `manner`."""
    settings, (what, _, _) = four_feet(bounces)
    settings["fitness"]["weights"] |= {"alive": ALIVE, "frequency": HASTY}
    settings["controller"] = {
        "interpolation": _unhurried(WalkConfig().speed, hip, length, time_step)
    }
    settings["evolution"] = {"sigma": SMALLER}
    what += f"; smaller ones, no haste; staying up counts {ALIVE:g}"
    why = f"with more than {MANY} hinges for each leg it falls in most poses, and learns to fall ahead"
    return settings, (what, "medium", why)


def few_feet(
    legs: int, hip: float, length: float, mass: float, time_step: float
) -> tuple[Settings, Told]:
    """Settings of a body that must step to catch a fall; see `manner`."""
    hertz = BRISK * length / (STRIDE * hip)
    calm = min(WalkConfig().frequency, hertz / stride_limit(mass))
    weights = {"alive": ALIVE, "frequency": HASTY}
    fitness: Settings = {"speed": BRISK, "frequency": round(calm, 2), "weights": weights}
    speed = f"{BRISK:g} body lengths/s in strides of {STRIDE:g} hip heights"
    if legs == 1:
        fitness |= {"speed": LEAPING, "hardening": RISES}
        weights["airborne"] = 0.0
        speed = f"{LEAPING:g} body lengths/s, in the air for free; disturbances that grow"
    settings = {
        "controller": {"interpolation": _unhurried(BRISK, hip, length, time_step)},
        # An undisturbed trial says little about robustness: evaluate all in all trials.
        "rollout": {"variety": GENERATIONS, "starts": STARTS, "promote": 1.0, "latency": LATE},
        "evolution": {"generations": GENERATIONS, "sigma": SMALLER},
        "fitness": fitness,
    }
    what = (
        f"{STARTS} starts, others in each of {GENERATIONS} generations at most, with torques up to {LATE} "
        f"step late; small mutations; staying up counts {ALIVE:g}, {speed}"
    )
    why = "on one foot or two it falls unless it walks: more disturbed starts, and first of all to stay up"
    return settings, (what, "medium", why)


def _unhurried(speed: float, hip: float, length: float, time_step: float) -> int:
    """Steps between poses that avoid too short strides at this speed in body lengths/s."""
    return unhurried(LEAST * hip / (speed * length), time_step)


def creature_toml(
    name: str,
    origin: str,
    best: Candidate,
    symmetric: bool,
    pairs: Mapping[str, tuple[str, int]],
    body_length: float | None,
    planar: bool,
    bones: Mapping[str, str],
    train: Table,
) -> str:
    """Return the text of creature.toml.

    Args:
      origin: the model file's name, in one line. best: the creature in its standing pose. pairs:
        stated mirror pairs, joint to partner and sign. body_length: m, None if the loader measures
        it. planar: whether its legs are in one plane and pass each other. bones: of a skeleton, by
        part. train: settings that differ from the defaults.
    """
    joints, drive, notes = best.kinematics.names, best.drive, best.notes
    root = best.kinematics.bodies[0]
    forward = rotation(root.quat).T @ [1.0, 0.0, 0.0]
    feet = [_quoted(geom) for foot in best.feet for geom in foot]
    remark = {
        guess.what: f"  # {guess.confidence}: {one_line(guess.reason)}" for guess in notes.guesses
    }
    about = f"imported from {origin}: {len(joints)} joints"
    lines = [
        f"# Made by `mjxgait import` from {origin}. The words after each guess say how sure it is; "
        "change what is wrong.",
        "# `mjxgait check` draws it. Mass, inertias, joint axes and positions in creature.xml are "
        f"those of {origin}.",
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
    lines += _rig(origin, bones)
    if gait := remark.get(GAIT):
        lines += ["[usual]", f'gait = "natural"{gait}', ""]
    lines += [*_corrections(drive), "[termination]", "min_up = 0.5", "height = [0.5, 1.5]"]
    heading, *settings = tomli_w.dumps({"train": train}).splitlines()
    lines += ["touch = true", "", heading + remark.get("train", ""), *settings, ""]
    return "\n".join(lines)


def _joints(joints: list[str], drive: Drive, remark: Mapping[str, str]) -> list[str]:
    """Lines of the common joint values and of each joint's own."""
    kp, kd, torque, ranges = (
        np.round(v, 4) for v in (drive.kp, drive.kd, drive.torque, drive.ranges)
    )
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
            "[stepping]  # low: likewise; two feet and less must step under a fall",
            f"ahead = {_table(drive.ahead)}",
            f"aside = {_table(drive.aside)}",
            f"turn = {_table(drive.turn)}",
            "",
        ]
    return lines


def _rig(origin: str, bones: Mapping[str, str]) -> list[str]:
    """Lines of a skeleton's bones by part; none for other models."""
    if not bones:
        return []
    rows = [f"{_quoted(part)} = {_quoted(bone)}" for part, bone in bones.items()]
    about = "# what each part is called in the file, for `mjxgait export --onto`"
    return ["[rig]", f"file = {_quoted(origin)}", "", f"[rig.bones]  {about}", *rows, ""]


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
