"""A robot to build from a champion with a grown body, as on the command line."""

from pathlib import Path

from mjxgait.api.exports import folder_of
from mjxgait.api.run import Place, Run
from mjxgait.errors import UserError
from mjxgait.files import path_of, writing
from mjxgait.kinds import title_of
from mjxgait.output import Tell, silent
from mjxgait.training.folder import is_taken

SECONDS = 20.0
"""Length of the recorded motion, and of each trial."""
TASKS = ("roam", "jump")
"""Tasks on land without a light: a robot has no eyes for it."""
LENGTHS, WALLS = (5.0, 100.0), (1.2, 10.0)
"""cm and mm; thinner walls do not print well, and are not stiff."""


def build(
    run: Run | Place,
    out: Place,
    *,
    length: float = 20.0,
    wall: float = 2.0,
    servos: Place | None = None,
    tell: Tell = silent,
) -> Path:
    """Write the parts, the bill of materials and the model of a robot; return the folder.

    Does the same as `mjxgait build`.

    Args:
      run: of a grown body that walks or jumps.
      out: a new folder.
      length: cm, of the longest side of all blocks.
      wall: mm, thickness of the printed walls.
      servos: a catalogue of servos (TOML); the shipped one by default.
      tell: called with what was written, and with what stands in the way.

    Raises:
      UserError: another kind of body or task, a value out of range, or the folder is not empty.
    """
    from mjxgait.hardware.design import designed, easier, longest_side
    from mjxgait.hardware.folder import DRIVEN, EVOLVED, ROBOT, summary, write_build
    from mjxgait.hardware.robot import (
        as_built,
        as_evolved,
        model_xml,
        perturbed,
        tried,
        with_servos,
    )
    from mjxgait.hardware.servos import CATALOGUE, read_catalogue
    from mjxgait.rendering.walk import record_walk
    from mjxgait.training.folder import open_champion

    folder, place = folder_of(run), path_of(out)
    _check_range("--length", length, LENGTHS, "cm")
    _check_range("--wall", wall, WALLS, "mm")
    catalogue = read_catalogue(CATALOGUE if servos is None else path_of(servos))
    if is_taken(place):
        raise UserError(f"{place}: holds something already; name another folder with --out")
    creature, champion = open_champion(folder)
    if champion.controller != "brain" or champion.task not in TASKS:
        raise UserError(
            f"{folder}: {creature.name} with the task {title_of(champion.task)}; a robot is built "
            "of a body that grew to walk or jump: mjxgait train blocks --task walk"
        )
    if champion.settings.touch:
        raise UserError(
            f"{folder}: its blocks feel each other (controller.touch), and a robot has no such "
            "sensors; evolve without"
        )
    with writing(place):
        place.mkdir(parents=True, exist_ok=True)
    walk = record_walk(creature, champion, SECONDS)
    design = designed(walk, length / 100, wall / 1000, catalogue)
    robot = as_built(design)
    bodies = {EVOLVED: as_evolved(design), DRIVEN: with_servos(design), ROBOT: robot}
    trials = {name: tried(design, body, SECONDS) for name, body in bodies.items()}
    model = model_xml(robot, walk.time_step)
    write_build(place, design, model, trials, perturbed(design, robot, SECONDS))
    tell(f"{place}: {summary(design, trials)}")
    for said in design.obstacles:
        tell(f"In the way: {said}")
    weak = any(hinge.load > 1 or hinge.place is None for hinge in design.hinges)
    if weak and (other := easier(design, catalogue)):
        size = 100 * other.scale.length * longest_side(other.parts)
        tell(f"Fewer in the way with --length {size:g}: {len(other.obstacles)}")
    return place


def _check_range(option: str, value: float, limits: tuple[float, float], unit: str) -> None:
    """Refuse a value out of range."""
    least, most = limits
    if not least <= value <= most:
        raise UserError(f"{option} {value:g}: give {least:g} to {most:g} {unit}")
