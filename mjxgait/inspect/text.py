"""The tables that `mjxgait inspect` prints."""

import dataclasses
import datetime
from collections.abc import Mapping, Sequence

from rich.console import Console

from mjxgait.config.tables import flat
from mjxgait.inspect.facts import Ranked, fitness_summary
from mjxgait.inspect.sections import (
    Facts,
    print_columns,
    print_islands,
    print_pairs,
    show,
    titled_table,
    view_of,
)
from mjxgait.inspect.snapshot import Snapshot

FEW = 10
"""Individuals shown by default."""
BLOCKS = "▁▂▃▄▅▆▇█"
WIDEST = 60
"""Characters of a sparkline; longer histories are thinned."""


def print_facts(facts: Facts, console: Console, few: bool = False) -> None:
    """Print all facts about a checkpoint; see `facts`. few: only the best of the population."""
    _print_identity(facts, console)
    _print_settings(facts["settings_changed"], console)
    _print_history(facts, console)
    print_islands(facts["islands"], console)
    shown = facts["population"][: FEW if few else None]
    _print_population(shown, console)
    if left := len(facts["population"]) - len(shown):
        console.print(f"… and {left} more; --all shows them")
    _print_sizes(facts["champion"], console)
    view_of(facts["controller"]).show(facts["champion"], facts["diversity"], console)


def print_individual(individual: Facts, console: Console) -> None:
    """Print all facts about one individual; see `individual_facts`."""
    console.print(
        f"individual {individual['rank']}: fitness {show(individual['fitness'])}, "
        f"{individual['kind']}, born in generation {individual['born']}",
        style="bold",
    )
    starts = len(next(iter(individual["terms"].values()), ()))
    table = titled_table("fitness terms, one column per start (the first is undisturbed)", console)
    for heading in ("term", *(f"start {i + 1}" for i in range(starts)), "gives"):
        table.add_column(heading, justify="left" if heading == "term" else "right")
    for name, values in individual["terms"].items():
        table.add_row(name, *map(show, values), show(individual["contributions"][name], sign=True))
    console.print(table)
    _print_sizes(individual, console)
    view_of(individual["controller"]).show(individual, None, console)


def _print_sizes(individual: Facts, console: Console) -> None:
    """Print the sizes of an evolved body."""
    if sizes := individual.get("sizes"):
        console.print("sizes: " + ", ".join(f"{name} {f:.2f}" for name, f in sizes.items()))


def sparkline(values: Sequence[float | None], low: float, high: float) -> str:
    """Return one character per value, by its height between low and high; a space for None."""
    room = max(high - low, 1e-9)

    def block(value: float | None) -> str:
        return (
            " "
            if value is None
            else BLOCKS[min(max(int((value - low) / room * len(BLOCKS)), 0), len(BLOCKS) - 1)]
        )

    return "".join(map(block, values))


def ago(written: str) -> str:
    """Return the time elapsed since an ISO time, in the largest unit that fits."""
    seconds = (
        datetime.datetime.now(datetime.UTC) - datetime.datetime.fromisoformat(written)
    ).total_seconds()
    for unit, length in (("day", 86400), ("hour", 3600), ("minute", 60)):
        if (count := int(seconds // length)) >= 1:
            return f"{count} {unit}{'s' if count > 1 else ''} ago"
    return "just now"


def _print_identity(facts: Facts, console: Console) -> None:
    going = "not finished: `mjxgait train --resume` goes on from the latest checkpoint"
    # The champion's certificate ends a run, too.
    alive = facts["running"] and f"runs now: {facts['running']}"
    state = (
        alive or facts["ended"] or ("not known without the champion" if facts["trouble"] else going)
    )
    versions = ", ".join(f"{name} {version}" for name, version in facts["versions"].items())
    size, key = (
        f"{facts['bytes'] / 1024:,.0f} KiB",
        " ".join(f"{word:08x}" for word in facts["random_key"]["data"]),
    )
    console.print(
        f"{facts['creature']}, generation {facts['generation']} of {facts['generations']}",
        style="bold",
    )
    fitness = facts["fitness"]
    rows = {
        "run": facts["run"],
        "state": state,
        "checkpoint": f"intact, schema {facts['schema']}, {size}, written {ago(facts['written'])} "
        f"({facts['written']})",
        "generations kept": ", ".join(map(str, facts["checkpoints"])),
        "seed": f"{facts['seed']} ({facts['random_key']['kind']} key now {key})",
        "controller, task": f"{facts['controller']}, {facts['task']}",
        "body": facts["creature_digest"],
        "versions": versions
        or ("unknown" if facts["trouble"] else "unknown: no champion.json yet"),
        "certificate": facts["certificate"],
        "fitness": ", ".join(
            f"{name.replace('_', ' ')} {show(value)}"
            for name, value in fitness.items()
            if name != "broken"
        )
        + (f"; {fitness['broken']} without a finite one" if fitness["broken"] else ""),
        "genomes": f"{facts['diversity']['unique']} different of "
        f"{facts['diversity']['individuals']}",
    }
    print_pairs(rows, console)


def _print_settings(changed: Mapping[str, Mapping[str, object]], console: Console) -> None:
    if not changed:
        console.print("\nAll settings are those of configs/default.toml.")
        return
    table = titled_table("settings that differ from configs/default.toml", console)
    for heading in ("key", "default", "here"):
        table.add_column(heading)
    for key, values in changed.items():
        table.add_row(key, str(values["default"]), str(values["here"]))
    console.print(table)


def _print_history(facts: Facts, console: Console) -> None:
    history = facts["history"]
    if not history:
        console.print("\nNo history: metrics.jsonl is missing or damaged.")
        return
    stride = -(-len(history) // WIDEST)
    thinned = history[::-1][::stride][::-1]
    values = [line[key] for line in thinned for key in ("best", "mean") if line[key] is not None]
    low, high = min(values, default=0.0), max(values, default=0.0)
    forced = [
        any(line["forced"] for line in history[max(i - stride + 1, 0) : i + 1])
        for i in range(len(history))
    ][::-1][::stride][::-1]
    console.print(
        f"\nhistory of generations {history[0]['generation']} to "
        f"{history[-1]['generation']}, fitness {low:.2f} to {high:.2f}",
        style="bold",
    )
    for key in ("best", "mean"):
        console.print(f"{key:7} {sparkline([line[key] for line in thinned], low, high)}")
    if any(forced):
        console.print(f"forced  {''.join('^' if f else ' ' for f in forced)}".rstrip())
    for spell in facts["forced_spells"]:
        console.print(
            f"forced evolution in generations {spell['first']} to {spell['last']}: best "
            f"{show(spell['best_before'])} to {show(spell['best_after'])}, mean "
            f"{show(spell['mean_before'])} to {show(spell['mean_after'])}"
        )


def _print_population(rows: Sequence[Ranked], console: Console) -> None:
    weight = {
        name: sum(abs(row["contributions"][name] or 0.0) for row in rows)
        for name in rows[0]["contributions"]
    }
    # Only as many terms as the line has room for.
    main = sorted((name for name in weight if weight[name]), key=lambda name: -weight[name])[
        : max((console.width - 42) // 10, 1)
    ]
    table = titled_table(
        "population; what each term gives to the fitness (--individual N tells all of one)", console
    )
    for heading in ("rank", "fitness", "age", "kind", *main, "others"):
        table.add_column(heading, justify="left" if heading == "kind" else "right", no_wrap=True)
    for row in rows:
        others = sum(
            value or 0.0 for name, value in row["contributions"].items() if name not in main
        )
        given = [show(row["contributions"][name], sign=True) for name in main]
        table.add_row(
            str(row["rank"]),
            show(row["fitness"]),
            str(row["age"]),
            row["kind"],
            *given,
            show(others, sign=True),
        )
    console.print(table)


def differences(a: Snapshot, b: Snapshot) -> dict[str, object]:
    """Compare settings, fitness, populations and champions of two checkpoints.

    Genomes are compared only for the same controller, poses only for the same joints.
    """
    mine, other = (flat(dataclasses.asdict(s.config)) for s in (a, b))
    kinds = [s.config.use.controller for s in (a, b)]
    summaries = fitness_summary(a.fitness), fitness_summary(b.fitness)
    return {
        "a": _name(a),
        "b": _name(b),
        "same_body": a.creature.digest == b.creature.digest,
        "settings": {
            key: [mine.get(key), other.get(key)]
            for key in sorted(mine.keys() | other.keys())
            if mine.get(key) != other.get(key)
        },
        "versions": {
            name: [a.versions.get(name), b.versions.get(name)]
            for name in sorted({*a.versions, *b.versions})
            if a.versions.get(name) != b.versions.get(name)
        },
        "fitness": {name: [one[name], two[name]] for one, two in [summaries] for name in one},
        "controllers": kinds,
    } | (view_of(kinds[0]).difference(a, b) if kinds[0] == kinds[1] else {})


def print_differences(found: Facts, console: Console) -> None:
    """Print the differences as tables."""
    a, b = found["a"], found["b"]
    heading = {
        s: f"{side['creature']}, generation {side['generation']} of {side['run']}"
        for s, side in (("A", a), ("B", b))
    }
    print_pairs(
        heading
        | ({} if found["same_body"] else {"body": "not the same: the creature files differ"}),
        console,
    )
    print_columns("settings", found["settings"], console)
    print_columns("versions", found["versions"], console)
    print_columns(
        "fitness",
        {k: [show(x), show(y)] for k, (x, y) in found["fitness"].items() if k != "broken"},
        console,
    )
    mine, other = found["controllers"]
    if mine == other:
        view_of(mine).show_difference(found, console)
    else:
        console.print(f"\nA is moved by {mine}, B by {other}: their genomes cannot be compared.")


def _name(snapshot: Snapshot) -> dict[str, object]:
    return {
        "run": str(snapshot.run),
        "creature": snapshot.creature.name,
        "generation": snapshot.generation,
        "seed": snapshot.config.seed,
    }
