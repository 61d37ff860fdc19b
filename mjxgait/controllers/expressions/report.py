"""Reports on genomes of expressions."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from rich.console import Console
from typing_extensions import override

from mjxgait.champion import serializer_of
from mjxgait.controllers.expressions.text import (
    EMPTY,
    every_terminal,
    to_text,
)
from mjxgait.inspect.sections import GenomeView, print_shared, title, titled_table
from mjxgait.inspect.snapshot import Snapshot, shared


class ProgramView(GenomeView):
    """Expressions by joint; see `GenomeView`."""

    @override
    def facts(self, snapshot: Snapshot, i: int) -> dict[str, object]:
        return {
            "expressions": _texts(snapshot, i),
            "nodes": _nodes(snapshot)[i].tolist(),
            "nodes_that_matter": _mattering(snapshot, i),
        }

    def spread(self, snapshot: Snapshot) -> dict[str, object]:
        """Nodes per expression, over the population."""
        nodes = _nodes(snapshot)
        return {"nodes": {"mean": nodes.mean(0).tolist(), "most": nodes.max(0).tolist()}}

    @override
    def difference(self, a: Snapshot, b: Snapshot) -> dict[str, object]:
        mine, other = _texts(a, 0), _texts(b, 0)
        comparable = a.creature.joints.names == b.creature.joints.names
        alike = a.genomes["code"].shape[1:] == b.genomes["code"].shape[1:]
        return {
            "same_individuals": shared(a, b) if comparable and alike else None,
            "champion_expressions": {
                joint: [text, other[joint]]
                for joint, text in mine.items()
                if joint in other and other[joint] != text
            },
        }

    @override
    def show(
        self, individual: Mapping[str, Any], spread: Mapping[str, Any] | None, console: Console
    ) -> None:
        table = titled_table(f"{title(individual)}: an expression per joint", console)
        for heading in ("joint", "nodes", "that matter", "expression"):
            table.add_column(heading, overflow="fold")
        sizes = individual["nodes"], individual["nodes_that_matter"]
        for (joint, text), nodes, matter in zip(
            individual["expressions"].items(), *sizes, strict=True
        ):
            table.add_row(joint, str(nodes), f"{matter} ({matter / nodes:.0%})", text)
        console.print(table)
        if spread:
            mean = np.mean(spread["nodes"]["mean"])
            console.print(f"the population's expressions have {mean:.1f} nodes in the mean")

    @override
    def show_difference(self, found: Mapping[str, Any], console: Console) -> None:
        print_shared(found, console)
        for joint, (mine, other) in found["champion_expressions"].items():
            console.print(f"{joint}:\n  A {mine}\n  B {other}")


def _texts(snapshot: Snapshot, i: int) -> dict[str, str]:
    known = every_terminal(snapshot.creature)
    rows = zip(snapshot.genomes["code"][i], snapshot.genomes["value"][i], strict=True)
    texts = (to_text(code, value, known) for code, value in rows)
    return dict(zip(snapshot.creature.joints.names, texts, strict=True))


def _mattering(snapshot: Snapshot, i: int) -> list[int]:
    """Return the number of nodes [J] left in each expression after simplification."""
    genome = {name: array[i] for name, array in snapshot.genomes.items()}
    settled = serializer_of("program").settled(genome, snapshot.creature)
    return [int(count) for count in (settled["code"] != EMPTY).sum(axis=1)]


def _nodes(snapshot: Snapshot) -> np.ndarray:
    """Return the nodes [P, J] of each expression."""
    return np.asarray((snapshot.genomes["code"] != EMPTY).sum(axis=2))
