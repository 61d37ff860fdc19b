"""A brain once more, neuron by neuron, from the genotype and the parts: the reference of the arrays'."""

import math

import numpy as np

from mjxgait.blocks.nerves import Centre, NerveRoom, Nerves
from mjxgait.blocks.phenotype import Body
from mjxgait.champion.blocks.material import NEURONS


def fire(name: str, a: float, b: float, c: float, memory: float, dt: float) -> tuple[float, float]:
    """Output and memory of one neuron."""
    turn = (memory + dt * b) % 1.0
    follow = memory + (a - memory) * (1 - math.exp(-5 * dt))
    log = math.log(max(abs(a), 1e-3))
    table = {
        "sum": lambda: a + b + c,
        "product": lambda: a * b * c,
        "divide": lambda: a / b if abs(b) >= 1e-3 else 0.0,
        "sum-threshold": lambda: float(a + b > c),
        "greater-than": lambda: float(a > b),
        "sign-of": lambda: float(np.sign(a)),
        "min": lambda: min(a, b),
        "max": lambda: max(a, b),
        "abs": lambda: abs(a),
        "if": lambda: b if a > 0 else c,
        "interpolate": lambda: a + (b - a) * min(max(c, 0.0), 1.0),
        "sin": lambda: math.sin(a),
        "cos": lambda: math.cos(a),
        "atan": lambda: math.atan(a),
        "log": lambda: log,
        "expt": lambda: math.exp(min(max(b * log, -10.0), math.log(10.0))),
        "sigmoid": lambda: 1 / (1 + math.exp(-a)),
        "integrate": lambda: memory + dt * a,
        "differentiate": lambda: (a - memory) / dt,
        "smooth": lambda: follow,
        "memory": lambda: a if b > 0 else memory,
        "oscillate-wave": lambda: math.sin(2 * math.pi * (turn + a)),
        "oscillate-saw": lambda: 2 * ((turn + a) % 1.0) - 1,
    }
    kept = {
        "integrate": memory + dt * a,
        "differentiate": a,
        "smooth": follow,
        "memory": a if b > 0 else memory,
        "oscillate-wave": turn,
        "oscillate-saw": turn,
    }
    bound = lambda x: min(max(x, -10.0), 10.0)  # noqa: E731
    return bound(table[name]()), bound(kept.get(name, memory))


class PlainBrain:
    """Arrays of one body, in NumPy."""

    def __init__(self, nerves: Nerves, centre: Centre, body: Body, room: NerveRoom) -> None:
        self.nerves, self.centre, self.body, self.room = nerves, centre, body, room
        self.parts = [int(p) for p in np.flatnonzero(body.parts.exists)]
        self.values = {(p, q): 0.0 for p in [*self.parts, "centre"] for q in range(9)}
        self.memory = dict(self.values)

    def source(self, part: int, code: int, seen: dict) -> float:
        """What a part finds behind a source's number."""
        local, parts = self.room.local, self.body.parts
        flip = -1.0 if parts.copies[part] else 1.0
        if code == 0:
            return 1.0
        code -= 1
        if code < 3:
            return seen["angle"].get((part, code), 0.0)
        if code == 3:
            return float(seen["contact"][parts.last[part]])
        if code < 7:
            return float(seen["light"][parts.last[part], code - 4]) * (flip if code == 5 else 1.0)
        code -= 7
        if code < local:
            return self.values[part, code]
        if code < 2 * local:
            return self.values[int(parts.parent[part]), code - local] if part else 0.0
        if code < 3 * local:
            children = [p for p in self.parts if p and parts.parent[p] == part]
            return self.values[children[0], code - 2 * local] if children else 0.0
        return self.values["centre", code - 3 * local]

    def step(self, angles: np.ndarray, contact: np.ndarray, light: np.ndarray, dt: float) -> dict:
        """Torque by (part, hinge)."""
        body, nerves, centre = self.body, self.nerves, self.centre
        hinges = {
            (int(body.part[link]), int(body.hinge[link])): link
            for link in np.flatnonzero(body.tree.moves)
        }
        angle = {key: float(angles[link] * body.sign[link]) for key, link in hinges.items()}
        seen = {"angle": angle, "contact": contact, "light": light}
        for _ in range(2):
            after, kept = {}, {}
            for part in self.parts:
                node = int(body.parts.node[part])
                for q in range(self.room.local):
                    genes = nerves.kind[node, q], nerves.source[node, q], nerves.weight[node, q]
                    after[part, q], kept[part, q] = self.fired(part, q, part, genes, seen, dt / 2)
            for q in range(self.room.central):
                genes = centre.kind[q], centre.source[q], centre.weight[q]
                after["centre", q], kept["centre", q] = self.fired(
                    "centre", q, 0, genes, seen, dt / 2
                )
            self.values |= after
            self.memory |= kept
        torque = {}
        for (part, hinge), link in hinges.items():
            node = int(body.parts.node[part])
            value = self.source(part, int(nerves.effect_source[node, hinge]), seen)
            pull = nerves.effect_weight[node, hinge] * body.strength[link] * body.sign[link]
            torque[part, hinge] = float(pull * min(max(value, -1.0), 1.0))
        return torque

    def fired(self, owner, q: int, part: int, genes, seen: dict, dt: float) -> tuple[float, float]:
        """One neuron's output and memory; part: whose sources it reads."""
        kind, sources, weights = genes
        inputs = [
            self.source(part, int(code), seen) * float(weight)
            for code, weight in zip(sources, weights, strict=True)
        ]
        return fire(NEURONS[int(kind)], *inputs, self.memory[owner, q], dt)
