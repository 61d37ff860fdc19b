"""Walk targets in words: names for settings, as one layer of them (docs/guide/gaits.md)."""

import dataclasses
import re
from collections.abc import Mapping
from pathlib import Path

from mjxgait.certification import CertificateConfig
from mjxgait.config.layers import data_folder, over_base
from mjxgait.config.schema import Config
from mjxgait.config.tables import build, merge, not_none, read_toml
from mjxgait.controllers.key_poses.config import unhurried
from mjxgait.creature import Creature
from mjxgait.creature.geometry import lowest, posed
from mjxgait.errors import UserError, did_you_mean
from mjxgait.plugins.registry import resolve_config
from mjxgait.tasks.walk.criteria import SPARE
from mjxgait.tasks.walk.gaits import (
    AUTO,
    SHORTEST,
    animal_stride,
    gait_of,
)
from mjxgait.tasks.walk.textbook_start import (
    ORDERED,
    drawn,
    natural_gait,
    top_speed,
)

SPEED = re.compile(r"(?:fr)?[0-9]*\.?[0-9]+(?:e-?[0-9]+)?(?:bl/s|m/s)?")


@dataclasses.dataclass(frozen=True)
class WalkTargets:
    """Walk targets that a user requests.

    Attributes:
      speed: such as 0.4 (m/s), 0.4bl/s (body lengths per second), or fr0.2 (Froude number).
      gait: walk, amble, trot, pace, canter, bound, gallop, tripod, wave, hop, waddle, alternating,
        natural (an animal's at this speed, with its strides), or auto.
      turn: deg/s, to the left.
      steer: deg/s; the walk must obey turns to either side up to this rate.
      style: calm, sneaky, heavy, proud, tired, hurried, or a TOML file of settings.
      certificate: walks, or anywhere: trains on uneven ground under more disturbances, until the
        walk passes `mjxgait stress`.
    """

    speed: str | None = None
    gait: str | None = None
    turn: float | None = None
    steer: float | None = None
    style: str | None = None
    certificate: str | None = None

    @classmethod
    def of(cls, given: Mapping[str, object]) -> "WalkTargets":
        """Build the targets from the options that were given, as text or as values.

        Raises:
          UserError: a turn is no number.
        """
        values = not_none(**given)
        for name, value in values.items():
            if name not in TURNS:
                values[name] = str(value)
                continue
            try:
                values[name] = float(value)
            except ValueError:
                raise UserError(f"--{name} {value}: give degrees per second") from None
        return cls(**values)


NATURAL = "natural"
"""Gait of an animal at this speed, whatever its name."""
TURNS = ("turn", "steer")
LEVELS = ("walks", "anywhere")
TARGETS = tuple(field.name for field in dataclasses.fields(WalkTargets))


def configured(
    creature: Creature, file: Path | None, use: Mapping[str, str], targets: WalkTargets
) -> Config:
    """Return the settings of a run: the layers below the options, and the targets on top.

    Without targets and without a file, the creature's own default, `[usual]` in creature.toml,
    guides the search; the certificate does not demand it.

    Raises:
      UserError: names the layer and the key, or the target.
    """
    config = resolve_config(creature.settings.train, creature.name, file, use)
    walks = config.use.task == "walk" and config.use.controller == "poses"
    if targets != WalkTargets() or file is not None or not walks:
        return with_targets(config, creature, targets)
    try:
        guided = with_targets(config, creature, WalkTargets(gait=creature.settings.usual.gait))
    except UserError as error:
        raise UserError(f"{creature.name}/creature.toml: [usual]: {error}") from None
    free = dataclasses.replace(guided.fitness.wish, binding=not guided.fitness.wish.requested)
    return dataclasses.replace(guided, fitness=dataclasses.replace(guided.fitness, wish=free))


def with_targets(config: Config, creature: Creature, targets: WalkTargets) -> Config:
    """Return the settings overlaid with those that these targets stand for.

    Raises:
      UserError: names the target that means nothing, or not for this body.
    """
    if targets == WalkTargets():
        return config
    if config.use.task != "walk":
        raise UserError(
            f"--{', --'.join(TARGETS)} are for walking, and this is to {config.use.task}; "
            "leave them out"
        )
    if targets.style is not None:
        config = _styled(creature, config, targets.style)
    if targets.certificate is not None:
        config = _demanded(config, targets.certificate)
    table: dict[str, object] = {}
    for layer in (
        _pace(targets, creature, config),
        _turn("turn", targets.turn),
        _turn("steer", targets.steer),
    ):
        table = merge(table, layer)
    if config.use.controller != "poses":
        table = {"fitness": table.get("fitness", {})}
    return build(type(config), merge(dataclasses.asdict(config), table), "the walk targets")


def hint(config: Config) -> str | None:
    """Sentence on a `fitness.speed` too low for a walk to be certified; None if there is none.

    Such a `fitness.speed` is no target speed: it only limits up to where faster is better.
    """
    if config.use.task != "walk" or config.fitness.wish.speed is not None:
        return None
    least = SPARE * CertificateConfig().progress.speed
    if not 0 < config.fitness.speed < least:
        return None
    return (
        f"fitness.speed = {config.fitness.speed:g} says up to where faster is better, and no walk "
        f"below {least:g} body lengths/s is looked at; to have it walk so slowly ask with --speed "
        f"{config.fitness.speed:g}bl/s."
    )


def speed_of(text: str, creature: Creature) -> float:
    """Convert a speed in words to m/s.

    Raises:
      UserError: the text is no speed.
    """
    plain = text.strip().lower().replace(" ", "")
    if not SPEED.fullmatch(plain) or (plain.startswith("fr") and plain.endswith("/s")):
        raise UserError(
            f"--speed {text}: give m/s, such as 0.4, body lengths per second, 0.4bl/s, or a Froude "
            "number, fr0.2"
        )
    value = float(plain.removeprefix("fr").removesuffix("bl/s").removesuffix("m/s"))
    if not value > 0:
        raise UserError(f"--speed {text}: must be more than 0")
    if plain.startswith("fr"):
        return float((value * creature.gravity * creature.frame.hip_height) ** 0.5)
    return value * creature.frame.body_length if plain.endswith("bl/s") else value


def _pace(targets: WalkTargets, creature: Creature, config: Config) -> dict[str, object]:
    """Settings for speed and gait, and for a textbook cycle near which evolution begins."""
    requested, name = targets.speed, targets.gait or AUTO
    if requested is None and name == AUTO:
        return {}
    speed = top_speed(creature, config) if requested is None else speed_of(requested, creature)
    usual = natural_gait(creature, speed)
    wish = _natural(usual) if name == NATURAL else _named(name, creature)
    if requested is not None:
        wish = merge(wish, _speed(round(speed, 6), creature))
    begins = drawn(usual if name in (AUTO, NATURAL) else name, speed, creature, config)
    return merge(merge(wish, {"evolution": ORDERED}), begins)


def _speed(speed: float, creature: Creature) -> dict[str, object]:
    """Settings for a speed in m/s, with a cycle no shorter than the shortest stride at that speed.

    Ten steps from pose to pose, a fifth of a second for all four, let a gait of small movements
    repeat far too often.
    """
    shortest = SHORTEST * animal_stride(speed, creature.frame.hip_height) / speed
    steps = unhurried(shortest, float(creature.model.opt.timestep))
    return {"fitness": {"wish": {"speed": speed}}, "controller": {"interpolation": steps}}


def _natural(name: str) -> dict[str, object]:
    """Settings for an animal's footfalls, strides and duty factor, level, feet below the hips."""
    like = {"gait": name, "stride": 1.0, "duty_factor": 1.0, "reach": 0.0, "pitch": 0.0}
    return {"fitness": {"wish": like}}


def _named(name: str, creature: Creature) -> dict[str, object]:
    if name == AUTO:
        return {}
    try:
        gait = gait_of(name, len(creature.feet.names))
    except ValueError as error:
        raise UserError(f"--gait {name}: {creature.name}: {error}, and {NATURAL}") from None
    whole: dict[str, object] = {"mirror": False, "key_poses": 4, "in_phase": gait.together}
    wish = {"gait": name} | ({} if gait.sway is None else {"sway": gait.sway})
    return {"fitness": {"wish": wish}} | ({} if gait.twice else {"controller": whole})


def _turn(name: str, rate: float | None) -> dict[str, object]:
    if rate is None:
        return {}
    controller = {"tuning": {"steer": [0.0, 6.0]}, "steering": 3.0}
    return {"fitness": {"wish": {name: rate}}, "controller": controller}


def _styled(creature: Creature, config: Config, name: str) -> Config:
    """Return the settings overlaid with those of a style, no lower than the trunk can be.

    Raises:
      UserError: there is none of that name and no file, or it holds what is no setting.
    """
    folder = data_folder("configs") / "styles"
    known = [path.stem for path in folder.glob("*.toml")]
    if name not in known and Path(name).suffix != ".toml":
        raise UserError(f"--style {name}: {did_you_mean(name, known)}; or give a FILE.toml")
    path = folder / f"{name}.toml" if name in known else Path(name)
    table = merge(dataclasses.asdict(config), read_toml(path))
    styled = build(type(config), table, str(path))
    wish, least = styled.fitness.wish, lowest_height(creature)
    if wish.height is None or wish.height >= least:
        return styled
    raised = dataclasses.replace(wish, height=round(least, 3))
    return dataclasses.replace(styled, fitness=dataclasses.replace(styled.fitness, wish=raised))


def lowest_height(creature: Creature) -> float:
    """Trunk height, in standing heights, at which the level trunk lies on the floor.

    0 for a trunk without a shape that may touch it.
    """
    standing = posed(creature.model, creature.stand_qpos)
    free = lowest(creature.model, standing, creature.trunk) / creature.frame.stand_height
    return 1 - min(max(free, 0.0), 1.0)


def _demanded(config: Config, level: str) -> Config:
    """Return the settings overlaid with those for a level of the certificate.

    Raises:
      UserError: there is no such level.
    """
    if level not in LEVELS:
        raise UserError(f"--certificate {level}: {did_you_mean(level, LEVELS)}")
    if level == "walks":
        return config
    where = f"--certificate {level}"
    table = over_base({"base": level}, where)
    return build(type(config), merge(dataclasses.asdict(config), table), where)
