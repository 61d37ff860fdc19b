"""Notice for a shown or exported motion without a valid certificate."""

from pathlib import Path

import numpy as np

from mjxgait.certification import judged, outdated, read_certificate
from mjxgait.errors import UserError
from mjxgait.rendering.walk import Walk
from mjxgait.training.folder import CERTIFICATE
from mjxgait.training.own import command


def doubt(run: Path, walk: Walk) -> str:
    """Return one line that gives the reasons why a run's champion is not certified; empty if it is.

    walk: of this champion, freshly simulated.
    """
    reasons = [f"it falls after {walk.fell:.1f} s"] if np.isfinite(walk.fell) else []
    try:
        document = read_certificate(run / CERTIFICATE)
    except UserError as error:
        return f"Not certified: {'; '.join([*reasons, str(error)])}"
    if document is None:
        reasons.append(f"it has not been examined, which {command('certify', run, run=run)} does")
    elif old := outdated(document, walk.champion, walk.creature):
        reasons.append(old[0].lower() + old[1:].rstrip("."))
    elif (verdict := judged(document)).certified:
        return ""
    elif failed := verdict.failed:
        names = ", ".join(f"{c.number} {c.name}".strip() for c in failed)
        reasons.append(f"it fails {'criterion' if len(failed) == 1 else 'criteria'} {names}")
    else:
        reasons.append(verdict.reservation or "its certificate has no criteria")
    return f"Not certified: {'; '.join(reasons)}"
