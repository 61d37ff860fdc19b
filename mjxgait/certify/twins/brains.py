"""The brain of a creature of blocks, neuron by neuron, written from docs/blocks.md.

Letters: `S` simulations, `J` hinges in the model's order. A neuron is known by its owner, the number
of a part or `CENTRE`, and which of the owner's it is.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, ClassVar

import numpy as np

from mjxgait.certify.twins.protocol import Command, Memory
from mjxgait.champion.blocks.material import NEURONS, SENSORS
from mjxgait.champion.blocks.parts import Part

CENTRE = -1
TICKS = 2
MOST, LOUDEST = 10.0, 100.0
Neuron = tuple[int, int]
Values = Any
"""An array [S]."""


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
    "expt": lambda a, b, c, m, dt: np.exp(np.clip(b * _log(a), -MOST, np.log(MOST))),
    "sigmoid": lambda a, b, c, m, dt: 1 / (1 + np.exp(-a)),
    "integrate": lambda a, b, c, m, dt: m + dt * a,
    "differentiate": lambda a, b, c, m, dt: (a - m) / dt,
    "smooth": lambda a, b, c, m, dt: _following(a, m, dt),
    "memory": lambda a, b, c, m, dt: np.where(b > 0, a, m),
    "oscillate-wave": lambda a, b, c, m, dt: np.sin(2 * np.pi * (_phase(b, m, dt) + a)),
    "oscillate-saw": lambda a, b, c, m, dt: 2 * np.mod(_phase(b, m, dt) + a, 1.0) - 1,
}
"""Of three inputs, the memory and the time of a tick in s."""
KEPT: Mapping[str, Callable[..., Values]] = {
    "integrate": FUNCTIONS["integrate"],
    "differentiate": lambda a, b, c, m, dt: a,
    "smooth": FUNCTIONS["smooth"],
    "memory": FUNCTIONS["memory"],
    "oscillate-wave": lambda a, b, c, m, dt: _phase(b, m, dt),
    "oscillate-saw": lambda a, b, c, m, dt: _phase(b, m, dt),
}
"""What a neuron remembers of a tick; the others remember nothing."""


def fire(kind: str, inputs: Sequence[Values], memory: Values, dt: float) -> tuple[Values, Values]:
    """Output and memory of a neuron. dt: s of a tick."""
    a, b, c = (np.clip(x, -LOUDEST, LOUDEST) for x in inputs)
    kept = KEPT[kind](a, b, c, memory, dt) if kind in KEPT else memory
    output = FUNCTIONS[kind](a, b, c, memory, dt)
    return np.clip(output, -MOST, MOST), np.clip(kept, -MOST, MOST)


class BrainTwin:
    """See `Twin`.

    genome: its arrays by name. parts: grown from it. hinges: of each joint of the model, its part
    and which of the part's it is. step: s between two commands.
    """

    command: ClassVar[Command] = "torque"
    every: ClassVar[int] = 1
    reads: ClassVar[tuple[str, ...]] = ("joint_pos", "contact", "light")

    def __init__(
        self,
        genome: Mapping[str, np.ndarray],
        parts: Sequence[Part],
        hinges: Sequence[tuple[int, int]],
        step: float,
    ) -> None:
        self.genome, self.parts, self.hinges, self.step = genome, parts, tuple(hinges), step
        self.local = genome["nerves.kind"].shape[1]
        owned = [(p, q) for p in range(len(parts)) for q in range(self.local)]
        self.neurons = [*owned, *((CENTRE, q) for q in range(len(genome["centre.kind"])))]
        self.place = {neuron: i for i, neuron in enumerate(self.neurons)}
        self.child: dict[int, int] = {}
        for number, part in enumerate(parts):
            self.child.setdefault(part.parent, number)

    def init(self, count: int) -> Memory:
        """See `Twin`."""
        none = np.zeros((count, len(self.neurons)))
        return {"values": none, "memory": none}

    def act(self, memory: Memory, senses: Mapping[str, np.ndarray]) -> tuple[np.ndarray, Memory]:
        """See `Twin`."""
        values, kept, dt = memory["values"], memory["memory"], self.step / TICKS
        for _ in range(TICKS):
            fired = [
                fire(*self._inputs(neuron, values, senses), kept[:, i], dt)
                for i, neuron in enumerate(self.neurons)
            ]
            values, kept = (np.stack([f[k] for f in fired], axis=1) for k in (0, 1))
        torque = [self._pull(part, hinge, values, senses) for part, hinge in self.hinges]
        return np.stack(torque, axis=1), {"values": values, "memory": kept}

    def phase(self, memory: Memory) -> np.ndarray:
        """See `Twin`: it has no cycle."""
        return np.full(len(memory["values"]), np.nan)

    def _inputs(
        self, neuron: Neuron, values: np.ndarray, senses: Mapping[str, np.ndarray]
    ) -> tuple[str, list[Values]]:
        """A neuron's function, and its weighted inputs."""
        owner, which = neuron
        if owner == CENTRE:
            kinds, sources, weights = (
                self.genome[f"centre.{x}"] for x in ("kind", "source", "weight")
            )
        else:
            node = self.parts[owner].node
            kinds, sources, weights = (
                self.genome[f"nerves.{x}"][node] for x in ("kind", "source", "weight")
            )
        kind, reader = NEURONS[int(kinds[which])], max(owner, 0)
        found = [self._source(reader, int(code), values, senses) for code in sources[which]]
        return kind, [w * x for w, x in zip(weights[which], found, strict=True)]

    def _source(
        self, part: int, code: int, values: np.ndarray, senses: Mapping[str, np.ndarray]
    ) -> Values:
        """What a part finds behind a source's number."""
        if code == 0:
            return np.ones(len(values))
        if code <= SENSORS:
            return self._sensed(part, code - 1, senses)
        code -= 1 + SENSORS
        owners = (part, self.parts[part].parent if part else None, self.child.get(part))
        if code >= 3 * self.local:
            return values[:, self.place[CENTRE, code - 3 * self.local]]
        owner = owners[code // self.local]
        if owner is None:
            return np.zeros(len(values))
        return values[:, self.place[owner, code % self.local]]

    def _sensed(self, part: int, sensor: int, senses: Mapping[str, np.ndarray]) -> Values:
        """Three hinges, contact, the light along three axes; seen in a mirror by a mirror image."""
        own = self.parts[part]
        if sensor < 3:
            if (part, sensor) not in self.hinges:
                return np.zeros(len(senses["joint_pos"]))
            joint = self.hinges.index((part, sensor))
            return _sign(own, sensor) * senses["joint_pos"][:, joint]
        if sensor == 3:
            return senses["contact"][:, part]
        flip = -1.0 if own.mirrored and sensor == 5 else 1.0
        return flip * senses["light"][:, part, sensor - 4]

    def _pull(
        self, part: int, hinge: int, values: np.ndarray, senses: Mapping[str, np.ndarray]
    ) -> Values:
        """[S] N·m of a hinge."""
        own = self.parts[part]
        code = int(self.genome["nerves.effect_source"][own.node, hinge])
        weight = float(self.genome["nerves.effect_weight"][own.node, hinge])
        wanted = np.clip(weight * self._source(part, code, values, senses), -1.0, 1.0)
        return own.strength * _sign(own, hinge) * wanted


def _sign(part: Part, hinge: int) -> float:
    """-1 where a mirror image turns the other way: about all its axes but the one it is mirrored along."""
    return -1.0 if part.mirrored and part.hinges[hinge] != 1 else 1.0
