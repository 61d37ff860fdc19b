"""Examination of a champion of any task; one with several skills passes if each of them does.

Each skill is examined as a champion of its own task, on the body in its own medium.
"""

import dataclasses
import re
import time
from collections.abc import Sequence
from typing import Any

from mjxgait.certification import certificate, trials
from mjxgait.certification.advice import ADVICE
from mjxgait.certification.certificate import Certificate, NominalCheck
from mjxgait.certification.config import CertificateConfig
from mjxgait.certification.criteria import Criterion
from mjxgait.champion import Champion, by_skill
from mjxgait.creature import Creature
from mjxgait.kinds import title_of

SHARED = ("parts", "mass", "ground")
"""Entries of a report that are those of the body, the same in all skills."""


@dataclasses.dataclass(frozen=True, eq=False)
class SkillsCheck(NominalCheck):
    """Nominal check of all skills. whole: of the first. each: in the order of the skills."""

    each: tuple[NominalCheck, ...] = ()


def nominal_check(
    creature: Creature, champion: Champion, config: CertificateConfig | None = None
) -> NominalCheck:
    """Check the undisturbed motion, of every skill; see `certificate.nominal_check`."""
    each = [
        (task, certificate.nominal_check(body, one, config))
        for task, body, one in _skills(creature, champion)
    ]
    if not each:
        return certificate.nominal_check(creature, champion, config)
    criteria = _named([(task, seen.criteria) for task, seen in each])
    checks = tuple(seen for _, seen in each)
    return SkillsCheck(checks[0].whole, criteria, checks)


def certify(
    creature: Creature,
    champion: Champion,
    config: CertificateConfig | None = None,
    threads: int = 0,
    seen: NominalCheck | None = None,
    attempts: int = 1,
) -> Certificate:
    """Examine a champion by all criteria of its task, or of each skill.

    See `certificate.certify` for arguments and errors.
    """
    began, skills = time.perf_counter(), _skills(creature, champion)
    if not skills:
        return certificate.certify(creature, champion, config, threads, seen, attempts)
    known = seen.each if isinstance(seen, SkillsCheck) else (None,) * len(skills)
    each = [
        (task, certificate.certify(body, one, config, threads, check, attempts))
        for (task, body, one), check in zip(skills, known, strict=True)
    ]
    return Certificate(
        creature.name,
        creature.digest,
        champion.task,
        champion.fingerprint,
        _named([(task, one.criteria) for task, one in each]),
        _report(each),
        each[0][1].config,
        time.perf_counter() - began,
        attempts,
        dict(each),
    )


def trial_run(
    creature: Creature,
    champion: Champion,
    count: int,
    config: CertificateConfig | None = None,
    wanted: float = -float("inf"),
    caution: float = 0.0,
) -> float:
    """Return the worst margin of all skills; see `trials.trial_run`."""
    skills = _skills(creature, champion)
    if not skills:
        return trials.trial_run(creature, champion, count, config, wanted, caution)
    worst = float("inf")
    for _, body, one in skills:
        worst = min(worst, trials.trial_run(body, one, count, config, wanted, caution))
        if worst < wanted:
            break
    return worst


def _skills(creature: Creature, champion: Champion) -> list[tuple[str, Creature, Champion]]:
    """Return each skill's task, the body in its medium, and the champion that does it."""
    return [(task, one.embodied(creature), one) for task, one in by_skill(champion).items()]


def _named(each: Sequence[tuple[str, Sequence[Criterion]]]) -> tuple[Criterion, ...]:
    """Return the criteria of all skills, with the skill in their names."""
    return tuple(
        dataclasses.replace(criterion, name=f"{title_of(task)}: {criterion.name}")
        for task, criteria in each
        for criterion in criteria
    )


def _report(each: Sequence[tuple[str, Certificate]]) -> dict[str, Any]:
    """Return the report: the body's entries, and each skill's own report by task."""
    first = each[0][1].report
    found: dict[str, Any] = {key: first[key] for key in SHARED if key in first}
    found["summary"] = "; ".join(f"{title_of(t)}: {one.report['summary']}" for t, one in each)
    advice = [
        f"{title_of(task)}: {of_skill(said, task)}"
        for task, one in each
        for said in one.report.get(ADVICE, [])
    ]
    if advice:
        found[ADVICE] = advice
    return found | {"skills": {task: one.report for task, one in each}}


def of_skill(remedy: str, task: str) -> str:
    """Return a remedy for a skill's own task as one for a run with several skills."""
    return re.sub(r"\bfitness\.", f"fitness.{task}.", remedy)
