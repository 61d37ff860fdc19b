"""Reads a `certificate.json` and a `stress.json` back and tells whether they are of the champion that
lies beside them.
"""

import json
from pathlib import Path
from typing import Any

from mjxgait.certify.certificate import schema_of
from mjxgait.champion import Champion
from mjxgait.creature import Creature
from mjxgait.errors import UserError
from mjxgait.ground.spec import FLAT


def read_certificate(path: Path) -> dict[str, Any] | None:
    """What `Certificate.to_json` wrote; None when there is no file.

    Raises:
      UserError: it is not a certificate.
    """
    return _read(path, "criteria", {"number", "passed", "measures"}, "certify")


def read_stress(path: Path, champion: Champion) -> dict[str, Any] | None:
    """What `Stress.document` says of this champion; None when there is no file, or it is of another
    one.

    Raises:
      UserError: it is no such file.
    """
    document = _read(path, "trials", {"name", "share", "passed"}, "stress")
    return document if document and document.get("champion") == champion.fingerprint else None


def _read(path: Path, parts: str, keys: set[str], command: str) -> dict[str, Any] | None:
    """A document with a verdict and a list of parts with these keys. command: that writes it."""
    if not path.exists():
        return None
    try:
        document: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
        whole = isinstance(document["passed"], bool) and all(
            keys <= set(part) for part in document[parts]
        )
    except (OSError, ValueError, KeyError, TypeError):
        whole = False
    if not whole:
        name = "a certificate" if command == "certify" else "what `mjxgait stress` writes"
        raise UserError(f"{path}: not {name}; `mjxgait {command} {path.parent}` writes it anew")
    return document


def outdated(document: dict[str, Any], champion: Champion, creature: Creature) -> str | None:
    """A sentence that says why a certificate does not count for this champion; None when it is of
    this one, of its task, and of the ground of this creature.

    Times of files tell nothing: copying a run, or writing the same champion once more, changes
    them.
    """
    if "champion" not in document:
        return "The certificate is outdated: it does not say which champion was examined, as those of earlier versions."
    if document["champion"] != champion.fingerprint:
        return (
            "The certificate is outdated: "
            "it was given to another champion than the one that is here now."
        )
    if (task := document.get("task")) != champion.task:
        return (
            f"The certificate is outdated: it was given for the task {task}, "
            f"the champion's is {champion.task}."
        )
    ground, here = document.get("report", {}).get("ground", FLAT), str(creature.terrain)
    if ground != here:
        return f"The certificate is outdated: it was given on {ground} ground, the run's is {here}."
    if document.get("schema") != schema_of(champion.task):
        return "The certificate is outdated: it was given under other rules than today's."
    return None
