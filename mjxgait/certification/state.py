"""Whether a champion has a certificate that counts, and the reason if it has none."""

import dataclasses
import enum
from pathlib import Path

from mjxgait.certification.validity import outdated, read_certificate
from mjxgait.certification.verdict import Document, Verdict, verdict_of
from mjxgait.champion import Champion
from mjxgait.creature import Creature
from mjxgait.errors import UserError, clause


class Lack(enum.Enum):
    """Kind of reason why no certificate counts for a champion."""

    MISSING = enum.auto()
    UNREADABLE = enum.auto()
    OUTDATED = enum.auto()


@dataclasses.dataclass(frozen=True)
class NoCertificate:
    """No certificate counts for the champion. reason: as part of a sentence."""

    lack: Lack
    reason: str


@dataclasses.dataclass(frozen=True)
class ValidCertificate:
    """The certificate counts for the champion, which may have passed or failed."""

    document: Document
    verdict: Verdict


def certificate_state(
    path: Path, champion: Champion, creature: Creature
) -> ValidCertificate | NoCertificate:
    """Return what the file of a certificate, if there is one, says of this champion."""
    try:
        document = read_certificate(path)
    except UserError as error:
        return NoCertificate(Lack.UNREADABLE, str(error))
    if document is None:
        return NoCertificate(Lack.MISSING, "it has not been examined")
    if old := outdated(document, champion, creature):
        return NoCertificate(Lack.OUTDATED, clause(old))
    return ValidCertificate(document, verdict_of(document))
