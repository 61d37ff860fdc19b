"""Examination of a champion in C MuJoCo for the stable-walk certificate, free of JAX."""

import dataclasses
import itertools
import json
import time
from collections.abc import Mapping
from typing import Any

import numpy as np

from mjxgait.certification import criteria, trials
from mjxgait.certification.acceptance import acceptance_of, task_rules
from mjxgait.certification.advice import FELL_AFTER, advised
from mjxgait.certification.check_body import check_body
from mjxgait.certification.config import CertificateConfig
from mjxgait.certification.criteria import Criterion
from mjxgait.certification.trials import AIMS, simulate, steering_criteria
from mjxgait.certification.verdict import Document, MeasureEntry, Verdict, verdict_of, verdict_on
from mjxgait.champion import Champion
from mjxgait.creature import Creature
from mjxgait.reference.measure import Recording, measure
from mjxgait.reference.starts import (
    Starts,
    join,
    nominal_starts,
    perturbed_starts,
)

SCHEMA = 2
"""Version of the file and of the criteria.

Schema 1 had eight criteria, and chose the champion on the draw that it was examined on.
"""


@dataclasses.dataclass(frozen=True, eq=False)
class Certificate:
    """Result of an examination.

    champion: fingerprint of the examined champion. report: numbers without a threshold.
    seconds: duration of the examination. attempts: examinations of its run, this one included.
    skills: certificates by skill that make up this one; not in the file.
    """

    creature: str
    digest: str
    task: str
    champion: str
    criteria: tuple[Criterion, ...]
    report: dict[str, Any]
    config: CertificateConfig
    seconds: float
    attempts: int = 1
    skills: "Mapping[str, Certificate]" = dataclasses.field(default_factory=dict)

    @property
    def passed(self) -> bool:
        """True if there are criteria and all of them pass."""
        return verdict_on(self.criteria).passed

    @property
    def margin(self) -> float:
        """Margin of the worst criterion, which ranks candidates; positive when all pass."""
        return verdict_on(self.criteria).margin

    @property
    def verdict(self) -> Verdict:
        """Result that a reader derives from the stored file."""
        return verdict_of(self.document())

    def rows(self) -> list[tuple[str, str, str, str, str]]:
        """Return a table: criterion, measure, value, threshold, result."""
        return [
            (
                f"{c.number} {c.name}",
                m.name,
                "none" if np.isnan(m.value) else f"{m.value:.3g}",
                f"{m.sense} {m.threshold:g}",
                "pass" if m.passed else "FAIL",
            )
            for c in self.criteria
            for m in c.measures
        ]

    def to_json(self) -> str:
        """Return the text of `certificate.json`."""
        return json.dumps(self.document(), indent=2, allow_nan=False) + "\n"

    def document(self) -> Document:
        """Return the content of `certificate.json`; non-finite numbers become null."""
        document = {
            "schema": schema_of(self.task),
            "creature": self.creature,
            "creature_digest": self.digest,
            "task": self.task,
            "champion": self.champion,
            "passed": self.passed,
            "margin": self.margin,
            "attempts": self.attempts,
            "criteria": [
                {
                    "number": c.number,
                    "name": c.name,
                    "passed": c.passed,
                    "margin": c.margin,
                    "measures": [_entry(m) for m in c.measures],
                }
                for c in self.criteria
            ],
            "report": self.report,
            "config": dataclasses.asdict(self.config),
            "seconds": round(self.seconds, 2),
        }
        found: Document = _finite(document)
        return found


@dataclasses.dataclass(frozen=True, eq=False)
class NominalCheck:
    """Nominal check: the undisturbed walk, and the criteria that need no other simulation."""

    whole: Recording
    criteria: tuple[Criterion, ...]

    @property
    def margin(self) -> float:
        """Margin of the worst of its criteria."""
        return verdict_on(self.criteria).margin


def nominal_check(
    creature: Creature,
    champion: Champion,
    config: CertificateConfig | None = None,
) -> NominalCheck:
    """Check the undisturbed walk, which takes a fifth of the examination's time.

    The walk with half the time step runs beside the other: most of the cost of one walk is Python
    overhead, which two walks share.

    Raises:
      UserError: the creature's facts contradict its own files, or the champion is not finite.
    """
    config = config or CertificateConfig()
    check_body(creature, champion.pose_span)
    acceptance = acceptance_of(champion.task, champion.wish)
    start = acceptance.aimed(nominal_starts(creature, 1), config)
    both = dataclasses.replace(join(start, start), refine=np.array([1, 2]))
    whole, halved = recordings(creature, champion, config.seconds, both)
    found = acceptance.undisturbed(whole, halved, config)
    return NominalCheck(whole, (*found, *acceptance.kept(champion, whole, config)))


def certify(
    creature: Creature,
    champion: Champion,
    config: CertificateConfig | None = None,
    threads: int = 0,
    seen: NominalCheck | None = None,
    attempts: int = 1,
) -> Certificate:
    """Examine a champion by all criteria of its task, on starts and pushes drawn for it alone.

    Args:
      seen: result of `nominal_check` with the same config, to save the repetition.
      attempts: examinations of its run, this one included.

    Raises:
      UserError: the creature's facts contradict its own files, or the champion is not finite.
    """
    config = config or CertificateConfig()
    began = time.perf_counter()
    seen = seen or nominal_check(creature, champion, config)
    found, report = _disturbed(creature, champion, config, threads)
    tested = sorted((*seen.criteria, *found), key=lambda c: c.number)
    report = acceptance_of(champion.task, champion.wish).report(seen.whole, config) | report
    report |= advised(tested, champion.task, report, creature)
    return Certificate(
        creature.name,
        creature.digest,
        champion.task,
        champion.fingerprint,
        tuple(tested),
        report,
        config,
        time.perf_counter() - began,
        attempts,
    )


def _disturbed(
    creature: Creature, champion: Champion, config: CertificateConfig, threads: int
) -> tuple[tuple[Criterion, ...], dict[str, object]]:
    """Evaluate the criteria on starts and pushes drawn for the champion; and their report."""
    draw = trials.own_draw(champion, config)
    acceptance = acceptance_of(champion.task, champion.wish)
    disturbed = trials.starts(creature, config, draw, config.starts.count)
    groups = [
        nominal_starts(creature, 1),
        acceptance.aimed(disturbed, config, draw.generator(AIMS)),
    ]
    if acceptance.pushed:
        groups += [trials.pushes(creature, config, draw, config.pushes.count)]
        groups += trials.ladder(creature, config, draw)
    starts = acceptance.aimed(join(*groups), config)
    outcome = simulate(
        creature, champion, starts, config.seconds, fall=acceptance.fall(config), threads=threads
    )
    ends = np.cumsum([len(g) for g in groups])[:-1]
    plain, _, *pushed = (float(up.mean()) for up in np.split(outcome.stayed_up, ends))
    started = float(np.split(acceptance.succeeded(outcome, starts, config), ends)[1].mean())
    found = acceptance.disturbed(started, pushed[0] if pushed else np.nan, config)
    found += steering_criteria(creature, champion, config, draw, threads)
    report: dict[str, object] = {"ground": str(creature.terrain)}
    report |= _fell(np.split(outcome.fell, ends)[1])
    if pushed:
        sizes = (0.0, config.pushes.speed, *config.pushes.ladder)
        report |= _bears(dict(zip(sizes, (plain, *pushed), strict=True)))
    return found, report


def record(
    creature: Creature,
    champion: Champion,
    seconds: float,
    start: Starts | None = None,
) -> Recording:
    """Record and measure the undisturbed walk.

    start: initial conditions; nominal by default, with the usual goal if the task has one.
    """
    start = nominal_starts(creature, 1) if start is None else start
    return recordings(creature, champion, seconds, start)[0]


def recordings(
    creature: Creature, champion: Champion, seconds: float, starts: Starts
) -> list[Recording]:
    """Record and measure walks from some starts; overlap of parts only at the usual time step."""
    task = task_rules(champion.task, champion.wish)
    starts = task.aimed(starts, CertificateConfig())
    count, drag = len(starts), task.drag if task.grown else None
    film = simulate(creature, champion, starts, seconds, record=count, threads=1).trajectory
    return [
        measure(creature, film, row, inside=starts.refine[row] == 1, aimed=starts, drag=drag)
        for row in range(count)
    ]


def survival(
    creature: Creature,
    champion: Champion,
    starts: int = 64,
    seconds: float = 22.0,
    seed: int = 0,
) -> float:
    """Return the share of perturbed starts that stay up to the end and move forward."""
    disturbed = perturbed_starts(creature, starts, np.random.default_rng(seed))
    outcome = simulate(creature, champion, disturbed, seconds)
    return float((outcome.stayed_up & (outcome.travel[:, 0] > 0)).mean())


def distance(creature: Creature, champion: Champion, seconds: float) -> float:
    """Return the forward distance in m of the undisturbed walk, up to its end or fall."""
    return float(simulate(creature, champion, nominal_starts(creature, 1), seconds).travel[0, 0])


def push_ladder(
    creature: Creature, champion: Champion, config: CertificateConfig
) -> dict[float, float]:
    """Return the share that stays up after each larger push, on the draw shared by all champions.

    Push speeds are in units of sqrt(g * hip height).
    """
    groups = trials.ladder(creature, config, trials.common_draw(config))
    acceptance = acceptance_of(champion.task, champion.wish)
    starts, fall = acceptance.aimed(join(*groups), config), acceptance.fall(config)
    outcome = simulate(creature, champion, starts, config.seconds, fall=fall)
    return dict(
        zip(
            config.pushes.ladder,
            map(float, outcome.stayed_up.reshape(len(groups), -1).mean(1)),
            strict=True,
        )
    )


def half_point(shares: dict[float, float]) -> float | None:
    """Push speed at which the share of survivors first drops to a half; None if it never does.

    Interpolated between the pushes tried.
    """
    steps = sorted(shares.items())
    for (s0, share0), (s1, share1) in itertools.pairwise(steps):
        if share0 > 0.5 >= share1:
            return s0 + (share0 - 0.5) / (share0 - share1) * (s1 - s0)
    return 0.0 if steps[0][1] <= 0.5 else None


def _bears(shares: dict[float, float]) -> dict[str, object]:
    """Return the report's entries on pushes, from shares of survivors by push speed."""
    return {
        "push_survival": {f"{speed:g}": share for speed, share in sorted(shares.items())},
        "push_that_fells_half": half_point(shares),
    }


def _fell(times: np.ndarray) -> dict[str, object]:
    """Return the report's entry on falls from perturbed starts. times: [S] s, infinite without."""
    fallen = times[np.isfinite(times)]
    return {FELL_AFTER: float(fallen.mean())} if len(fallen) else {}


def schema_of(task: str) -> int:
    """Version of `certificate.json` for a task; a certificate of another version is outdated."""
    return SCHEMA + task_rules(task).revision


def _entry(measure: criteria.Measure) -> MeasureEntry:
    return {
        "name": measure.name,
        "value": measure.value,
        "sense": measure.sense,
        "threshold": measure.threshold,
        "room": measure.room,
        "passed": measure.passed,
        "margin": measure.margin,
    }


def _finite(value: object) -> Any:
    match value:
        case dict():
            return {k: _finite(v) for k, v in value.items()}
        case list() | tuple():
            return [_finite(v) for v in value]
        case float() if not np.isfinite(value):
            return None
        case _:
            return value
