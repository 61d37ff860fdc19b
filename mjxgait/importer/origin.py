"""The character's file from which a creature was imported: where it was, and whether it still is."""

import dataclasses
import hashlib
from pathlib import Path

import tomli_w

from mjxgait.animation.clips.clip import read_bytes
from mjxgait.animation.clips.fbx import FBX
from mjxgait.config.tables import STRICT, build, parse_toml
from mjxgait.creature import Creature
from mjxgait.creature.creature import ORIGIN
from mjxgait.creature.settings import RigSettings
from mjxgait.errors import UserError

KINDS = (".glb", FBX)
"""Ends of files that a walk can be put onto."""


@dataclasses.dataclass(frozen=True)
class Origin:
    """The content of `character.toml`. path: of the file at its import. sha256: of its bytes."""

    __pydantic_config__ = STRICT
    path: str
    sha256: str


@dataclasses.dataclass(frozen=True)
class Found:
    """The character of a creature. file: None where there is none. note: what the user should know."""

    file: Path | None
    note: str = ""


def origin_files(path: Path, rig: RigSettings) -> dict[str, str]:
    """Return the text of `character.toml` by its name; empty unless it is a character.

    It is a file of its own, because the creature's digest must not depend on where its file lies.
    """
    place = str(path.resolve())
    if not rig.bones or path.suffix.lower() not in KINDS or not place.isprintable():
        return {}
    about = "# The file that `mjxgait export` puts the walk onto.\n"
    origin = Origin(place, digest_of(path))
    return {ORIGIN: about + tomli_w.dumps(dataclasses.asdict(origin))}


def digest_of(path: Path) -> str:
    """Return the SHA-256 of a file's bytes in hexadecimal digits; see `read_bytes` for errors."""
    return hashlib.sha256(read_bytes(path)).hexdigest()


def find_character(creature: Creature, run: Path) -> Found:
    """Find the file that a creature was imported from.

    It is where it was, or a file with its name and bytes lies in the current folder or in one that
    holds the run: projects move.

    Raises:
      UserError: `character.toml` is damaged.
    """
    rig = creature.settings.rig
    if not rig.bones or not rig.file.lower().endswith(KINDS):
        return Found(None)
    if ORIGIN not in creature.files:
        return Found(
            None,
            f"shows the body of capsules; --onto {rig.file} puts the walk onto your character",
        )
    origin = _parsed(creature.files[ORIGIN], str(run))
    first = Path(origin.path)
    for place in (first, *(folder / first.name for folder in (Path.cwd(), *run.resolve().parents))):
        if _digest(place) == origin.sha256:
            return Found(place)
    if _digest(first):
        return Found(first, f"{first} is not as it was when {creature.name} was imported from it")
    return Found(
        None,
        f"shows the body of capsules, because {first}, from which {creature.name} was imported, is "
        "not there; name the file with --onto",
    )


def _digest(path: Path) -> str:
    """Return the digest of a file; empty if it cannot be read."""
    try:
        return digest_of(path) if path.is_file() else ""
    except (OSError, UserError):
        return ""


def _parsed(text: str, where: str) -> Origin:
    try:
        return build(Origin, parse_toml(text, ORIGIN), ORIGIN)
    except UserError as error:
        raise UserError(
            f"{where}: {ORIGIN} is damaged ({error}); take that file away, or name the character "
            "with --onto"
        ) from None
