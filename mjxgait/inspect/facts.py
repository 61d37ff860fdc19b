"""Plain values of a snapshot, printed by `--json` and shown in the tables.

Angles in degrees.
"""

import dataclasses
import datetime
import itertools
from collections.abc import Mapping, Sequence
from typing import TypedDict

import jax.numpy as jnp
import numpy as np

from mjxgait.certification import (
    outdated,
    read_certificate,
    read_stress,
    stress_in_words,
    verdict_of,
)
from mjxgait.certification.describe import in_words
from mjxgait.certification.validity import StressDocument
from mjxgait.certification.verdict import Document
from mjxgait.config.tables import flat
from mjxgait.errors import UserError
from mjxgait.evolution.state import Origin
from mjxgait.inspect.sections import island_facts, view_of
from mjxgait.inspect.snapshot import Snapshot
from mjxgait.plugins import resolve_config
from mjxgait.plugins.registry import task_of
from mjxgait.training.folder import CERTIFICATE, STRESS, kept_champion
from mjxgait.training.lock import running
from mjxgait.training.logs import Line

KINDS = {
    Origin.INITIAL: "initial",
    Origin.CROSSOVER: "crossover",
    Origin.MUTATION: "mutation",
    Origin.NEWCOMER: "newcomer",
    Origin.DRAWN: "drawn",
}


def facts(snapshot: Snapshot) -> dict[str, object]:
    """Return all facts about a checkpoint."""
    return {
        "run": str(snapshot.run),
        "creature": snapshot.creature.name,
        "controller": snapshot.config.use.controller,
        "task": snapshot.config.use.task,
        "creature_digest": snapshot.creature.digest,
        "generation": snapshot.generation,
        "generations": snapshot.config.evolution.generations,
        "running": running(snapshot.run),
        "ended": snapshot.ended,
        "checkpoints": list(snapshot.generations),
        "intact": True,
        "schema": snapshot.manifest.schema,
        "seed": snapshot.config.seed,
        "random_key": {"kind": snapshot.manifest.key_impl, "data": snapshot.arrays["key"].tolist()},
        "written": datetime.datetime.fromtimestamp(snapshot.written, datetime.UTC).isoformat(
            timespec="seconds"
        ),
        "bytes": snapshot.size,
        "versions": dict(snapshot.versions),
        "trouble": snapshot.trouble,
        "certificate": certificate(snapshot),
        "verdict": verdict(snapshot),
        "settings_changed": settings_changed(snapshot),
        "fitness": fitness_summary(snapshot.fitness),
        "history": [
            {key: line[key] for key in ("generation", "best", "mean", "forced")}
            for line in snapshot.lines
        ],
        "forced_spells": forced_spells(snapshot.lines),
        "islands": island_facts(snapshot.run, snapshot.generation),
        "population": population(snapshot),
        "diversity": diversity(snapshot),
        "champion": individual_facts(snapshot, 1),
    }


def certificate(snapshot: Snapshot) -> str:
    """Return a sentence on the certificate of the run's champion, for any of its checkpoints."""
    document = _certificate(snapshot)
    if isinstance(document, str):
        return document
    found = verdict_of(document)
    if not found.passed:
        failed = (", " if found.failed[0].skill else " ").join(found.labels) if found.failed else ""
        failure = (
            f"fails criteria {failed}" if failed else "is not certified: there are no criteria"
        )
        return f"The champion {failure}{f'; {found.reservation}' if found.reservation else ''}."
    if found.reservation:
        return f"The champion is not certified: it passes, but {found.reservation}."
    like = in_words(document.get("report", {}))
    details = f"margin {found.margin:.2f}.{f' {like}' if like else ''}"
    return f"The champion is certified, {details}{_anywhere(snapshot)}"


def _anywhere(snapshot: Snapshot) -> str:
    """Sentence on the champion's stress tests; empty without any."""
    document = _stress(snapshot)
    if document is None:
        return ""
    return f" {stress_in_words(document)}"


class Summary(TypedDict):
    """Main values of a certificate; see `verdict`."""

    certified: bool
    failed: list[int]
    reservation: str
    anywhere: bool | None
    margin: float | None
    speed: float | None
    gait: str | None


def verdict(snapshot: Snapshot) -> Summary | None:
    """Return the main values of the champion's certificate; None if it has no valid one.

    speed: m/s. gait: its name. Both are None for other tasks than walking. anywhere: whether it
    passed the stress tests; None without any. reservation: see `certification.Verdict`.
    """
    document = _certificate(snapshot)
    if isinstance(document, str):
        return None
    report, found = document.get("report", {}), verdict_of(document)
    return {
        "certified": found.certified,
        "failed": found.numbers,
        "reservation": found.reservation,
        "anywhere": None if (stress := _stress(snapshot)) is None else stress["passed"],
        "margin": number(found.margin),
        "speed": report.get("speed"),
        "gait": report.get("gait"),
    }


def _certificate(snapshot: Snapshot) -> Document | str:
    """Return the certificate of the run's champion, or the reason why it has no valid one."""
    if snapshot.trouble:
        return snapshot.trouble
    try:
        document = read_certificate(snapshot.run / CERTIFICATE)
        if document is None:
            return "The champion has not been examined."
        champion = kept_champion(snapshot.run, snapshot.creature)
        return outdated(document, champion, snapshot.creature) or document
    except UserError as error:
        return str(error)


def _stress(snapshot: Snapshot) -> StressDocument | None:
    """Results of the champion's stress tests; None without any."""
    try:
        champion = kept_champion(snapshot.run, snapshot.creature)
        return read_stress(snapshot.run / STRESS, champion)
    except UserError:
        return None


def settings_changed(snapshot: Snapshot) -> dict[str, dict[str, object]]:
    """Return the settings that differ from configs/default.toml, by dotted key: default and this
    run's value.
    """
    use = dataclasses.asdict(snapshot.config.use)
    default = flat(dataclasses.asdict(resolve_config({}, snapshot.creature.name, use=use)))
    mine = flat(dataclasses.asdict(snapshot.config))
    return {
        key: {"default": default[key], "here": mine[key]}
        for key in mine
        if mine[key] != default[key]
    }


def fitness_summary(fitness: np.ndarray) -> Mapping[str, float | None]:
    """Return best, quartiles, mean and worst of the finite fitness values [P], and the number of
    others.
    """
    finite = fitness[np.isfinite(fitness)]
    if not len(finite):
        return {
            "best": None,
            "upper_quartile": None,
            "median": None,
            "lower_quartile": None,
            "worst": None,
            "mean": None,
            "broken": len(fitness),
        }
    best, upper, median, lower, worst = np.percentile(finite, [100, 75, 50, 25, 0])
    names = {
        "best": best,
        "upper_quartile": upper,
        "median": median,
        "lower_quartile": lower,
        "worst": worst,
        "mean": finite.mean(),
    }
    return {name: float(value) for name, value in names.items()} | {
        "broken": len(fitness) - len(finite)
    }


class Spell(TypedDict):
    """A forced phase; see `forced_spells`."""

    first: int
    last: int
    best_before: float | None
    best_after: float | None
    mean_before: float | None
    mean_after: float | None


def forced_spells(lines: Sequence[Line]) -> list[Spell]:
    """Return each forced phase: first and last generation, fitness before and after."""
    spells: list[Spell] = []
    for forced, group in itertools.groupby(
        range(len(lines)), key=lambda i: bool(lines[i]["forced"])
    ):
        places = list(group)
        if forced:
            before, after = lines[max(places[0] - 1, 0)], lines[places[-1]]
            spells.append(
                {
                    "first": lines[places[0]]["generation"],
                    "last": after["generation"],
                    "best_before": before["best"],
                    "best_after": after["best"],
                    "mean_before": before["mean"],
                    "mean_after": after["mean"],
                }
            )
    return spells


def terms_of(snapshot: Snapshot) -> tuple[str, ...]:
    """Return the names of the fitness terms; none if the task now has another number of them."""
    names = task_of(snapshot.creature, snapshot.config).terms
    return names if snapshot.arrays["terms"].shape[-1] == len(names) else ()


def contributions(snapshot: Snapshot) -> np.ndarray:
    """Return each term's signed contribution [P, F] to each individual's fitness; a row sums to the
    fitness. [P, 0] if the terms are unknown.
    """
    terms = np.asarray(snapshot.arrays["terms"], float)
    if not terms_of(snapshot):
        return terms[:, 0, :0]
    task = task_of(snapshot.creature, snapshot.config)
    counted = task.weights(snapshot.config.fitness, jnp.int32(snapshot.generation))
    weights = np.array([float(counted[name]) for name in task.terms])
    worst = snapshot.config.rollout.worst
    scores = terms @ weights
    lowest = np.argmin(np.where(np.isnan(scores), -np.inf, scores), axis=1)
    return (worst * terms[np.arange(len(terms)), lowest] + (1 - worst) * terms.mean(1)) * weights


class Ranked(TypedDict):
    """An individual's row; see `population`."""

    rank: int
    fitness: float | None
    born: int
    age: int
    kind: str
    contributions: dict[str, float | None]


def population(snapshot: Snapshot) -> list[Ranked]:
    """Return one row per individual, best first."""
    parts, arrays, names = contributions(snapshot), snapshot.arrays, terms_of(snapshot)
    return [
        {
            "rank": i + 1,
            "fitness": number(arrays["fitness"][i]),
            "born": int(arrays["born"][i]),
            "age": snapshot.generation - int(arrays["born"][i]),
            "kind": KINDS[Origin(int(arrays["origin"][i]))],
            "contributions": {
                name: number(value) for name, value in zip(names, parts[i], strict=True)
            },
        }
        for i in range(len(parts))
    ]


def diversity(snapshot: Snapshot) -> dict[str, object]:
    """Return the number of different genomes, and their spread."""
    rows = snapshot.rows
    found = {"individuals": len(rows), "unique": len(np.unique(rows, axis=0))}
    return found | view_of(snapshot.config.use.controller).spread(snapshot)


def individual_facts(snapshot: Snapshot, rank: int) -> dict[str, object]:
    """Return the facts about one individual; rank 1 is the best.

    Raises:
      UserError: the population is smaller.
    """
    champion, i = snapshot.champion(rank), rank - 1
    names = terms_of(snapshot)
    terms = np.asarray(snapshot.arrays["terms"][i], float)[:, : len(names)]
    return (
        population(snapshot)[i]
        | {
            "controller": champion.controller,
            "terms": {
                name: [number(value) for value in column]
                for name, column in zip(names, terms.T, strict=True)
            },
        }
        | ({"sizes": dict(champion.sizes)} if champion.sizes else {})
        | view_of(champion.controller).facts(snapshot, i)
    )


def number(value: float) -> float | None:
    """Return a number for JSON; None if it is not finite."""
    return float(value) if np.isfinite(value) else None
