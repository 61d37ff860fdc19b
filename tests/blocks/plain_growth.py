"""Growth once more, as a list that grows while it is read: the reference of the arrays' growth."""

import numpy as np

from mjxgait.blocks.genotype import Capacity, Graph
from mjxgait.blocks.growth import LARGEST, SMALLEST

HINGES = (0, 1, 1, 2, 2, 2, 3)
IMAGES = ((0,), (1,), (0, 1))


def about(axis: int, angle: float) -> np.ndarray:
    """A rotation matrix, by Rodrigues' formula."""
    x, y, z = np.eye(3)[axis]
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def joined(half: np.ndarray, place: np.ndarray, turn: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where on the block, and the child's axes as columns."""
    face = int(np.argmax(np.abs(place)))
    outward = np.sign(place[face]) * np.eye(3)[face]
    side = np.eye(3)[(face + 1) % 3]
    frame = np.column_stack([outward, side, np.cross(outward, side)])
    turned = frame @ about(0, turn[0]) @ about(1, turn[1]) @ about(2, turn[2])
    return half * place / abs(place[face]), turned


def plain_parts(graph: Graph, capacity: Capacity) -> list[dict]:
    """The parts of one graph, arrays in NumPy."""
    mirror = np.diag([1.0, -1.0, 1.0])
    links = 1
    root = np.clip(graph.half[0], SMALLEST, LARGEST)
    parts = [{"node": 0, "parent": 0, "copies": 0, "scale": 1.0, "branch": {0: 1}, "half": root}]
    parts[0] |= {"place": np.zeros(3), "columns": np.eye(3), "last": 0}
    for number, part in enumerate(parts):
        for place in zip(
            [part["node"]] * 9, np.flatnonzero(graph.used[part["node"]]), strict=False
        ):
            node, times = int(graph.target[place]), part["branch"]
            if times.get(node, 0) > graph.recursion[node]:
                continue
            if graph.terminal[place] and times[part["node"]] <= graph.recursion[part["node"]]:
                continue
            needed, images = max(HINGES[graph.joint[node]], 1), IMAGES[int(graph.mirror[place])]
            if len(parts) + len(images) > capacity.parts:
                continue
            if links + len(images) * needed > capacity.links:
                continue
            for image in images:
                links += needed
                scale = part["scale"] * graph.scale[place]
                joint, columns = joined(part["half"], graph.place[place], graph.turn[place])
                copies = part["copies"] ^ image
                if copies:
                    joint, columns = mirror @ joint, mirror @ columns @ mirror
                parts.append(
                    {
                        "node": node,
                        "parent": number,
                        "copies": copies,
                        "scale": scale,
                        "branch": times | {node: times.get(node, 0) + 1},
                        "half": np.clip(graph.half[node] * scale, SMALLEST, LARGEST),
                        "place": joint,
                        "columns": columns,
                        "last": links - 1,
                    }
                )
    return parts
