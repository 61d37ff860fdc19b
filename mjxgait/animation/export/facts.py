"""What an animation file states about its walk: gait, duty factor, certificate, footfalls.

Letters: `T` recorded frames of the loop, `N` feet.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from mjxgait.animation.export.footfalls import contacts
from mjxgait.animation.export.loop import WalkLoop
from mjxgait.certification import Lack, NoCertificate, certificate_state
from mjxgait.certification.describe import gait_name
from mjxgait.rendering.walk import Walk
from mjxgait.training.folder import CERTIFICATE

CONTACTS = "contacts"
UNEXAMINED = "not examined"
IN_WORDS = {
    Lack.MISSING: UNEXAMINED,
    Lack.UNREADABLE: "not certified: its certificate cannot be read",
    Lack.OUTDATED: "not certified: its certificate is outdated",
}


def facts_of(loop: WalkLoop, travelling: bool, units: float = 1.0) -> dict[str, object]:
    """The facts of a loop that files state. units: of the file, per m.

    A motion with a root that moves unevenly states its way instead of a speed.
    """
    facts: dict[str, object] = {
        "strides": loop.strides,
        "frames_per_s": loop.rate,
        "travelling": travelling,
        "scale": units,
    }
    if loop.path is None:
        facts["speed_m_per_s"] = units * loop.speed
    else:
        facts["way_m"] = units * loop.way
    return facts | ({"certificate": loop.certificate} if loop.certificate else {})


def measured_facts(
    loop: WalkLoop, travelling: bool, feet: Sequence[str], units: float = 1.0
) -> dict[str, object]:
    """The facts of a loop with what its recorded contacts say: footfalls, and of a loop the gait.

    feet: names of the feet [N] in the file.
    """
    facts = facts_of(loop, travelling, units) | (_gait(loop) if loop.strides else {})
    return facts | {CONTACTS: contacts(loop, feet)}


def _gait(loop: WalkLoop) -> dict[str, object]:
    """The gait's name and the mean duty factor; empty for a body without feet."""
    first, last = loop.frames
    window = loop.walk.recording
    carries = window.contact[first:last]
    if not carries.size:
        return {}
    duty = carries.mean(0)
    turn = np.exp(2j * np.pi * loop.strides * np.arange(len(carries)) / len(carries))
    middles = np.angle((carries * turn[:, None]).sum(0)) / (2 * np.pi)
    name = gait_name(window.dimensions, duty, (middles - middles[0]) % 1.0)
    return {"gait": name, "duty_factor": round(float(duty.mean()), 4)}


def examined(run: Path, walk: Walk) -> str:
    """Return the state of a run's certificate in a few words, such as "certified, margin 0.24".

    walk: of this champion, freshly simulated. `doubt` gives all reasons in a sentence.
    """
    if np.isfinite(walk.fell):
        return f"not certified: falls after {walk.fell:.1f} s"
    state = certificate_state(run / CERTIFICATE, walk.champion, walk.creature)
    if isinstance(state, NoCertificate):
        return IN_WORDS[state.lack]
    if not state.verdict.certified:
        return f"not certified: {state.verdict.in_words()}"
    return certified(state.verdict.margin)


def certified(margin: float) -> str:
    """Return the words for a walk that is certified."""
    return f"certified, margin {margin:.2f}"
