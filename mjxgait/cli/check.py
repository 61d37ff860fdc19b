"""`mjxgait check`: validate a creature folder and draw it."""

import dataclasses
from collections.abc import Sequence
from pathlib import Path

import tyro

from mjxgait.cli.options import parsed
from mjxgait.errors import UserError
from mjxgait.files import replaced, writing
from mjxgait.training.disk import require_writable


@dataclasses.dataclass(frozen=True)
class CheckOptions:
    """Validate a creature folder, predict whether it can walk, and draw the creature.

    It stands for two seconds; strength, reach and room for strides are computed. The picture marks
    its feet, axes and mirror pairs.

    Attributes:
      env: Creature folder, name of a shipped creature, model file, or robot:NAME.
      out: The picture; by default <name>-check.png in the current folder.
    """

    env: tyro.conf.Positional[str]
    out: Path | None = None


def check_command(arguments: Sequence[str]) -> int:
    """Return the exit code: 1 for a creature that is valid but does not stand."""
    options = parsed(CheckOptions, "check", arguments)
    # JAX takes a second to import.
    from mjxgait.api import load_creature
    from mjxgait.certification.check_body import check_body
    from mjxgait.certification.feasibility import feasibility
    from mjxgait.creature import load_creature as load_folder
    from mjxgait.importer.portrait import facts, portrait
    from mjxgait.importer.stand_test import stand_test
    from mjxgait.physics import fallback_note
    from mjxgait.tasks.walk.targets import WalkTargets, configured

    folder = Path(options.env)
    creature = load_folder(folder) if folder.is_dir() else load_creature(options.env, tell=print)
    configured(creature, None, {}, WalkTargets())
    grows = creature.settings.creature.grows
    if not grows:
        check_body(creature)

    out = options.out or Path(f"{creature.name}-check.png")
    if out.suffix.lower() != ".png":
        raise UserError(f"{out}: the picture is a PNG; name it something.png")
    require_writable(out)
    held = stand_test(creature)
    print("\n".join(facts(creature, held)))
    if not grows:
        print("\n".join(feasibility(creature).lines()))
    if note := fallback_note(creature.evolution_model):
        print(note)
    with writing(out), replaced(out) as beside:
        portrait(creature).save(beside)
    print(f"wrote {out}")
    if held.stands:
        return 0
    print("It does not stand; correct the keyframe in creature.xml, or kp in creature.toml.")
    return 1
