"""Reference controller for expressions: interprets their text (docs/reference/expressions.md).

Letters: `S` simulations, `J` actuated joints.
"""

import functools
import re
from collections.abc import Callable, Mapping
from typing import Any, ClassVar

import numpy as np

from mjxgait.champion import Champion, serializer_of
from mjxgait.creature import Creature
from mjxgait.reference.controllers import Command, Memory

Expression = str | float | tuple[Any, ...]
"""Name of an observation, a number, or a function with its arguments."""
NAMED = {
    "t": "time",
    "vx": "forward_vel",
    "vz": "up_vel",
    "px": "forward",
    "py": "aside",
    "pz": "trunk_height",
    "s0": "goal_distance",
    "b0": "bar_distance",
}
PARTS = {"a": "joint_pos", "w": "joint_vel", "c": "contact"}
"""Observations by the letter before the number of a joint or a foot."""


def _over(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    small = np.abs(b) < 1e-6
    return np.where(small, 1.0, a / np.where(small, 1.0, b))


FUNCTIONS: Mapping[str, Callable[..., Any]] = {
    "+": np.add,
    "-": np.subtract,
    "*": np.multiply,
    "/": _over,
    "ifltz": lambda a, b, c: np.where(a < 0, b, c),
    "min": np.minimum,
    "max": np.maximum,
    "abs": np.abs,
    "sin": np.sin,
    "cos": np.cos,
}
VALUE_LIMIT = 1e9


def read(text: str) -> Expression:
    """Parse an expression from valid text."""
    words = re.findall(r"[()]|[^\s()]+", text)

    def next_one() -> Expression:
        word = words.pop(0)
        if word != "(":
            return word if re.match(r"[a-z]", word) else float(word)
        parts: list[Expression] = [words.pop(0)]
        while words[0] != ")":
            parts.append(next_one())
        words.pop(0)
        return tuple(parts)

    return next_one()


@functools.cache
def sense_of(name: str) -> tuple[str, int | None]:
    """Return the observation that a name means, and the index in it."""
    if found := re.fullmatch(r"([awc])(\d+)", name):
        return PARTS[found[1]], int(found[2])
    return NAMED.get(name, name), None


def names_in(expression: Expression) -> set[str]:
    """Return the names of the observations that an expression reads."""
    if isinstance(expression, tuple):
        return set().union(*(names_in(part) for part in expression[1:]))
    return {expression} if isinstance(expression, str) else set()


def value_of(expression: Expression, senses: Mapping[str, np.ndarray]) -> np.ndarray:
    """Return the value [S] of an expression under observations by name."""
    if isinstance(expression, float):
        return np.array(expression)
    if isinstance(expression, str):
        sense, part = sense_of(expression)
        return senses[sense] if part is None else senses[sense][:, part]
    function, *arguments = expression
    value = FUNCTIONS[function](*[value_of(argument, senses) for argument in arguments])
    # np.clip takes three times as long for so few numbers.
    return np.minimum(np.maximum(value, -VALUE_LIMIT), VALUE_LIMIT)


class ExpressionReference:
    """Implementation of `ReferenceController`. Its memory holds only the number of simulations."""

    command: ClassVar[Command] = "pose"

    def __init__(self, creature: Creature, champion: Champion, step: float) -> None:
        document = serializer_of("program").document(champion.genome, champion.settings, creature)
        texts = document["expressions"]
        self.creature, self.every = creature, int(champion.settings.every)
        self.expressions = [read(texts[joint]) for joint in creature.joints.names]
        names = set().union(*map(names_in, self.expressions))
        # The time is always read, to give the number of simulations.
        self.reads = tuple(sorted({"time", *(sense_of(name)[0] for name in names)}))

    def init(self, count: int) -> Memory:
        """See `ReferenceController`."""
        return {"still": np.zeros(count)}

    def act(self, memory: Memory, senses: Mapping[str, np.ndarray]) -> tuple[np.ndarray, Memory]:
        """See `ReferenceController`."""
        count = len(senses["time"])
        rows = [np.broadcast_to(value_of(e, senses), count) for e in self.expressions]
        angles = np.stack(rows, axis=1)
        return np.clip(
            angles, self.creature.joints.pose_low, self.creature.joints.pose_high
        ), memory

    def phase(self, memory: Memory) -> np.ndarray:
        """Return NaN: there is no cycle."""
        return np.full(len(memory["still"]), np.nan)
