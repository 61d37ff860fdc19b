"""A run's certificate as HTML: the verdict in short, and all measures."""

import html
import math
from collections.abc import Sequence
from pathlib import Path

from mjxgait.certification import (
    Lack,
    NoCertificate,
    ValidCertificate,
    Verdict,
    certificate_state,
    criteria_of,
    read_stress,
    stress_in_words,
)
from mjxgait.certification.advice import ADVICE
from mjxgait.certification.verdict import Document
from mjxgait.champion import Champion
from mjxgait.creature import Creature
from mjxgait.errors import UserError
from mjxgait.training.folder import CERTIFICATE, STRESS

CHECK = (
    "This page proves nothing by itself. Whoever has the run folder can have the champion examined "
    "again: <code>mjxgait inspect RUN --verify</code> compares every measure with the certificate "
    "and ends with exit code 0 only if all are equal."
)

TIGHTEST = 3
"""Number of measures in the summary."""
SIGNS = {">=": "≥", "<=": "≤"}


def certificate_summary(
    run: Path, creature: Creature, champion: Champion, fell: float = math.inf
) -> str:
    """Return the verdict, the margin, and the measures with the least room, as a paragraph.

    A champion without a valid certificate gets the reason. fell: s of its undisturbed walk,
    infinite if it stays up.

    Raises:
      UserError: the file is not a certificate.
    """
    state = _state(run, creature, champion)
    if isinstance(state, NoCertificate):
        falls = [f"it falls after {fell:.1f} s"] if math.isfinite(fell) else []
        way_out = "Examine it" if state.lack is Lack.MISSING else "Examine it again"
        return _uncertified([*falls, state.reason], way_out)
    verdict = state.verdict
    measures = [(c.skill, m) for c in criteria_of(state.document) for m in c.measures]
    nearest = sorted(measures, key=lambda pair: pair[1].margin)[:TIGHTEST]
    listed = "; ".join(
        f"{skill}{m.name} {_show(m.value)} ({SIGNS[m.sense]} {m.threshold:g})"
        for skill, m in nearest
    )
    worst = f" Margin {verdict.margin:.2f}." if math.isfinite(verdict.margin) else ""
    said = f"<b>{html.escape(_said(verdict))}</b>{worst}"
    return f'<p class="verdict">{said} Tightest: {html.escape(listed)}.</p>'


def _state(run: Path, creature: Creature, champion: Champion) -> ValidCertificate | NoCertificate:
    """State of the run's certificate.

    Raises:
      UserError: the file is not a certificate.
    """
    state = certificate_state(run / CERTIFICATE, champion, creature)
    if isinstance(state, NoCertificate) and state.lack is Lack.UNREADABLE:
        raise UserError(state.reason)
    return state


def _uncertified(reasons: Sequence[str], way_out: str) -> str:
    """Paragraph on a champion without a valid certificate."""
    said = html.escape(f"Not certified: {'; '.join(reasons)}.")
    return f'<p class="verdict"><b>{said}</b> {way_out} with <code>mjxgait certify RUN</code>.</p>'


def certificate_table(run: Path, creature: Creature, champion: Champion) -> str:
    """Return the criteria as a table, or the reason why there is none.

    Raises:
      UserError: the file is not a certificate.
    """
    state = _state(run, creature, champion)
    if isinstance(state, NoCertificate):
        if state.lack is Lack.MISSING:
            return "<p>Not examined: <code>mjxgait certify</code> does it.</p>"
        reason = html.escape(f"{state.reason[0].upper()}{state.reason[1:]}.")
        return f"<p>{reason} <code>mjxgait certify</code> examines this one.</p>"
    document, verdict = state.document, state.verdict
    rows = [
        [
            f"{c.number} {c.name}",
            m.name,
            _show(m.value),
            f"{m.sense} {m.threshold:g}",
            "pass" if m.passed else "fails",
        ]
        for c in criteria_of(document)
        for m in c.measures
    ]
    measured = table(("criterion", "measure", "value", "wanted", "verdict"), rows)
    said, advised = html.escape(_said(verdict)), _advice(document, verdict)
    folded = f"<details><summary>All measures</summary>{measured}</details>"
    return f"<p>{said}</p>{advised}{folded}{_anywhere(run, champion)}<p>{CHECK}</p>"


def _said(verdict: Verdict) -> str:
    """Verdict in one or two sentences."""
    said = "All criteria pass" if verdict.passed else "Not all criteria pass"
    if verdict.reservation:
        return f"Not certified. {said}, but {verdict.reservation}."
    return f"{said}."


def _advice(document: Document, verdict: Verdict) -> str:
    """What stood in the way and what to try, as a paragraph; empty for what passes."""
    said = [] if verdict.passed else document.get("report", {}).get(ADVICE, [])
    return f"<p>{html.escape(' '.join(said))}</p>" if said else ""


def _anywhere(run: Path, champion: Champion) -> str:
    """Table of the stress tests; empty if the champion has not taken them."""
    document = read_stress(run / STRESS, champion)
    if document is None:
        return ""
    verdict = html.escape(stress_in_words(document))
    rows = [
        [t["name"], f"{t['share']:.0%}", "pass" if t["passed"] else "fails"]
        for t in document["trials"]
    ]
    return f"<p>{verdict}</p>" + table(("stress test", "of the starts", "verdict"), rows)


def table(heading: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a table. Texts are escaped; `fails` is bold."""

    def cell(text: str) -> str:
        # Numbers align only in a table with a heading.
        kind = (
            ' class="fails"'
            if text == "fails"
            else ' class="number"'
            if heading and _is_number(text)
            else ""
        )
        return f"<td{kind}>{html.escape(text)}</td>"

    head = f"<tr>{''.join(f'<th>{html.escape(h)}</th>' for h in heading)}</tr>" if heading else ""
    body = "".join("<tr>" + "".join(map(cell, row)) + "</tr>" for row in rows)
    return f'<div class="wide"><table>{head}{body}</table></div>'


def _is_number(text: str) -> bool:
    try:
        return math.isfinite(float(text))
    except ValueError:
        return False


def _show(value: float) -> str:
    return "none" if math.isnan(value) else f"{value:.3g}"
