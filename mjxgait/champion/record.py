"""`champion.json`: one individual and everything that decides how it moves."""

import dataclasses
import hashlib
import json
import reprlib
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypedDict, Unpack

import numpy as np
import pydantic

from mjxgait.champion.serializers import Genome, serializer_of
from mjxgait.config.schema import Config
from mjxgait.config.tables import (
    STORED,
    Index,
    Number,
    Text,
    build,
    check,
)
from mjxgait.controllers.config import DriveConfig
from mjxgait.creature import Creature
from mjxgait.creature.proportions import grown, proportions
from mjxgait.errors import UserError
from mjxgait.files import DamagedFile, read_json, write_text

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

SCHEMA = 2
"""File version. Version 1 implied key poses and kept the drive in the controller settings."""

SOUGHT = ("around", "within", "in_phase", "expressions")
"""Settings of where the search starts; they do not affect how a champion moves."""
USUAL = {"steering": 1.0, "skills": 1, "skill": 0}
"""Settings added later, with the value implied before: older champions keep their fingerprint."""


class Scored(TypedDict):
    """Results of an individual: fitness, terms and origin of `Champion`."""

    fitness: float
    terms: Mapping[str, float]
    origin: Mapping[str, object]


@dataclasses.dataclass(frozen=True, eq=False)
class Champion:
    """An evolved individual.

    controller: name of its kind, as in `[use]`. genome: its arrays by name. settings: the
    controller's. task: the one it was evolved for. fitness and terms: as evolution scored it.
    origin: where it comes from (generation, seed, versions). sizes: factors of the parts that
    differ from the creature's, where bodies evolve. wish: targets of its walk, by name.
    pose_span: degrees, `evolution.pose_span` of its run; 0 leaves the pose ranges of creature.toml.
    """

    creature: str
    digest: str
    controller: str
    genome: Mapping[str, np.ndarray]
    settings: Any
    drive: DriveConfig
    task: str
    fitness: float
    terms: Mapping[str, float]
    origin: Mapping[str, Any]
    sizes: Mapping[str, float] = dataclasses.field(default_factory=dict)
    wish: Mapping[str, Any] = dataclasses.field(default_factory=dict)
    pose_span: float = 0.0

    @classmethod
    def of(
        cls, creature: Creature, config: Config, genome: Genome, **scored: Unpack[Scored]
    ) -> "Champion":
        """Return the individual with this genome in a run; scored: fitness, terms and origin."""
        genome, sizes = split_genome(genome)
        return cls(
            creature=creature.name,
            digest=creature.digest,
            controller=config.use.controller,
            genome=serializer_of(config.use.controller).settled(genome, creature),
            settings=config.controller,
            drive=config.drive,
            task=config.use.task,
            sizes={} if sizes is None else proportions(creature).by_part(sizes),
            wish=config.wish,
            pose_span=config.evolution.pose_span,
            **scored,
        )

    def embodied(self, creature: Creature) -> Creature:
        """Return its own body, made from the creature as its files describe it.

        Raises:
          UserError: its sizes are those of another creature.
        """
        serializer = serializer_of(self.controller)
        try:
            body = serializer.embodied(self.genome, self.settings, self.task, creature)
        except (LookupError, TypeError, ValueError, ArithmeticError) as error:
            raise UserError(
                f"the champion's genome is damaged: no body grows from it ({error}); take one of "
                "another generation"
            ) from None
        return grown(body, self.sizes).spanned(self.pose_span)

    @property
    def fingerprint(self) -> str:
        """Hash of everything that decides how it moves.

        Body, controller, genome and settings; not the fitness or the origin.
        """
        moves: dict[str, object] = {
            "creature": self.digest,
            "controller": self.controller,
            # As float64, which a file gives back: writing a champion keeps its fingerprint.
            "genome": {n: np.asarray(array, float).tolist() for n, array in self.genome.items()},
            "settings": {
                name: value
                for name, value in as_table(self.settings).items()
                if name not in SOUGHT and USUAL.get(name) != value
            },
            "drive": as_table(self.drive),
        }
        if self.sizes:
            moves["sizes"] = dict(self.sizes)
        if self.wish:
            moves["wish"] = dict(self.wish)
        if self.pose_span:
            moves["pose_span"] = self.pose_span
        return hashlib.sha256(json.dumps(moves, sort_keys=True).encode()).hexdigest()[:16]

    def check_finite(self, creature: Creature) -> None:
        """Refuse numbers that no joint can follow and that make MuJoCo warn at every step.

        Raises:
          UserError: names the first.
        """
        serializer_of(self.controller).check(self.genome, creature)


def split_genome(genome: Genome) -> tuple[dict[str, np.ndarray], np.ndarray | None]:
    """Return the controller's arrays by name, and the logarithms of the sizes [..., Z] or None.

    Only genomes of `controllers.base.Bodied` have sizes.
    """
    own = {n.removeprefix("plan."): a for n, a in genome.items() if n.startswith("plan.")}
    return (own, genome["sizes"]) if own else (dict(genome), None)


def as_table(settings: "Mapping[str, object] | DataclassInstance") -> dict[str, object]:
    """Return settings as a table; they are one already, or a dataclass."""
    return dict(settings) if isinstance(settings, Mapping) else dataclasses.asdict(settings)


def write_champion(champion: Champion, creature: Creature, path: Path) -> None:
    """Write the file atomically: it is either the old one or the new one."""
    gains = zip(
        creature.joints.names,
        creature.gains.kp,
        creature.gains.kd,
        creature.gains.torque_limit,
        strict=True,
    )
    serializer = serializer_of(champion.controller)
    document = {
        "schema": SCHEMA,
        "creature": champion.creature,
        "creature_digest": champion.digest,
        "task": champion.task,
        "controller": champion.controller,
        "genome": serializer.document(champion.genome, champion.settings, creature),
        "settings": as_table(champion.settings),
        "drive": as_table(champion.drive),
        "gains": {
            name: {"kp": float(kp), "kd": float(kd), "torque_limit": float(limit)}
            for name, kp, kd, limit in gains
            if not creature.settings.creature.grows
        },
        "fitness": champion.fitness,
        **({"sizes": dict(champion.sizes)} if champion.sizes else {}),
        **({"wish": dict(champion.wish)} if champion.wish else {}),
        **({"pose_span": champion.pose_span} if champion.pose_span else {}),
        "terms": dict(champion.terms),
        "origin": dict(champion.origin),
    }
    write_text(path, json.dumps(document, indent=2) + "\n")


class DamagedChampion(DamagedFile):
    """Error: the file exists but holds no champion."""


def _plain(values: Mapping[str, Any]) -> Mapping[str, Any]:
    """Check the targets of a walk: finite numbers, a speed above zero, the name of a gait."""
    for name, value in values.items():
        kind = str if name == "gait" else (int, float)
        if not isinstance(value, kind) or isinstance(value, bool):
            raise ValueError(f"{name} = {value!r} is no target of a walk")
        if name != "gait" and not np.isfinite(value):
            raise ValueError(f"{name} = {value!r} is not a finite number")
    if values.get("speed", 1.0) <= 0:
        raise ValueError(f"speed = {values['speed']!r}: must be above zero")
    return values


@dataclasses.dataclass(frozen=True)
class _Origin:
    """Schema of `origin`."""

    __pydantic_config__ = STORED
    versions: dict[str, Text] = dataclasses.field(default_factory=dict)


@dataclasses.dataclass(frozen=True)
class _File:
    """Schema of `champion.json`, except what depends on its controller."""

    __pydantic_config__ = STORED
    schema: Index
    creature: Text
    creature_digest: Text
    task: Text
    controller: Text
    genome: dict[str, Any]
    settings: dict[str, Any]
    drive: dict[str, Any]
    fitness: Number
    terms: dict[str, Number | None]
    origin: _Origin
    sizes: dict[str, Annotated[float, pydantic.Field(strict=True, ge=0.01, le=100)]] = (
        dataclasses.field(default_factory=dict)
    )
    wish: Annotated[dict[str, Any], pydantic.AfterValidator(_plain)] = dataclasses.field(
        default_factory=dict
    )
    pose_span: Annotated[float, pydantic.Field(strict=True, ge=0, le=360)] = 0.0


def read_champion(path: Path, creature: Creature) -> Champion:
    """Return the individual in a file, for the creature it was evolved on.

    Raises:
      UserError: the file is missing, damaged (`DamagedChampion`), or of another creature.
    """
    if not path.exists():
        raise UserError(f"{path}: no such file; the run has no champion yet")
    try:
        document = read_json(path)
        if isinstance(document, Mapping) and document.get("schema") == SCHEMA:
            check(_File, document, str(path), "nothing stands in its place")
        champion = _champion(document, creature, path)
        champion.check_finite(creature)
    except DamagedFile as error:
        message = str(error).removeprefix(f"{path}: ")
        raise DamagedChampion(f"{path}: damaged, or not a champion file ({message})") from None
    except UserError as error:
        message = str(error)
        raise UserError(message if str(path) in message else f"{path}: {message}") from None
    except (LookupError, TypeError, ValueError, AttributeError, ArithmeticError) as error:
        message = reprlib.repr(str(error))
        raise DamagedChampion(f"{path}: damaged, or not a champion file ({message})") from None
    return champion


def _champion(document: Mapping[str, Any], creature: Creature, path: Path) -> Champion:
    if document["schema"] != SCHEMA:
        raise UserError(
            f"{path}: written with schema {document['schema']}, this version reads {SCHEMA}; "
            "use the version that wrote it"
        )
    if document["creature_digest"] != creature.digest:
        raise UserError(
            f"{path}: evolved on another body than {creature.name} as it is now; use the run's "
            "own creature folder"
        )
    serializer = serializer_of(document["controller"])
    return Champion(
        creature=document["creature"],
        digest=document["creature_digest"],
        controller=document["controller"],
        genome=serializer.genome(document["genome"], creature),
        settings=serializer.settings(document["settings"], f"{path}: settings"),
        drive=build(DriveConfig, document["drive"], f"{path}: drive"),
        task=document["task"],
        fitness=document["fitness"],
        terms=document["terms"],
        origin=document["origin"],
        sizes={name: float(factor) for name, factor in document.get("sizes", {}).items()},
        wish=document.get("wish", {}),
        pose_span=float(document.get("pose_span", 0.0)),
    )
