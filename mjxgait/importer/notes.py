"""Report of an import: changes, guesses, and what is dropped; names that every file can hold."""

import dataclasses
import re
from typing import Literal

import mujoco
import numpy as np

from mjxgait.creature.geometry import ancestors, subtree
from mjxgait.errors import listed

Confidence = Literal["high", "medium", "low"]


@dataclasses.dataclass(frozen=True)
class Change:
    """A difference from the file, and its reason."""

    what: str
    why: str


@dataclasses.dataclass(frozen=True)
class Guess:
    """A value that the file does not state. reason: the evidence for the guess."""

    what: str
    value: str
    confidence: Confidence
    reason: str


class Notes:
    """Changes and guesses of one import; each change is reported once."""

    def __init__(self) -> None:
        self.changes: list[Change] = []
        self.guesses: list[Guess] = []

    def change(self, what: str, why: str) -> None:
        """Report a change."""
        change = Change(one_line(what), one_line(why))
        if change not in self.changes:
            self.changes.append(change)

    def guess(self, what: str, value: str, confidence: Confidence, reason: str) -> None:
        """Report a guess; a later guess of the same thing replaces the earlier."""
        guess = Guess(one_line(what), one_line(value), confidence, one_line(reason))
        self.guesses = [g for g in self.guesses if g.what != guess.what]
        self.guesses.append(guess)

    def text(self) -> str:
        """Return the report in plain lines."""
        lines = (
            ["Changes:"] + [f"  - {c.what}: {c.why}" for c in self.changes] if self.changes else []
        )
        lines += ["Guesses (change them in creature.toml):"]
        lines += [f"  - {g.what} = {g.value}  [{g.confidence}] {g.reason}" for g in self.guesses]
        return "\n".join(lines)


def one_line(text: str) -> str:
    """Return a text that can stand in a comment and in any file.

    Control characters become spaces; bytes of a file name that are not Unicode become question
    marks.
    """
    readable = text.encode("utf-8", "surrogateescape").decode("utf-8", "replace")
    return re.sub(r"[\x00-\x1f\x7f-\x9f]", " ", readable)


def plain_names(names: list[str], fallback: list[str]) -> list[str]:
    """Return unique names that can stand in a shell pattern."""
    used: set[str] = set()
    result = []
    for name, other in zip(names, fallback, strict=True):
        plain = re.sub(r"[^A-Za-z0-9_.\-]+", "_", name).strip("_")[:60] or other
        unique, i = plain, 2
        while unique in used:
            unique, i = f"{plain}_{i}", i + 1
        used.add(unique)
        result.append(unique)
    return result


def report_dropped(model: mujoco.MjModel, notes: Notes) -> None:
    """Report the file's mechanisms that do not act on the creature."""
    for count, what, why in (
        (model.nu, "actuators", "joint torques are applied directly; their limits were read"),
        (model.ntendon, "tendons", "joint torques are applied directly"),
        (
            int((model.jnt_stiffness != 0).sum() + (model.dof_damping != 0).sum()),
            "springs and dampers",
            "the controller has its own",
        ),
        (
            int((model.dof_frictionloss != 0).sum()),
            "dry joint frictions",
            "the fast physics has none",
        ),
        (
            model.npair + model.nexclude,
            "contact pairs and exclusions",
            "shapes touch the floor only, not each other",
        ),
    ):
        if count:
            notes.change(f"{count} {what} dropped", why)
    notes.change(
        "the floor and all options replaced",
        "a flat floor; time step 5 ms, Newton solver, pyramidal friction: what every physics here "
        "can do",
    )


def report_left_out(model: mujoco.MjModel, bodies: list[int], notes: Notes) -> None:
    """Report the rest of the file's world: bodies other than these, geoms that can be touched."""
    own = {*bodies, *ancestors(model, bodies[0])}
    others = [b for b in range(1, model.nbody) if b not in own and model.body_parentid[b] == 0]
    touchable = (model.geom_contype | model.geom_conaffinity) != 0
    things = [
        g
        for g in np.flatnonzero(touchable & (model.geom_bodyid == 0))
        if int(model.geom_type[g]) != mujoco.mjtGeom.mjGEOM_PLANE
    ]
    names = [f'body "{model.body(b).name}" ({_content(model, b)})' for b in others]
    names += [f'geom "{model.geom(g).name or g}"' for g in things]
    if names:
        notes.change(f"left out: {listed(names)}", "a walk is evolved on a flat floor, alone")


def _content(model: mujoco.MjModel, top: int) -> str:
    """Mass and hinges of the tree below a body, in words."""
    inside = subtree(model, top)
    hinges = int(
        np.isin(model.jnt_bodyid[model.jnt_type == mujoco.mjtJoint.mjJNT_HINGE], inside).sum()
    )
    mass = f"{model.body_subtreemass[top]:.3g} kg"
    return f"{mass}, {hinges} joints: a creature of its own" if hinges > 1 else mass
