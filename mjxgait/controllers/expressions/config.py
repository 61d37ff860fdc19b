"""Settings of controllers that are expression trees."""

import dataclasses
from typing import Annotated

import pydantic

from mjxgait.config.tables import (
    SHAPE,
    STRICT,
    Fraction,
    Interval,
    NonNegative,
    Positive,
)
from mjxgait.controllers.config import check_every

FUNCTIONS = {
    "+": 2,
    "-": 2,
    "*": 2,
    "/": 2,
    "ifltz": 3,
    "min": 2,
    "max": 2,
    "abs": 1,
    "sin": 1,
    "cos": 1,
}
"""Functions with their number of arguments (docs/reference/expressions.md).

`/` is protected. `ifltz` returns its second argument if the first is below zero, else its third.
"""
MOST_NODES = 1024
"""Upper limit of the setting `nodes`."""


def _check_functions(names: tuple[str, ...]) -> tuple[str, ...]:
    for name in names:
        if name not in FUNCTIONS:
            raise ValueError(f'"{name}" is no function; there are {" ".join(FUNCTIONS)}')
    if len(set(names)) < len(names) or not names:
        raise ValueError("name at least one function, and none twice")
    return names


@dataclasses.dataclass(frozen=True)
class ProgramConfig:
    """Settings of controllers with one expression per joint as genome (Gritz & Hahn 1997).

    Attributes:
      functions: functions that an expression may use, besides constants and observations.
      every: control steps per evaluation; in between the angles stay.
      senses: name patterns of the observations that it may use; docs/reference/expressions.md lists
        them.
      nodes: most nodes of an expression.
      depth: greatest depth of an expression.
      initial_depth: depth range of the first expressions, half of them full and half grown.
      constants: range of the random constants.
      functions_cross: share of crossover points at functions, in trees that have one (Koza: 0.9).
      subtree: weight, relative to the other four, of mutations that insert a new subtree.
      point: weight of mutations that change a function or an observation.
      hoist: weight of mutations that replace the whole by a subtree.
      constant: weight of mutations that move a constant.
      nudge: weight of mutations that add a small constant to a subtree, or multiply it by one
        near 1.
      constant_sigma: size of constant moves and nudges, in units of the range; a hundredth of it
        is as likely.
      parsimony: fitness cost of each node.
      expressions: initial programs, each as `(list EXPRESSION ...)` with one expression per
        joint; the rest of the first generation is drawn. `mjxgait train --expressions` fills
        them in.
    """

    __pydantic_config__ = STRICT
    functions: Annotated[tuple[str, ...], pydantic.AfterValidator(_check_functions), SHAPE] = (
        "+",
        "-",
        "*",
        "/",
        "ifltz",
    )
    every: Annotated[int, pydantic.AfterValidator(check_every), SHAPE] = 4
    senses: Annotated[tuple[str, ...], SHAPE] = ("*",)
    nodes: Annotated[int, pydantic.Field(ge=3, le=MOST_NODES), SHAPE] = 128
    depth: Annotated[int, pydantic.Field(ge=1), SHAPE] = 17
    initial_depth: Annotated[tuple[int, int], SHAPE] = (2, 5)
    constants: Interval = (-1.0, 1.0)
    functions_cross: Fraction = 0.9
    subtree: NonNegative = 1.0
    point: NonNegative = 1.0
    hoist: NonNegative = 0.5
    constant: Positive = 2.0
    nudge: NonNegative = 3.0
    constant_sigma: NonNegative = 0.1
    parsimony: NonNegative = 0.0
    expressions: Annotated[tuple[str, ...], SHAPE] = ()

    def __post_init__(self) -> None:
        low, high = self.initial_depth
        if not 0 <= low <= high <= self.depth:
            raise ValueError(
                f"initial_depth = [{low}, {high}]: must be a range up to depth = {self.depth}"
            )
