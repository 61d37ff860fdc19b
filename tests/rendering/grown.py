"""Bodies that grew from a graph, in motions that are made up."""

import dataclasses

import numpy as np

from mjxgait.champion import Champion
from mjxgait.config.layers import find_creature
from mjxgait.controllers.config import DriveConfig
from mjxgait.controllers.sims_brain.config import BrainConfig
from mjxgait.creature import load_creature
from mjxgait.reference.outcome import blank_film
from mjxgait.reference.starts import nominal_starts
from mjxgait.rendering.walk import Walk

STEP = 0.02


def graph() -> dict[str, np.ndarray]:
    """A root with a pair of limbs of node 1, each with a foot of node 2."""
    nodes = 3
    used, target = np.zeros((nodes, 1), bool), np.zeros((nodes, 1), int)
    used[0], used[1] = True, True
    target[0], target[1] = 1, 2
    return {
        "graph.half": np.array([[0.20, 0.12, 0.08], [0.15, 0.05, 0.04], [0.06, 0.06, 0.03]]),
        "graph.joint": np.array([0, 1, 1]),
        "graph.swing": np.ones((nodes, 3)),
        "graph.recursion": np.zeros(nodes, int),
        "graph.used": used,
        "graph.target": target,
        "graph.place": np.array([[[0.2, 1.0, 0.1]], [[1.0, 0.0, 0.0]], [[1.0, 0.0, 0.0]]]),
        "graph.turn": np.zeros((nodes, 1, 3)),
        "graph.scale": np.ones((nodes, 1)),
        "graph.mirror": np.array([[2], [0], [0]]),
        "graph.terminal": np.zeros((nodes, 1), bool),
    }


def grown_walk(
    task: str, way: np.ndarray, light: tuple[float, float, float] = (0.0, 0.0, 0.0)
) -> Walk:
    """A walk of this body that spins while its root goes along a way [T, 3] m from its start."""
    blocks = load_creature(find_creature("blocks"))
    champion = Champion(
        creature=blocks.name,
        digest=blocks.digest,
        controller="brain",
        genome=graph(),
        settings=BrainConfig(nodes=3, connections=1),
        drive=DriveConfig(),
        task=task,
        fitness=0.0,
        terms={},
        origin={},
    )
    body = champion.embodied(blocks)
    steps = np.arange(len(way))
    qpos = np.tile(body.stand_qpos, (len(way), 1))
    qpos[:, :3] += way
    if way[:, 2].any():
        qpos[:, 3], qpos[:, 6] = np.cos(0.03 * steps), np.sin(0.03 * steps)
    qpos[:, 7:] = 0.8 * np.sin(0.2 * steps)[:, None]
    film = dataclasses.replace(blank_film(body, STEP, 1, len(way)), qpos=qpos[None])
    start = dataclasses.replace(nominal_starts(body, 1), light=np.array([light]))
    return Walk(body, champion, film, np.inf, start)


def straight(x: float, y: float, z: float, steps: int = 100) -> np.ndarray:
    """An even way [steps, 3] m."""
    return np.linspace(0, 1, steps)[:, None] * [x, y, z]


def leaps(height: float, steps: int = 100) -> np.ndarray:
    """Two leaps [steps, 3] m on the spot."""
    way = np.zeros((steps, 3))
    way[:, 2] = height * np.abs(np.sin(np.linspace(0, 2 * np.pi, steps)))
    return way
