"""What has to be said of a motion that is shown or exported: that nothing certifies it."""

from pathlib import Path

import numpy as np

from mjxgait.certify import outdated, read_certificate
from mjxgait.errors import UserError
from mjxgait.runs.folder import CERTIFICATE
from mjxgait.runs.own import command
from mjxgait.viewing.walk import Walk


def doubt(run: Path, walk: Walk) -> str:
    """Return in one line that the champion of a run is not certified, and why; empty if it is.

    walk: of this champion, as simulated just now.
    """
    reasons = [f"it falls after {walk.fell:.1f} s"] if np.isfinite(walk.fell) else []
    try:
        document = read_certificate(run / CERTIFICATE)
    except UserError as error:
        return f"Not certified: {'; '.join([*reasons, str(error)])}"
    if document is None:
        reasons.append(f"it has not been examined, which {command('certify', run, run=run)} does")
    elif old := outdated(document, walk.champion):
        reasons.append(old[0].lower() + old[1:].rstrip("."))
    elif document["passed"]:
        return ""
    else:
        failed = [c for c in document["criteria"] if not c["passed"]]
        names = ", ".join(f"{c['number']} {c.get('name', '')}".strip() for c in failed)
        reasons.append(f"it fails {'criterion' if len(failed) == 1 else 'criteria'} {names}")
    return f"Not certified: {'; '.join(reasons)}"
