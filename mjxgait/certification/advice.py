"""What stood in the way of a certificate, and what to try, in at most three sentences."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

from mjxgait.certification.criteria import Criterion, Measure
from mjxgait.certification.feasibility import feasibility
from mjxgait.certification.remedies import TABLE, USUAL, Entry
from mjxgait.creature import Creature
from mjxgait.kinds import known_task

ADVICE = "advice"
"""Key of a report: these sentences; absent if all criteria passed."""
FELL_AFTER = "fell_after"
"""Key of a report: mean time in s of the falls from perturbed starts; absent if there were none."""


def advice(
    criteria: Sequence[Criterion],
    task: str,
    report: Mapping[str, Any],
    limits: Sequence[tuple[str, str]] = (),
) -> list[str]:
    """Return sentences on the main cause, on a second one, and on what to try; empty if passed.

    Args:
      report: of the certificate.
      limits: what the body itself lacks, each with its remedy; the first takes the place of the
        second cause and of the remedy.
    """
    failed = [(c, m) for c in criteria for m in c.measures if not m.passed]
    if not failed:
        return []
    found = sorted(((entry_of(c, m), m) for c, m in failed), key=_order)
    (first, worst), others = found[0], found[1:]
    cause = _cause(first, worst, report)
    if limits:
        return [cause, *limits[0]]
    # After a fall or without headway nothing else tells much; what repeats others never does.
    apart = [pair for pair in others if first.order == USUAL == pair[0].order]
    more = [said for said in (_cause(*pair, report) for pair in apart) if said != cause]
    return [cause, *more[:1], first.remedy_for(task)]


def advised(
    criteria: Sequence[Criterion], task: str, report: Mapping[str, Any], creature: Creature
) -> dict[str, list[str]]:
    """Return a report's entry with the advice; empty if all criteria passed."""
    if all(criterion.passed for criterion in criteria):
        return {}
    kind = known_task(task)
    limits = [] if kind and kind.modular else feasibility(creature).walk_limits
    return {ADVICE: advice(criteria, task, report, limits)}


def entry_of(criterion: Criterion, measure: Measure) -> Entry:
    """Return the entry on a measure; one made of its numbers if the task is the user's."""
    known = (entry for entry in TABLE if entry.fits(criterion, measure))
    most = "is needed" if measure.sense == ">=" else "is allowed"
    return next(known, Entry("*", f"Its {{name}} is {{v:.3g}}; {{t:.3g}} {most}."))


def _order(found: tuple[Entry, Measure]) -> tuple[int, float]:
    """Root causes first, then by margin; a measure without a value is the last of its kind."""
    entry, measure = found
    return entry.order, math.inf if math.isnan(measure.value) else measure.margin


def _cause(entry: Entry, measure: Measure, report: Mapping[str, Any]) -> str:
    if math.isnan(measure.value) and ("{v" in entry.words or "{rest" in entry.words):
        return f"Its {measure.name} could not be measured."
    return entry.cause(measure, report.get(FELL_AFTER))
