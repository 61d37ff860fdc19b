"""Build folder: parts as STL, a bill of materials, a MuJoCo model, and a page that explains them."""

import csv
import io
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from mjxgait.files import write_bytes, write_text, writing
from mjxgait.hardware.design import GAP, MARGIN, PLASTIC, Block, Design, Hinge
from mjxgait.hardware.robot import STARTS, TURNED, Trial

PARTS, BILL, MODEL, PAGE = "parts", "bill.csv", "robot.xml", "README.md"
EVOLVED, DRIVEN, ROBOT = (
    "the evolved body at this scale",
    "the same with the robot's servos",
    "the robot",
)
"""Bodies that are tried, in words."""


def write_build(
    folder: Path, design: Design, model: str, trials: Mapping[str, Trial], others: Sequence[Trial]
) -> None:
    """Write the build folder. trials: by `EVOLVED` and the like. others: of perturbed starts.

    Raises:
      UserError: it cannot be written.
    """
    with writing(folder):
        (folder / PARTS).mkdir(parents=True, exist_ok=True)
        for one in design.blocks:
            for name, mesh in one.print.meshes.items():
                in_mm = mesh.copy().apply_scale(1000)
                write_bytes(folder / PARTS / _file(one, name), in_mm.export(file_type="stl"))
        write_text(folder / BILL, bill(design))
        write_text(folder / MODEL, model)
        write_text(folder / PAGE, page(design, trials, others))


def _file(one: Block, name: str) -> str:
    return f"{one.name}_{name}.stl"


def bill(design: Design) -> str:
    """Return the bill of materials as CSV: a row for each printed part, servo and ballast."""
    text = io.StringIO()
    rows = csv.writer(text, lineterminator="\n")
    rows.writerow(["item", "quantity", "mass_g_each", "for", "source"])
    for one in design.blocks:
        for name, mesh in one.print.meshes.items():
            grams = f"{1000 * PLASTIC * mesh.volume:.1f}"
            rows.writerow([_file(one, name), 1, grams, one.name, "printed, PLA, walls solid"])
    servos = {hinge.servo.name: hinge.servo for hinge in design.hinges}
    for name, count in sorted(Counter(hinge.servo.name for hinge in design.hinges).items()):
        users = " ".join(hinge.name for hinge in design.hinges if hinge.servo.name == name)
        rows.writerow([name, count, f"{servos[name].mass:g}", users, servos[name].source])
    for one in design.blocks:
        if one.ballast > 0:
            grams = f"{1000 * one.ballast:.1f}"
            rows.writerow(["ballast", 1, grams, one.name, "battery, boards and screws count"])
    return text.getvalue()


def page(design: Design, trials: Mapping[str, Trial], others: Sequence[Trial]) -> str:
    """Return the page of the build folder."""
    scale = design.scale
    sections = [
        f"# {design.walk.creature.title}, to build\n\n{summary(design, trials)}",
        f"## In the simulator\n\n{_tried(design, trials, others)}",
        f"## What stands in the way\n\n{_obstacles(design)}",
        f"## Scale\n\nLengths of the evolved body × {scale.length:.3f}, densities × "
        f"{scale.density:.2f}. With equal Froude numbers it moves alike: times × {scale.time:.3f}, "
        f"masses × {scale.mass:.4g}, torques × {scale.torque:.4g}. The brain runs on the evolved "
        f"body's clock, so {1 / scale.time:.2f} times as fast.",
        f"## Print\n\n{_prints(design)}",
        f"## Servos\n\n{_servos(design)}",
        f"## Masses\n\n{_masses(design)}",
        f"## Where similarity ends\n\n{_limits(design)}",
    ]
    return "\n\n".join(sections) + "\n"


def summary(design: Design, trials: Mapping[str, Trial]) -> str:
    """Return what the robot is and does, in two sentences."""
    mass = sum(one.mass for one in design.blocks)
    longest = 200 * max(part.half.max() for part in design.parts) * design.scale.length
    robot, evolved = trials[ROBOT], trials[EVOLVED]
    fate = "falls" if robot.fell else "does not fall"
    if not np.isfinite(robot.distance):
        fate = "blows up"
    return (
        f"{len(design.blocks)} blocks, the longest {longest:.0f} cm, {len(design.hinges)} servos, "
        f"{mass:.2f} kg. In the reference simulator it gets {robot.distance:.2f} m far in "
        f"{robot.seconds:.1f} s and {fate}; a similar body gets {evolved.distance:.2f} m far."
    )


def _obstacles(design: Design) -> str:
    """Return what keeps the robot from being built."""
    if not design.obstacles:
        return "Nothing that was checked."
    lines = [f"- {said}." for said in design.obstacles]
    if any("printed whole" in said for said in design.obstacles):
        lines.append("\nIn the simulator a block that is printed whole passes into its parent.")
    return "\n".join(lines)


def _tried(design: Design, trials: Mapping[str, Trial], others: Sequence[Trial]) -> str:
    """Return the results of the trials."""
    rows = [
        (
            name,
            f"{trial.speed:.3f}",
            f"{trial.distance:.2f}",
            f"{100 * trial.height:.1f}",
            "yes" if trial.fell else "no",
            f"{100 * trial.short:.0f}",
        )
        for name, trial in trials.items()
    ]
    heads = ("body", "speed, m/s", "distance, m", "leap, cm", "falls", "torques cut short, %")
    far = np.median(np.nan_to_num([trial.distance for trial in others]))
    fallen = sum(trial.fell for trial in others)
    return (
        f"C MuJoCo, {trials[ROBOT].seconds:.1f} s after it settled, in the motion of the champion's "
        f"own brain. A fall is criterion 1 of walking bodies.\n\n{_table(heads, rows)}\n\n"
        f"From {STARTS} starts with hinges up to {TURNED} rad off, the robot gets {far:.2f} m far "
        f"(median) and falls {fallen} of {len(others)} times. `{MODEL}` is its model: a motor's control is the share "
        "of its voltage."
    )


def _prints(design: Design) -> str:
    """Return the printed parts."""
    rows = []
    for one in design.blocks:
        part = design.parts[one.number]
        corners = one.print.solid.corners()
        assert corners is not None, "only blocks with a volume are designed"
        sides = " × ".join(f"{side:.0f}" for side in 1000 * np.ptp(corners, axis=0))
        files = ", ".join(_file(one, name) for name in one.print.meshes)
        on = "" if part.parent < 0 else f"part{part.parent}"
        place = " ".join(f"{x:.1f}" for x in 1000 * part.place * design.scale.length) if on else ""
        rows.append((files, sides, f"{100 * one.kept:.0f}", on, place, part.joint))
    heads = ("files", "mm", "of the block, %", "on", "at, mm in its axes", "joint")
    return (
        f"PLA, walls of {1000 * design.wall:g} mm without infill, units mm. The origin of a file is "
        "the joint to the part that it is on, of part0 its middle; the axes are the block's, and a "
        "joint's own angle 0 is as in the model. A block is cut where it would turn into the part "
        f"that it is on, {1000 * GAP:g} mm clear of it.\n\n{_table(heads, rows)}"
    )


def _servos(design: Design) -> str:
    """Return the servos."""
    heads = ("hinge", "servo", "in", "at, mm", "peak, N·m", "rms, N·m", "rad/s", "load", "turns, °")
    rows = [_servo_row(hinge) for hinge in design.hinges]
    chosen = {hinge.servo.name: hinge.servo for hinge in design.hinges}
    lines = [
        f"- {name}: {servo.stall:g} N·m at rest, {servo.fastest:.1f} rad/s without load, at "
        f"{servo.volts:g} V; {servo.mass:g} g; takes a {servo.drive} as a command. {servo.source}."
        for name, servo in sorted(chosen.items())
    ]
    return (
        "The lightest that gives torque and speed of the evolved walk; a load above 1 means that "
        "none does. The torque is that at the shaft.\n\n"
        f"{_table(heads, rows)}\n\n" + "\n".join(lines)
    )


def _servo_row(hinge: Hinge) -> tuple[str, ...]:
    """Return the row of a hinge."""
    at = "does not fit"
    if hinge.place is not None:
        at = " ".join(f"{x:.0f}" for x in 1000 * hinge.place.middle)
    least, most = np.degrees(hinge.angles)
    motion = hinge.motion
    numbers = (motion.peak, motion.rms, motion.fastest, hinge.load)
    figures = [f"{number:.2f}" for number in numbers]
    inside = f"part{hinge.carrier}"
    return (hinge.name, hinge.servo.name, inside, at, *figures, f"{least:.0f} to {most:.0f}")


def _masses(design: Design) -> str:
    """Return the masses of the blocks beside those of a similar body."""
    heads = ("block", "plastic, g", "servos, g", "ballast, g", "similar, g", "departs by, %")
    rows = []
    for one in design.blocks:
        grams = [one.plastic, one.servos, one.ballast, one.similar]
        departs = f"{100 * (one.mass / one.similar - 1):+.0f}"
        rows.append((one.name, *(f"{1000 * each:.0f}" for each in grams), departs))
    return (
        "The robot is as light as its heaviest block allows; ballast in the middle of the others "
        "keeps their masses in proportion. Battery, boards, cables and screws are in no mass: take "
        f"them out of the ballast.\n\n{_table(heads, rows)}"
    )


def _limits(design: Design) -> str:
    """Return what is not alike, or not designed."""
    said = [
        "A shell's mass is not spread as in a solid block, so its inertia differs; the model has it.",
        "The rotor's inertia behind a servo's gear is in no data sheet; the model has the evolved "
        "hinge's, which may be several times too small.",
        "Friction of gears, backlash and bending of the walls are not in the model. Its ground is "
        f"that of evolution, at this scale. A hinge of a cut block ends {np.degrees(MARGIN):.0f}° "
        "beyond the angles of the recorded motion.",
        "Horns, brackets, bearings, cables, battery and boards are not designed: a shell has room "
        "for its servo, its sides parallel to the block's, and no hole for the shaft.",
        "The brain needs the angle of each hinge and whether each block touches the ground (a "
        f"switch), every {design.walk.champion.settings.every} steps of the model.",
    ]
    return "\n".join(f"- {each}" for each in said)


def _table(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a table in Markdown."""
    lines = [heads, ["---"] * len(heads), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)
