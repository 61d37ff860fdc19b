"""Serializer for genomes of expressions, one per joint, as text."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from typing_extensions import override

from mjxgait.champion.serializers import PlainSerializer
from mjxgait.config.tables import build
from mjxgait.controllers.expressions.config import MOST_NODES, ProgramConfig
from mjxgait.controllers.expressions.parse import (
    DEEPEST,
    Vocabulary,
    read_programs,
    to_arrays,
)
from mjxgait.controllers.expressions.text import (
    HasParts,
    chosen_terminals,
    every_terminal,
    in_text,
    nested,
    simplified,
    terminals,
    to_text,
)
from mjxgait.creature import Creature
from mjxgait.errors import UserError


class ExpressionSerializer(PlainSerializer[ProgramConfig]):
    """Serializer for genomes with `code` and `value` [J, C]; see `Serializer`."""

    def document(
        self, genome: Mapping[str, np.ndarray], settings: ProgramConfig, creature: Creature
    ) -> dict[str, object]:
        """Implementation of `Serializer`. expressions: by joint. nodes: most per expression."""
        known = every_terminal(creature)
        rows = zip(creature.joints.names, genome["code"], genome["value"], strict=True)
        return {
            "expressions": {name: to_text(code, value, known) for name, code, value in rows},
            "nodes": int(genome["code"].shape[1]),
        }

    def settled(
        self, genome: Mapping[str, np.ndarray], creature: Creature
    ) -> dict[str, np.ndarray]:
        """Simplified, then written as text and read back."""
        known, nodes = every_terminal(creature), genome["code"].shape[1]
        pairs = zip(genome["code"], genome["value"], strict=True)
        rows = []
        for code, value in pairs:
            text = in_text(simplified(nested(code, value, known)))
            rows.append(to_arrays(text, known, nodes, "an expression"))
        code, value = (np.stack(parts) for parts in zip(*rows, strict=True))
        return {"code": code, "value": value}

    @override
    def genome(self, document: Mapping[str, Any], creature: Creature) -> dict[str, np.ndarray]:
        known, nodes = every_terminal(creature), int(document["nodes"])
        if not 1 <= nodes <= MOST_NODES:
            raise ValueError(f"nodes = {nodes}: an expression has 1 to {MOST_NODES}")
        texts = document["expressions"]
        if missing := [name for name in creature.joints.names if name not in texts]:
            raise UserError(f'no expression for joint "{missing[0]}"')
        pairs = [
            to_arrays(str(texts[name]), known, nodes, f'expression of joint "{name}"')
            for name in creature.joints.names
        ]
        code, value = (np.stack(rows) for rows in zip(*pairs, strict=True))
        return {"code": code, "value": value}

    @override
    def settings(self, table: Mapping[str, object], where: str) -> ProgramConfig:
        return build(ProgramConfig, table, where)

    @override
    def check(self, genome: Mapping[str, np.ndarray], creature: Creature) -> None:
        for j, place in np.argwhere(~np.isfinite(genome["value"])):
            raise UserError(
                f'the expression of joint "{creature.joints.names[j]}" has a constant that is '
                f"{genome['value'][j, place]}: this champion cannot move; take one of another "
                "generation"
            )

    @override
    def shapes(self, settings: ProgramConfig, creature: Creature) -> dict[str, tuple[int, ...]]:
        shape = (len(creature.joints.names), settings.nodes)
        return {"code": shape, "value": shape}


def vocabulary(
    body: HasParts, settings: ProgramConfig, added: Sequence[str], depth: int = DEEPEST
) -> Vocabulary:
    """Return the vocabulary of programs under settings, plain or traced.

    added: observations that the task adds. depth: most nested functions.
    """
    known = terminals(body, added)
    return Vocabulary(
        known,
        settings.nodes,
        senses=tuple(terminal.name for terminal in chosen_terminals(known, settings.senses)),
        functions=settings.functions,
        patterns=settings.senses,
        depth=min(depth, DEEPEST),
    )


def programs_to_begin_with(
    body: HasParts, settings: ProgramConfig, added: Sequence[str], depth: int = DEEPEST
) -> tuple[np.ndarray, np.ndarray] | None:
    """Return code and value [G, J, C] of the programs in the settings; None if there are none.

    added, depth: see `vocabulary`.

    Raises:
      UserError: one of them is wrong.
    """
    limits, found = vocabulary(body, settings, added, depth), []
    for number, text in enumerate(settings.expressions, 1):
        where = f"controller.expressions: program {number}"
        found += read_programs(text, body.joints.names, limits, where, numbered=False)
    if not found:
        return None
    code, value = (np.stack(column) for column in zip(*found, strict=True))
    return code, value


def program_text(body: HasParts, program: tuple[np.ndarray, np.ndarray]) -> str:
    """Return a program, code and value [J, C], as `(list EXPRESSION ...)`."""
    known = every_terminal(body)
    rows = [to_text(code, value, known) for code, value in zip(*program, strict=True)]
    return f"(list {' '.join(rows)})"
