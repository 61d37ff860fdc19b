"""Reference controller for brains, neuron by neuron, from docs/reference/modular-bodies.md.

Letters: `S` simulations, `J` hinges in the model's order. A neuron is identified by its owner (a
part number or `CENTRE`) and its index there.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, ClassVar

import numpy as np

from mjxgait.champion import Champion
from mjxgait.controllers.sims_brain.reference_body import (
    NEURONS,
    SENSORS,
    THEIRS,
    Part,
    grow,
    opponent_genome,
)
from mjxgait.creature import Creature
from mjxgait.reference.controllers import Command, Memory
from mjxgait.reference.state import OWN_CONTACT

CENTRE = -1
LIGHT = (4, 5, 6)
"""Numbers of a part's three sensors of light; see `BrainReference._sensor`."""
TICKS = 2
VALUE_LIMIT, INPUT_LIMIT = 10.0, 100.0
Neuron = tuple[int, int]
Values = Any
"""Array [S, ...] of neurons of one kind."""


def _following(a: Values, memory: Values, dt: float) -> Values:
    return memory + (a - memory) * (1 - np.exp(-5.0 * dt))


def _phase(b: Values, memory: Values, dt: float) -> Values:
    return np.mod(memory + dt * b, 1.0)


def _log(a: Values) -> Values:
    return np.log(np.maximum(np.abs(a), 1e-3))


def _over(a: Values, b: Values) -> Values:
    small = np.abs(b) < 1e-3
    return np.where(small, 0.0, a / np.where(small, 1.0, b))


FUNCTIONS: Mapping[str, Callable[..., Values]] = {
    "sum": lambda a, b, c, m, dt: a + b + c,
    "product": lambda a, b, c, m, dt: a * b * c,
    "divide": lambda a, b, c, m, dt: _over(a, b),
    "sum-threshold": lambda a, b, c, m, dt: np.where(a + b > c, 1.0, 0.0),
    "greater-than": lambda a, b, c, m, dt: np.where(a > b, 1.0, 0.0),
    "sign-of": lambda a, b, c, m, dt: np.sign(a),
    "min": lambda a, b, c, m, dt: np.minimum(a, b),
    "max": lambda a, b, c, m, dt: np.maximum(a, b),
    "abs": lambda a, b, c, m, dt: np.abs(a),
    "if": lambda a, b, c, m, dt: np.where(a > 0, b, c),
    "interpolate": lambda a, b, c, m, dt: a + (b - a) * np.clip(c, 0.0, 1.0),
    "sin": lambda a, b, c, m, dt: np.sin(a),
    "cos": lambda a, b, c, m, dt: np.cos(a),
    "atan": lambda a, b, c, m, dt: np.arctan(a),
    "log": lambda a, b, c, m, dt: _log(a),
    "expt": lambda a, b, c, m, dt: np.exp(np.clip(b * _log(a), -VALUE_LIMIT, np.log(VALUE_LIMIT))),
    "sigmoid": lambda a, b, c, m, dt: 1 / (1 + np.exp(-a)),
    "integrate": lambda a, b, c, m, dt: m + dt * a,
    "differentiate": lambda a, b, c, m, dt: (a - m) / dt,
    "smooth": lambda a, b, c, m, dt: _following(a, m, dt),
    "memory": lambda a, b, c, m, dt: np.where(b > 0, a, m),
    "oscillate-wave": lambda a, b, c, m, dt: np.sin(2 * np.pi * (_phase(b, m, dt) + a)),
    "oscillate-saw": lambda a, b, c, m, dt: 2 * np.mod(_phase(b, m, dt) + a, 1.0) - 1,
}
"""Outputs from three inputs, the memory and the time of a tick in s."""
KEPT: Mapping[str, Callable[..., Values]] = {
    "integrate": FUNCTIONS["integrate"],
    "differentiate": lambda a, b, c, m, dt: a,
    "smooth": FUNCTIONS["smooth"],
    "memory": FUNCTIONS["memory"],
    "oscillate-wave": lambda a, b, c, m, dt: _phase(b, m, dt),
    "oscillate-saw": lambda a, b, c, m, dt: _phase(b, m, dt),
}
"""Memory after a tick; all other neurons have no memory."""


def fire(kind: str, inputs: Sequence[Values], memory: Values, dt: float) -> tuple[Values, Values]:
    """Return a neuron's output and memory. dt: s of a tick."""
    a, b, c = (np.clip(x, -INPUT_LIMIT, INPUT_LIMIT) for x in inputs)
    kept = KEPT[kind](a, b, c, memory, dt) if kind in KEPT else memory
    output = FUNCTIONS[kind](a, b, c, memory, dt)
    return np.clip(output, -VALUE_LIMIT, VALUE_LIMIT), np.clip(kept, -VALUE_LIMIT, VALUE_LIMIT)


class BrainReference:
    """Implementation of `ReferenceController`.

    genome: its arrays by name. parts: grown from it. hinges: part and hinge index of each joint of
    the model. step: s of the simulation. every: steps per command.
    A wire leads from a column to a neuron or a hinge. The columns: nothing, the constant 1, the
    angles of all hinges, contact and light of all parts, the values of all neurons. lit: [J, 3]
    columns of the light that steers each hinge. steer: see `Nerves`; None without. skill: number of
    the effectors that act. touch: whether contact is also that with other blocks of the body.
    children: number of child parts that a part can hear.
    """

    command: ClassVar[Command] = "torque"

    def __init__(
        self,
        genome: Mapping[str, np.ndarray],
        parts: Sequence[Part],
        hinges: Sequence[tuple[int, int]],
        step: float,
        every: int = 1,
        skill: int = 0,
        touch: bool = False,
        children: int = 1,
    ) -> None:
        senses = ("joint_pos", "contact", "light")
        self.reads: tuple[str, ...] = (*senses, OWN_CONTACT) if touch else senses
        self.genome, self.parts, self.hinges = genome, parts, tuple(hinges)
        self.every, self.pause = every, step * every
        self.local, self.skill = genome["nerves.kind"].shape[1], skill
        owned = [(p, q) for p in range(len(parts)) for q in range(self.local)]
        neurons = [*owned, *((CENTRE, q) for q in range(len(genome["centre.kind"])))]
        first = 2 + len(hinges) + 4 * len(parts)
        self.place = {neuron: first + i for i, neuron in enumerate(neurons)}
        self.heard = [_children(parts, number, children) for number in range(len(parts))]
        kinds = [NEURONS[int(self._gene("kind", neuron))] for neuron in neurons]
        self.alike = {kind: np.flatnonzero(np.array(kinds) == kind) for kind in set(kinds)}
        wires = [self._wires(neuron) for neuron in neurons]
        self.column = np.array([[column for column, _ in three] for three in wires])
        self.weight = np.array([[weight for _, weight in three] for three in wires])
        pulls = [self._pull(part, hinge) for part, hinge in self.hinges]
        self.driver = np.array([column for column, _, _ in pulls], int)
        self.gain = np.array([gain for _, gain, _ in pulls])
        self.strength = np.array([strength for _, _, strength in pulls])
        lights = [[self._sensor(part, axis) for axis in LIGHT] for part, _ in self.hinges]
        columns = np.array([[column for column, _ in three] for three in lights], int)
        self.lit = columns.reshape(-1, 3)
        flips = np.array([[flip for _, flip in three] for three in lights])
        self.steer = self._steer(flips)

    def init(self, count: int) -> Memory:
        """See `ReferenceController`."""
        shape = (count, len(self.place))
        # Two arrays, since callers write into each.
        return {"values": np.zeros(shape), "memory": np.zeros(shape)}

    def act(self, memory: Memory, senses: Mapping[str, np.ndarray]) -> tuple[np.ndarray, Memory]:
        """See `ReferenceController`."""
        values, kept, dt = memory["values"], memory["memory"], self.pause / TICKS
        sensed = self._sensed(senses)
        for _ in range(TICKS):
            inputs = np.concatenate([sensed, values], axis=1)[:, self.column] * self.weight
            after, kept_after = np.empty_like(values), np.empty_like(kept)
            for kind, these in self.alike.items():
                three = np.moveaxis(inputs[:, these], 2, 0)
                after[:, these], kept_after[:, these] = fire(kind, three, kept[:, these], dt)
            values, kept = after, kept_after
        wanted = self.gain * np.concatenate([sensed, values], axis=1)[:, self.driver]
        if self.steer is not None:
            light = sensed[:, self.lit]
            wanted = wanted * (1 + (light * self.steer[:, 1]).sum(2))
            wanted = wanted + (light * self.steer[:, 0]).sum(2)
        torque = self.strength * np.clip(wanted, -1.0, 1.0)
        return torque, {"values": values, "memory": kept}

    def phase(self, memory: Memory) -> np.ndarray:
        """Return NaN: there is no cycle."""
        return np.full(len(memory["values"]), np.nan)

    def _sensed(self, senses: Mapping[str, np.ndarray]) -> np.ndarray:
        """Return the columns before the neurons'. Without a light, its columns are zero."""
        count = len(senses["joint_pos"])
        dark = np.zeros((count, len(self.parts), 3))
        light = senses.get("light", dark).reshape(count, -1)
        ends = np.tile([0.0, 1.0], (count, 1))
        return np.concatenate([ends, senses["joint_pos"], senses["contact"], light], axis=1)

    def _gene(self, name: str, neuron: Neuron) -> Any:
        owner, which = neuron
        if owner == CENTRE:
            return self.genome[f"centre.{name}"][which]
        return self.genome[f"nerves.{name}"][self.parts[owner].node][which]

    def _wires(self, neuron: Neuron) -> list[tuple[int, float]]:
        """Return column and weight of a neuron's inputs; central ones have the root's sources."""
        sources, weights = self._gene("source", neuron), self._gene("weight", neuron)
        found = [self._source(max(neuron[0], 0), int(code)) for code in sources]
        return [(column, sign * w) for (column, sign), w in zip(found, weights, strict=True)]

    def _source(self, part: int, code: int) -> tuple[int, float]:
        """Return the column and sign of a part's source code."""
        if code == 0:
            return 1, 1.0
        if code <= SENSORS:
            return self._sensor(part, code - 1)
        code -= 1 + SENSORS
        owners = (part, self.parts[part].parent if part else None, *self.heard[part])
        if code >= len(owners) * self.local:
            return self.place[CENTRE, code - len(owners) * self.local], 1.0
        owner = owners[code // self.local]
        return (0, 1.0) if owner is None else (self.place[owner, code % self.local], 1.0)

    def _sensor(self, part: int, sensor: int) -> tuple[int, float]:
        """Return column and sign of a sensor: three hinges, contact, the light along three axes.

        A mirror image observes mirrored values.
        """
        own, joints, count = self.parts[part], len(self.hinges), len(self.parts)
        if sensor < 3:
            if (part, sensor) not in self.hinges:
                return 0, 1.0
            return 2 + self.hinges.index((part, sensor)), _sign(own, sensor)
        if sensor == 3:
            return 2 + joints + part, 1.0
        flip = -1.0 if own.mirrored and sensor == 5 else 1.0
        return 2 + joints + count + 3 * part + sensor - 4, flip

    def _pull(self, part: int, hinge: int) -> tuple[int, float, float]:
        """Return column and weight of a hinge's drive, and its largest torque in N·m (signed)."""
        own = self.parts[part]
        first = self.skill == 0
        kind, place = ("effect", ()) if first else ("other", (self.skill - 1,))
        code, weight = (
            self.genome[f"nerves.{kind}_{name}"][own.node, hinge, *place]
            for name in ("source", "weight")
        )
        column, sign = self._source(part, int(code))
        weight = sign * float(weight)
        return column, weight, own.strength * _sign(own, hinge)

    def _steer(self, flips: np.ndarray) -> np.ndarray | None:
        """Return the weights [J, 2, 3] of the light, if the genome has any. flips: [J, 3] signs."""
        genes = self.genome.get("nerves.steer")
        if genes is None:
            return None
        own = [genes[self.parts[part].node, hinge] for part, hinge in self.hinges]
        return np.reshape(own, (-1, 2, 3)) * np.reshape(flips, (-1, 1, 3))


def _children(parts: Sequence[Part], parent: int, count: int) -> list[int | None]:
    """Return the numbers of a part's first children, in order; None for each that it lacks."""
    own = [number for number, part in enumerate(parts) if part.parent == parent]
    return [*own, *[None] * count][:count]


def _sign(part: Part, hinge: int) -> float:
    """Return -1 for hinges of a mirror image, except about the axis of mirroring; else 1."""
    return -1.0 if part.mirrored and part.hinges[hinge] != 1 else 1.0


def brain_reference(creature: Creature, champion: Champion, step: float) -> BrainReference:
    """Return the brain of a champion; its grown creature names its hinges like `part3_0`."""
    return _reference(champion.genome, champion.settings, creature.joints.names, step)


def opponent_reference(creature: Creature, champion: Champion, step: float) -> BrainReference:
    """Return the brain of a champion's opponent, in the order of its hinges in the model."""
    model = creature.model
    names = [model.joint(j).name for j in range(model.njnt)]
    theirs = [n.removeprefix(THEIRS) for n in names if n.startswith(f"{THEIRS}part")]
    return _reference(opponent_genome(champion.genome), champion.settings, theirs, step)


def _reference(
    genome: Mapping[str, np.ndarray], settings: Any, names: Sequence[str], step: float
) -> BrainReference:
    """Return a brain. settings: of the controller. names: of its hinges."""
    parts = grow(genome, settings.parts, settings.links)
    numbers = [name.removeprefix("part").split("_") for name in names]
    hinges = [(int(part), int(hinge)) for part, hinge in numbers]
    return BrainReference(
        genome,
        parts,
        hinges,
        step,
        every=settings.every,
        skill=settings.skill,
        touch=settings.touch,
        children=settings.children,
    )
