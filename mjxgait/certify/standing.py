"""Reads a `certificate.json` back and tells whether it is of the champion that lies beside it."""

import json
from pathlib import Path
from typing import Any

from mjxgait.certify.certificate import SCHEMA
from mjxgait.champion import Champion
from mjxgait.errors import UserError


def read_certificate(path: Path) -> dict[str, Any] | None:
    """What `Certificate.to_json` wrote; None when there is no file.

    Raises:
      UserError: it is not a certificate.
    """
    if not path.exists():
        return None
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
        whole = isinstance(document["passed"], bool) and all(
            {"number", "passed", "measures"} <= set(c) for c in document["criteria"]
        )
    except (OSError, ValueError, KeyError, TypeError):
        whole = False
    if not whole:
        raise UserError(
            f"{path}: not a certificate; `mjxgait certify {path.parent}` writes it anew"
        )
    return document


def outdated(document: dict[str, Any], champion: Champion) -> str | None:
    """A sentence that says why a certificate does not count for this champion; None when it is of
    this one.

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
    if document.get("schema") != SCHEMA:
        return "The certificate is outdated: it was given under other rules than today's."
    return None
