"""Where the creature's world lies in a character's scene, and how high its feet are there.

Letters: `F` key frames, `B` parts that have a bone, `N` feet.
"""

import dataclasses
from collections.abc import Mapping

import numpy as np
from scipy.spatial.transform import Rotation

from mjxgait.animation.export.character import Character
from mjxgait.animation.export.loop import WalkLoop
from mjxgait.animation.export.skeleton import gltf_axes, resting, skeleton_of, world_poses
from mjxgait.creature.geometry import DOWN, geom_reach, posed
from mjxgait.errors import UserError, listed

SLACK = 0.01
"""Hip heights by which a bone may be off its part at rest."""
SHOWN = 4
"""Number of bones that a message names."""


@dataclasses.dataclass(frozen=True, eq=False)
class Placement:
    """Where the creature's world lies in the file's scene.

    factor: units of the file per m. turn: [3, 3] from the axes of `gltf_axes`. shift: [3] place of
    the origin.
    """

    factor: float
    turn: np.ndarray
    shift: np.ndarray

    @property
    def up(self) -> np.ndarray:
        """Upward direction [3] in the scene."""
        direction: np.ndarray = self.turn @ [0.0, 1.0, 0.0]
        return direction

    def raised(self, height: float) -> "Placement":
        """Return the fit with the creature's world higher by this in units of the file."""
        return dataclasses.replace(self, shift=self.shift + height * self.up)

    def places(self, pos: np.ndarray) -> np.ndarray:
        """Places [..., 3] in the scene of places in m."""
        moved: np.ndarray = self.factor * pos @ self.turn.T + self.shift
        return moved

    def turns(self, rot: np.ndarray) -> np.ndarray:
        """Rotations [..., 3, 3] in the scene of rotations in the creature's world."""
        turned: np.ndarray = self.turn @ rot @ self.turn.T
        return turned


def fitted(loop: WalkLoop, character: Character, bones: Mapping[str, int]) -> Placement:
    """The fit by least squares of the resting creature to the bones at rest.

    Then the floor is moved to where the feet are lowest at rest: a body that bends its knees to
    stand would else walk above it.

    bones: node of the file by part of the creature.

    Raises:
      UserError: bones are elsewhere than the parts.
    """
    creature = loop.walk.creature
    skeleton, axes = skeleton_of(creature.model, creature.trunk), gltf_axes(loop.walk.forward)
    pos, _ = world_poses(creature.rest_model, skeleton, resting(loop)[None], axes)
    parts = pos[0, [skeleton.names.index(part, 1) for part in bones]]
    places = character.world[list(bones.values()), :3, 3]
    own, other = parts - parts.mean(0), places - places.mean(0)
    factor = float(np.sqrt((other**2).sum() / (own**2).sum()))
    if factor == 0.0:
        raise ValueError("all its bones are in one place")
    turn = Rotation.align_vectors(other, factor * own)[0].as_matrix()
    plain = Placement(factor, turn, places.mean(0) - factor * turn @ parts.mean(0))
    off = np.linalg.norm(plain.places(parts) - places, axis=1) / factor
    hip = creature.frame.hip_height
    if not (off < SLACK * hip).all():
        worst = [list(bones)[i] for i in np.argsort(-off) if not off[i] < SLACK * hip]
        names = quoted([creature.settings.rig.bones[part] for part in worst])
        raise UserError(
            f"{character.path}: at rest its bones {names} are up to {off.max() / hip:.0%} of the "
            f"hip height off the parts of {creature.name}; name the file that was imported "
            f"({creature.settings.rig.file}), or import this one and train it"
        )
    return plain.raised(factor * lows(loop, resting(loop)[None]).min())


def quoted(names: list[str]) -> str:
    """Names in quotes, and the number of those left out."""
    return listed([f'"{name}"' for name in names], SHOWN)


def lows(loop: WalkLoop, qpos: np.ndarray) -> np.ndarray:
    """Heights [F, geoms] in m of the lowest points of the feet's geoms in poses [F, nq]."""
    model, geoms = loop.walk.creature.model, loop.walk.creature.feet.stepping
    found = []
    for row in qpos:
        data = posed(model, row)
        found.append([-geom_reach(model, data, geom, DOWN) for geom in geoms])
    return np.array(found)


def lows_of_feet(loop: WalkLoop) -> np.ndarray:
    """Heights [F, N] in m of the lowest points of the simulated feet."""
    feet, found = loop.walk.creature.feet, lows(loop, loop.qpos)
    owners = np.array(feet.foot_of)
    return np.stack([found[:, owners == foot].min(1) for foot in range(len(feet.names))], 1)
