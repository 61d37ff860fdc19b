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
from mjxgait.controllers.key_poses.config import holds

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
"""How many arguments each takes. `/` is protected; `ifltz` gives its second where the first is
below zero, else its third (docs/programs.md).
"""
MOST_NODES = 1024
"""That an expression may ever have."""


def _known(names: tuple[str, ...]) -> tuple[str, ...]:
    for name in names:
        if name not in FUNCTIONS:
            raise ValueError(f'"{name}" is no function; there are {" ".join(FUNCTIONS)}')
    if len(set(names)) < len(names) or not names:
        raise ValueError("name at least one function, and none twice")
    return names


@dataclasses.dataclass(frozen=True)
class ProgramConfig:
    """The controller whose genome is one expression per joint (Gritz & Hahn 1997).

    Attributes:
      functions: that an expression may use; besides them constants and senses.
      every: control steps from one evaluation to the next; in between the angles stay.
      senses: patterns of the names of senses that it may use; docs/programs.md lists them.
      nodes: the most that an expression may have.
      depth: the most that it may be deep.
      initial_depth: of the first expressions, half of them full and half grown.
      constants: range of the random constants.
      functions_cross: share of crossing points at functions, where there is one (Koza: 0.9).
      subtree: how often, relative to the other four, a mutation puts a new subtree.
      point: how often another function or sense.
      hoist: how often a subtree in place of the whole.
      constant: how often a moved constant.
      nudge: how often a small constant is added to a subtree, or one near 1 multiplied with it.
      constant_sigma: by how much constants move and subtrees are nudged, in units of the range;
        a hundredth of it is as likely.
      parsimony: fitness that each node costs.
      expressions: programs that the first generation begins with, each as `(list EXPRESSION ...)`
        with one expression per joint; the others are drawn. `mjxgait train --expressions` fills
        them in.
    """

    __pydantic_config__ = STRICT
    functions: Annotated[tuple[str, ...], pydantic.AfterValidator(_known), SHAPE] = (
        "+",
        "-",
        "*",
        "/",
        "ifltz",
    )
    every: Annotated[int, pydantic.AfterValidator(holds), SHAPE] = 4
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
