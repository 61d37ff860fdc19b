"""Second derivation of the loader's facts, from the creature's files, for the examiner.

Hip height, axes and mirror map decide what counts as forward, fast and symmetric: an error in them
would pass evolution and examination alike. Only the checked value comes from `mjxgait.creature`;
geometry comes from C MuJoCo, settings from the text of creature.toml.
Letters: `J` actuated joints.
"""

import fnmatch
import tomllib
from collections.abc import Iterator, Mapping
from typing import Any

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from mjxgait.creature import Creature
from mjxgait.errors import UserError

EXACT = 1e-9
LIKENESS = 0.15
"""Tolerance between a body and its mirror image: rad, and hip heights.

Drawn bodies are not quite symmetric.
"""
SWING = 0.6
"""rad, half width of the random poses that are mirrored."""


def check_body(creature: Creature, pose_span: float = 0.0) -> None:
    """Compare every fact that decides a certificate with a second derivation of it.

    Args:
      pose_span: degrees, `evolution.pose_span` of the run; with 0 the pose ranges are those of
        creature.toml.

    Raises:
      UserError: names the first fact that differs from what the files say, and both values.
    """
    body = _Body(creature.files, pose_span)
    for name, value, expected in body.facts(creature):
        same = np.shape(value) == np.shape(expected) and np.allclose(
            value, expected, rtol=EXACT, atol=EXACT
        )
        if not same:
            raise UserError(
                f"{creature.name}: its {name} is {_show(value)}, but by its files it is "
                f"{_show(expected)}; nothing it does can be examined"
            )
    body.check_length(creature)
    if body.symmetric:
        body.check_mirror(creature)


class _Body:
    """Body built from the files alone, standing in C MuJoCo."""

    def __init__(self, files: Mapping[str, str], pose_span: float) -> None:
        self.pose_span = np.radians(pose_span)
        self.table: dict[str, Any] = tomllib.loads(files["creature.toml"])
        self.identity = self.table["creature"]
        self.symmetric = bool(self.table.get("mirror", {}).get("symmetric", True))
        self.model = mujoco.MjModel.from_xml_string(files["creature.xml"])
        self.stand = self.model.key(self.identity.get("keyframe", "stand")).qpos.copy()
        self.data = mujoco.MjData(self.model)
        self.pose(self.stand)
        self.trunk = self.model.body(self.identity["trunk"])
        self.trunk_rot = self.data.xmat[self.trunk.id].reshape(3, 3).copy()
        free = mujoco.mjtJoint.mjJNT_FREE, mujoco.mjtJoint.mjJNT_BALL
        joints = map(self.model.joint, range(self.model.njnt))
        self.others = [self.model.body(name).id for name in self.identity.get("beside", ())]
        self.joints = [
            j
            for j in joints
            if j.type[0] not in free
            and j.bodyid[0] != self.trunk.id
            and self.model.body_rootid[j.bodyid[0]] not in self.others
        ]
        self.names = [j.name for j in self.joints]
        feet = [int(self.model.geom(g).bodyid[0]) for g in self.identity["feet"]]
        if self.table.get("rig", {}).get("bones"):  # its toes are parts, fixed to a foot
            feet = [int(self.model.body_weldid[foot]) for foot in feet]
        self.feet = list(dict.fromkeys(feet))

    def pose(self, qpos: np.ndarray) -> None:
        self.data.qpos[:] = qpos
        mujoco.mj_kinematics(self.model, self.data)

    def facts(self, creature: Creature) -> Iterator[tuple[str, ArrayLike, ArrayLike]]:
        """Yield each fact: name, value of the creature, value by its files."""
        forward, left, up = self.axes()
        stand = np.array([self.stand[j.qposadr[0]] for j in self.joints])
        yield "trunk", creature.trunk, self.trunk.id
        yield "standing pose", creature.stand_qpos, self.stand
        yield "standing trunk's place", creature.frame.stand_pos, self.data.xpos[self.trunk.id]
        yield "standing trunk's rotation", creature.frame.stand_rot, self.trunk_rot
        yield "forward axis", creature.frame.forward, forward
        yield "left axis", creature.frame.left, left
        yield "up axis", creature.frame.up, up
        yield "hip height in m", creature.frame.hip_height, self.hip_height()
        theirs = self.model.body_subtreemass[self.others].sum()
        yield "mass in kg", creature.frame.mass, mujoco.mj_getTotalmass(self.model) - theirs
        yield "number of joints", len(creature.joints.names), len(self.joints)
        yield "feet", list(map(self._body_id, creature.feet.names)), self.feet
        yield "positions' places", creature.joints.qpos_adr, [j.qposadr[0] for j in self.joints]
        yield "velocities' places", creature.joints.dof_adr, [j.dofadr[0] for j in self.joints]
        yield "standing angles", creature.joints.stand, stand
        for key, value in self.drives(creature, stand):
            for name, mine, expected in zip(self.names, *value, strict=True):
                yield f'{key} of joint "{name}"', mine, expected

    def drives(
        self, creature: Creature, stand: np.ndarray
    ) -> Iterator[tuple[str, tuple[np.ndarray, np.ndarray]]]:
        """Yield gains, limits and weights [J]: name, the creature's, and those by its files."""
        low, high = np.array([self._range(j) for j in self.joints]).T
        lowest, highest = self.pose_ranges(stand, low, high)
        yield "lower limit", (creature.joints.low, low)
        yield "upper limit", (creature.joints.high, high)
        yield "lowest pose", (creature.joints.pose_low, lowest)
        yield "highest pose", (creature.joints.pose_high, highest)
        for key in ("kp", "kd", "torque_limit"):
            values = np.array([self.setting(name, key) for name in self.names], float)
            yield key, (getattr(creature.gains, key), values)
        for group, key in (
            ("steering", "bend"),
            ("steering", "stride"),
            ("balance", "pitch"),
            ("balance", "roll"),
        ):
            field = f"{'steer' if group == 'steering' else group}_{key}"
            weights = np.array([self.weight(name, group, key) for name in self.names])
            yield f"{group} weight ({key})", (getattr(creature.corrections, field), weights)
        if stepping := creature.corrections.stepping:
            for key in ("ahead", "aside", "turn"):
                weights = np.array([self.weight(name, "stepping", key) for name in self.names])
                yield f"stepping weight ({key})", (getattr(stepping, key), weights)

    def pose_ranges(
        self, stand: np.ndarray, low: np.ndarray, high: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Lowest and highest pose [J] in rad, from creature.toml or the pose span.

        low, high: [J] rad, the joints' own ranges. A pose span replaces the width of each hinge's
        range; the range is then shifted until it lies within the joint's own.
        """
        given = np.radians([self.setting(name, "range", [-45.0, 45.0]) for name in self.names])
        lowest = np.maximum(stand + given[:, 0], low)
        highest = np.minimum(stand + given[:, 1], high)
        if not self.pose_span:
            return lowest, highest
        width = np.minimum(self.pose_span, high - low)
        first = (lowest + highest - width) / 2
        first += np.maximum(low - first, 0) - np.maximum(first + width - high, 0)
        hinge = np.array([j.type[0] == mujoco.mjtJoint.mjJNT_HINGE for j in self.joints])
        return np.where(hinge, first, lowest), np.where(hinge, first + width, highest)

    def axes(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Forward, left and up in the trunk's frame, from cross products in the world."""
        forward = self.trunk_rot @ np.array(self.identity.get("forward", [1.0, 0.0, 0.0]), float)
        left = np.cross([0.0, 0.0, 1.0], forward)
        up = np.cross(forward, left)
        axes = (axis / np.linalg.norm(axis) for axis in (forward, left, up))
        forward, left, up = (self.trunk_rot.T @ axis for axis in axes)
        return forward, left, up

    def hip_height(self) -> float:
        """Mean height in m of the legs' first joints, found from the trunk downwards.

        A leg begins with the first body below the trunk that carries a single foot. If no joint
        lies between the trunk and any foot, the highest joint counts.
        """
        self.pose(self.stand)
        carried = np.zeros(self.model.nbody, int)
        carried[self.feet] = 1
        for body in range(self.model.nbody - 1, 0, -1):
            carried[self.model.body_parentid[body]] += carried[body]
        above_feet = [j for j in self.joints if carried[j.bodyid[0]]]
        if not above_feet:
            return float(max(self.data.xanchor[j.id][2] for j in self.joints))
        heights = []
        for foot in self.feet:
            body, hips = foot, []
            while body and (carried[body] == 1):
                hips += [self.data.xanchor[j.id][2] for j in self.joints if j.bodyid[0] == body]
                body = int(self.model.body_parentid[body])
            heights.append(max(hips, default=self.data.xpos[foot][2]))
        return float(np.mean(heights))

    def check_length(self, creature: Creature) -> None:
        """Check the body length: between the extents of the geoms' centres and bounding spheres."""
        if stated := self.identity.get("body_length"):
            low = high = float(stated)
        else:
            self.pose(self.stand)
            forward = self.trunk_rot @ self.axes()[0]
            parts = self.model.geom_bodyid != 0
            along = self.data.geom_xpos[parts] @ forward
            reach = self.model.geom_rbound[parts]
            low, high = np.ptp(along), (along + reach).max() - (along - reach).min()
        if not low - EXACT <= creature.frame.body_length <= high + EXACT:
            raise UserError(
                f"{creature.name}: its body length is {creature.frame.body_length:g} m, but by its "
                f"files it is {low:.3g} to {high:.3g} m; nothing it does can be examined"
            )

    def check_mirror(self, creature: Creature) -> None:
        """Compare place and rotation of each part in random poses and in their mirror images.

        A joint with a partner stated in the file is only compared with that statement, and stands
        still. If it is stated as its own partner, the part that it moves has no image.
        """
        rng, stated = np.random.default_rng(0), self.table.get("mirror", {}).get("pairs", [])
        for pair in stated:
            j = self.names.index(pair["joint"])
            found = self.names[creature.mirror.partner[j]], int(creature.mirror.sign[j])
            if found != (said := (pair["partner"], pair.get("sign", 1))):
                raise UserError(
                    f'{creature.name}: joint "{pair["joint"]}" mirrors {found[0]} with sign '
                    f"{found[1]}, but [mirror] pairs says {said[0]} with sign {said[1]}"
                )
        free = ~np.isin(self.names, [pair["joint"] for pair in stated])
        stand = np.array([self.stand[j.qposadr[0]] for j in self.joints])
        left = self.trunk_rot @ self.axes()[1]
        flip = np.eye(3) - 2 * np.outer(left, left)
        base, base_image = self._parts(stand), self._parts(creature.mirror.image(stand))
        for _ in range(4):
            pose = stand + free * rng.uniform(-SWING, SWING, len(stand))
            parts, image = self._parts(pose), self._parts(creature.mirror.image(pose))
            for j, partner in enumerate(creature.mirror.partner):
                if partner == j and not free[j]:
                    continue
                turned = parts[1][partner] @ base[1][partner].T
                image_turned = image[1][j] @ base_image[1][j].T
                angle = np.linalg.norm(flip @ turned @ flip - image_turned) / np.sqrt(2)
                apart = flip @ parts[0][partner] - image[0][j]
                if partner != j and self.joints[j].type[0] == mujoco.mjtJoint.mjJNT_HINGE:
                    # A hinge is a line: its anchor may lie anywhere along its axis. A left and a
                    # right knee share a line, so this does not hold for a joint and itself.
                    apart -= (apart @ image[2][j]) * image[2][j]
                away = np.linalg.norm(apart)
                if angle > LIKENESS or away > LIKENESS * creature.frame.hip_height:
                    raise UserError(
                        f'{creature.name}: joint "{self.names[j]}" does not mirror '
                        f'"{self.names[partner]}" with sign {creature.mirror.sign[j]}: in a random '
                        f"pose it is {away:.3g} m and {angle:.2g} rad off; settle it in [mirror] "
                        "pairs"
                    )

    def _parts(self, pose: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return place, rotation and axis of each joint.

        Place [J, 3] in m from the trunk; rotation [J, 3, 3] of the body that it moves; axis [J, 3].
        Joints are compared, not centres of mass, which may differ between the sides.
        """
        qpos = self.stand.copy()
        qpos[[j.qposadr[0] for j in self.joints]] = pose
        self.pose(qpos)
        moved = [j.bodyid[0] for j in self.joints]
        ids = [j.id for j in self.joints]
        place = self.data.xanchor[ids] - self.data.xpos[self.trunk.id]
        return place, self.data.xmat[moved].reshape(-1, 3, 3).copy(), self.data.xaxis[ids].copy()

    def setting(self, joint: str, key: str, default: object = None) -> Any:
        """Setting of a joint: that of all joints, overridden by matching exceptions in order."""
        value = self.table["joints"].get(key, default)
        for exception in self.table.get("joint", []):
            if key in exception and fnmatch.fnmatchcase(joint, exception["match"]):
                value = exception[key]
        return value

    def weight(self, joint: str, group: str, key: str) -> float:
        """Weight of a joint in a correction; 0 if no pattern names it."""
        weight = 0.0
        for pattern, value in self.table.get(group, {}).get(key, {}).items():
            if fnmatch.fnmatchcase(joint, pattern):
                weight = float(value)
        return weight

    def _range(self, joint: Any) -> tuple[float, float]:
        low, high = joint.range
        return (low, high) if low or high else (-np.inf, np.inf)

    def _body_id(self, name: str) -> int:
        return int(self.model.body(name).id)


def _show(value: ArrayLike) -> str:
    return np.array2string(np.asarray(value), precision=6, threshold=8)
