"""Report of a study: tables and text. Equal results give equal files, byte for byte."""

import base64
import csv
import dataclasses
import html
import io
import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pyarrow
import pyarrow.parquet
from markdown_it import MarkdownIt

from mjxgait.creature.ground.spec import FLAT
from mjxgait.experiments.ablation.findings import (
    Estimate,
    Finding,
    draw_curves,
    draw_intervals,
    find,
    share,
    trim_of,
)
from mjxgait.experiments.ablation.measures import Result
from mjxgait.experiments.ablation.plan import Plan
from mjxgait.files import replaced, write_text
from mjxgait.training.disk import disk_errors
from mjxgait.training.logs import Line

NAMES = {
    "walk": "body lengths per second covered before a fall or the end of 22 s, mean over 16 unseen "
    "perturbed starts in C MuJoCo",
    "up": "share of 16 unseen perturbed starts that stay up for 22 s in C MuJoCo, and arrive if "
    "the task has a goal",
    "certified": "share of champions that pass the stable-walk certificate",
    "fitness": "best fitness at the end",
    "area": "best fitness, mean over the generations (area under the curve)",
    "generations": "generations until the best reaches the threshold; fewer is better",
}
OWN_SCALE = ("fitness", "area", "generations")
"""Measures in units of each variant's own fitness."""
LEVEL = 0.05
STYLE = (
    "body{font:16px/1.5 system-ui,sans-serif;max-width:60em;margin:2em auto;padding:0 1em}"
    "table{border-collapse:collapse}"
    "td,th{border:1px solid #bbb;padding:.2em .6em;text-align:left}img{max-width:100%}"
)


def write_report(
    folder: Path,
    plan: Plan,
    results: Sequence[Result],
    logs: Sequence[Line],
    command: str,
) -> Path:
    """Write report.md, report.html, results.csv, generations.parquet and the pictures.

    Returns the path of report.md.
    """
    findings = find(plan, results)
    with disk_errors(folder):
        write_text(folder / "results.csv", _csv(results))
        with replaced(folder / "generations.parquet") as beside:
            table = pyarrow.Table.from_pylist([dict(line) for line in logs])
            pyarrow.parquet.write_table(table, beside)
        draw_intervals(findings, plan.study.measure, folder / "intervals.png")
        draw_curves(plan, logs, folder / "curves.png")
        text = markdown(plan, results, findings, command)
        write_text(folder / "report.md", text)
        write_text(folder / "report.html", _page(plan.study.question, text, folder))
    return folder / "report.md"


def markdown(
    plan: Plan, results: Sequence[Result], findings: Sequence[Finding], command: str
) -> str:
    """Return the report as Markdown."""
    study, base = plan.study, _plain(plan.variants[0])
    means = "Interquartile means" if trim_of(study.measure) else "Means"
    lines = [
        f"# {_plain(study.question)}",
        "",
        f"{_plain(study.env)}: {len(plan.variants)} variants × {study.seeds} seeds "
        f"({'the same for all' if study.paired else 'each variant its own'}, from "
        f"{study.first_seed}), {study.generations} generations. Measure: {NAMES[study.measure]}"
        f"{_where(study.grounds[0])}.",
        "",
        f"    {command}",
        "",
        f"{means} over the seeds with 95 % bootstrap intervals (BCa). Difference, chance of being "
        f"better and p are against “{base}”; p is of a permutation "
        f"test{' within seeds' if study.paired else ''}, corrected (Holm) for "
        f"{len(plan.variants) - 1} comparison{'s' if len(plan.variants) > 2 else ''}.",
        "",
        *_table(plan, results, findings),
        "",
        *_elsewhere(plan, results),
        "![Estimates](intervals.png)",
        "",
        "## What can be concluded, and what cannot",
        "",
        *[f"- {_sentence(finding, plan.variants[0])}" for finding in findings[1:]],
        *[f"- {caution}" for caution in _cautions(plan, results)],
        "",
        "## Curves",
        "",
        "Best fitness over the generations: interquartile mean and middle half of the runs.",
        "",
        "![Curves](curves.png)",
        "",
    ]
    return "\n".join(lines)


def _where(ground: str) -> str:
    return "" if ground == FLAT else f", on {ground}"


def _table(plan: Plan, results: Sequence[Result], findings: Sequence[Finding]) -> list[str]:
    head = [
        "variant",
        plan.study.measure,
        "difference",
        "chance of being better",
        "p",
        "p corrected",
        "up",
        "certified",
        "steps per run",
    ]
    rows = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    for finding in findings:
        mine = [r for r in results if r.variant == finding.name]
        comparison = finding.comparison
        cells = [_plain(finding.name), _estimate(finding.estimate)]
        if comparison:
            cells += [
                _estimate(comparison.difference, "+"),
                _estimate(comparison.improvement),
                _p(comparison.p),
                _p(comparison.corrected),
            ]
        else:
            cells += ["-"] * 4
        examined = [r.certified for r in mine if r.certified is not None]
        certified = _estimate(share(sum(examined), len(examined))) if examined else "-"
        cells += [
            f"{np.mean([r.up for r in mine]):.0%}",
            certified,
            f"{np.mean([r.steps for r in mine]) / 1e6:.1f} M",
        ]
        rows.append("| " + " | ".join(cells) + " |")
    return rows


def _elsewhere(plan: Plan, results: Sequence[Result]) -> list[str]:
    """Return the table and sentences of each further ground."""
    lines = []
    for ground in plan.study.grounds[1:]:
        there = [result.on(ground) for result in results]
        findings = find(plan, there)
        lines += [f"## On {ground}", "", *_table(plan, there, findings), ""]
        lines += [*[f"- {_sentence(finding, plan.variants[0])}" for finding in findings[1:]], ""]
    return lines


def _sentence(finding: Finding, base: str) -> str:
    comparison, name, base = finding.comparison, _plain(finding.name), _plain(base)
    assert comparison is not None
    gap = comparison.difference
    interval = f"({_number(gap.low, '+')} to {_number(gap.high, '+')})"
    if comparison.corrected < LEVEL:
        word = "better" if gap.value > 0 else "worse"
        return f"“{name}” is {word} than “{base}” by {_number(abs(gap.value))} {interval}."
    half = 0.5 * (gap.high - gap.low)
    return (
        f"Between “{name}” and “{base}” no difference is shown: {_number(gap.value, '+')} "
        f"{interval}. That is not proof of none; with these seeds a difference of less than about "
        f"{_number(half)} would be missed."
    )


def _cautions(plan: Plan, results: Sequence[Result]) -> list[str]:
    found = []
    if plan.study.measure in OWN_SCALE:
        first = plan.runs[0].config
        if any(
            (r.config.fitness, r.config.rollout) != (first.fitness, first.rollout)
            for r in plan.runs
        ):
            found.append(
                "The variants do not share fitness and starts, so their fitness values are not on "
                "one scale; compare by `walk`."
            )
    broken = [f"{_plain(r.variant)}, seed {r.seed}" for r in results if not r.finite]
    if broken:
        found.append(f"Runs without a finite fitness, counted as the worst: {'; '.join(broken)}.")
    steps = {
        name: np.mean([r.steps for r in results if r.variant == name]) for name in plan.variants
    }
    if max(steps.values()) > 1.5 * min(steps.values()):
        found.append(
            "The variants did not use the same number of simulated steps (last column): equal "
            "generations are not equal cost."
        )
    found.append(
        f"It holds for {_plain(plan.study.env)} under these settings and this budget; another "
        "creature or a longer run may differ."
    )
    return found


def _csv(results: Sequence[Result]) -> str:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    names = [field.name for field in dataclasses.fields(Result) if field.name != "elsewhere"]
    grounds = list(results[0].elsewhere)
    there = [f"{measure} on {ground}" for ground in grounds for measure in ("walk", "up")]
    writer.writerow([*names, *there])
    for result in results:
        own = [value for ground in grounds for value in result.elsewhere[ground]]
        writer.writerow([*(_cell(getattr(result, name)) for name in names), *own])
    return text.getvalue()


def _cell(value: object) -> object:
    """Return a CSV value; text that a spreadsheet would read as a formula gets a leading quote."""
    formula = isinstance(value, str) and value.startswith(("=", "+", "-", "@", "\t", "\r"))
    return f"'{value}" if formula else value


def _plain(text: str) -> str:
    """Return a user's text as one line of Markdown, without HTML, link, picture or table cell."""
    return re.sub(r"([\\`<>\[\]|&])", r"\\\1", " ".join(text.split()))


def _page(title: str, text: str, folder: Path) -> str:
    """Return the report as one self-contained HTML page."""
    body = MarkdownIt("commonmark", {"html": False}).enable("table").render(text)
    for name in ("intervals.png", "curves.png"):
        picture = base64.b64encode((folder / name).read_bytes()).decode()
        body = body.replace(f'src="{name}"', f'src="data:image/png;base64,{picture}"')
    head = (
        '<!doctype html><html lang="en"><meta charset="utf-8">'
        f"<title>{html.escape(title)}</title><style>{STYLE}</style>"
    )
    return f"{head}\n{body}</html>\n"


def _estimate(value: Estimate, sign: str = "") -> str:
    return f"{_number(value.value, sign)} [{_number(value.low, sign)}, {_number(value.high, sign)}]"


def _number(value: float, sign: str = "") -> str:
    return (
        f"{value:{sign}.1f}"
        if abs(value) >= 100
        else f"{value:{sign}.3g}"
        if abs(value) >= 1
        else f"{value:{sign}.2f}"
    )


def _p(value: float) -> str:
    return "<0.001" if value < 0.001 else f"{value:.3f}"
