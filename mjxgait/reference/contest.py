"""Contest of a body and an opponent over a cube, on C MuJoCo.

Letters: `S` simulations, `J` hinges of the opponent, `G` its blocks.
"""

from collections.abc import Mapping

import mujoco
import numpy as np

from mjxgait.creature import Creature
from mjxgait.reference.controllers import Memory, ReferenceController
from mjxgait.reference.layout import LowestPoint, own_directions
from mjxgait.reference.own_contact import OwnContact
from mjxgait.reference.state import CONTACT_GAP, OWN_CONTACT


class Contest:
    """Places of a model in which a body meets an opponent. `creature.beside` names it and the cube.

    geoms: of the body, and of the opponent. joints: hinges of the opponent.
    """

    def __init__(self, creature: Creature) -> None:
        self.model = model = creature.model
        opponent, cube = (model.body(name).id for name in creature.settings.creature.beside)
        root = model.body_rootid[model.geom_bodyid]
        self.geoms = tuple(np.flatnonzero(root == body) for body in (creature.trunk, opponent))
        self.cube = int(np.flatnonzero(root == cube)[0])
        hinges = model.jnt_type == mujoco.mjtJoint.mjJNT_HINGE
        self.joints = np.flatnonzero(hinges & (model.body_rootid[model.jnt_bodyid] == opponent))

    def gaps(self, xpos: np.ndarray, xmat: np.ndarray) -> np.ndarray:
        """Return the distances [S, 2] in m from the cube's middle to the nearest blocks.

        xpos: [S, ngeom, 3], xmat: [S, ngeom, 9] of all geoms.
        """
        found = []
        for geoms in self.geoms:
            away = xpos[:, [self.cube]] - xpos[:, geoms]
            axes = xmat[:, geoms].reshape(*away.shape, 3)
            along = np.einsum("sgij,sgi->sgj", axes, away)
            beyond = np.maximum(np.abs(along) - self.model.geom_size[geoms], 0.0)
            found.append(np.linalg.norm(beyond, axis=2).min(1))
        return np.stack(found, axis=1)

    def to_cube(self, xpos: np.ndarray, xmat: np.ndarray, geoms: np.ndarray) -> np.ndarray:
        """Return the cube's direction [S, G, 3] in the own axes of some geoms."""
        return own_directions(xpos[:, [self.cube]] - xpos[:, geoms], xmat[:, geoms])


def contest_of(creature: Creature) -> Contest | None:
    """Return the contest of a creature; None if it meets no opponent."""
    return Contest(creature) if creature.settings.creature.beside else None


class Opponent:
    """The opponents of `S` simulations, each with its own memory; their joints are undisturbed."""

    def __init__(self, contest: Contest, controller: ReferenceController, count: int) -> None:
        self.contest, self.controller = contest, controller
        self.memory = dict(controller.init(count))
        self.command = np.zeros((count, len(contest.joints)))
        model = contest.model
        self.dofs, self.places = model.jnt_dofadr[contest.joints], model.jnt_qposadr[contest.joints]
        self.blocks = LowestPoint(model, contest.geoms[1])
        touches = OWN_CONTACT in controller.reads
        self.own = OwnContact(model, contest.geoms[1]) if touches else None

    @property
    def states(self) -> tuple[np.ndarray, ...]:
        """All that differs between simulations, arrays [S, ...]."""
        return (self.command, *self.memory.values())

    def torque(
        self, rows: np.ndarray, k: int, qpos: np.ndarray, xpos: np.ndarray, xmat: np.ndarray
    ) -> np.ndarray:
        """Return the torques [rows, J] in N·m at control step k, from arrays [rows, ...]."""
        if k % self.controller.every == 0:
            self._act(rows, self._senses(qpos, xpos, xmat))
        torque: np.ndarray = self.command[rows]
        return torque

    def _senses(
        self, qpos: np.ndarray, xpos: np.ndarray, xmat: np.ndarray
    ) -> Mapping[str, np.ndarray]:
        gap = self.blocks.heights(xpos, xmat)
        if self.own is not None:
            gap = np.minimum(gap, self.own.gaps(xpos, xmat))
        return {
            "joint_pos": qpos[:, self.places],
            "contact": (gap < CONTACT_GAP).astype(float),
            "light": self.contest.to_cube(xpos, xmat, self.contest.geoms[1]),
        }

    def _act(self, rows: np.ndarray, senses: Mapping[str, np.ndarray]) -> None:
        before: Memory = {name: values[rows] for name, values in self.memory.items()}
        self.command[rows], after = self.controller.act(before, senses)
        for name, values in after.items():
            self.memory[name][rows] = values
