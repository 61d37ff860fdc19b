"""Search for a standing pose: leg bends that put level feet under the weight.

Letters: `J` active joints, `F` feet.
"""

from typing import NamedTuple

import numpy as np

from mjxgait.creature.geometry import rotation
from mjxgait.importer.body import KinematicModel
from mjxgait.importer.soles import Stance, lowest_part


class Sampling(NamedTuple):
    """Settings of a search for a pose.

    spread: rad, initial width around the file's pose. elite: poses of each round that go on.
    beside: cost of the squared distance of the weight from the feet's middle, in hip heights.
    """

    spread: float
    elite: int = 10
    beside: float = 40.0


SEARCHES = tuple(map(Sampling, (0.4, 1.0, 1.6)))
CAREFUL = tuple(Sampling(1.6, 6, beside) for beside in (150.0, 400.0, 400.0))
"""Searches for a body that falls off its two feet: a heavy head needs them beneath its weight."""
FIRST, SAMPLES, ROUNDS = 400, 40, 25
AT_ITS_END = 0.05
"""rad from an end of its range within which a joint rests on it."""
LATERAL = 0.7
"""Least share of a hinge's axis along y, of those that swing or bend a leg."""
BENDS, CROUCHES = np.array([-1.0, 2.0, -1.0]), np.linspace(0.1, 0.4, 16)
"""Turns of hip, knee and ankle of a crouch, in units of half the knee's bend; these halves, rad."""
BENT, UPRIGHT = (0.75, 0.94), (0.965, 0.975)
"""Straightness of a leg without a cost, and that of a figure with arms."""
MARGIN = 0.25
"""rad that a joint should keep from its limit."""
LEVELLED = 0.5
"""Share of the feet's difference in height that a tilt may leave."""
NEUTRAL = 0.9
"""Straightness of a leg that cannot bend."""


def symmetric(q: np.ndarray, mirror: tuple[np.ndarray, np.ndarray] | None) -> np.ndarray:
    """Mean [J] of a pose and its mirror image."""
    return q if mirror is None else (q + mirror[1] * q[mirror[0]]) / 2


def level(kinematics: KinematicModel, q: np.ndarray) -> None:
    """Tilt the trunk until the feet are level; a tilt that two feet leave open stays."""
    lowest = _lowest(kinematics, q)
    if len(lowest) < 2:
        return
    centred = lowest - lowest.mean(0)
    flat = centred[:, :2]
    size = float(np.abs(flat).max()) + 1e-9
    slope = np.linalg.solve(flat.T @ flat + 1e-2 * size**2 * np.eye(2), flat.T @ centred[:, 2])
    if np.linalg.norm(slope) < 0.01 or np.linalg.norm(slope) > 1.0:
        return
    up = np.array([-slope[0], -slope[1], 1.0])
    up /= np.linalg.norm(up)
    axis = np.cross(up, [0.0, 0.0, 1.0])
    sine = float(np.linalg.norm(axis))
    half = np.arcsin(min(sine, 1.0)) / 2
    tilt = rotation(np.concatenate([[np.cos(half)], np.sin(half) * axis / max(sine, 1e-9)]))
    kinematics.turn(tilt)
    if np.ptp(_lowest(kinematics, q)[:, 2]) > LEVELLED * np.ptp(lowest[:, 2]):
        kinematics.turn(tilt.T)  # tilted, the feet would stand on other points, hardly more level


def _lowest(kinematics: KinematicModel, q: np.ndarray) -> np.ndarray:
    """Return the lowest point [feet, 3] of each foot in a pose [J]."""
    soles = kinematics.sole_points(*kinematics.pose(q))
    return np.array([sole[sole[:, 2].argmin()] for sole in soles])


def drop(kinematics: KinematicModel, q: np.ndarray, sink: float = 0.0) -> None:
    """Move the trunk over the origin, the lowest foot point on the floor or `sink` m in it."""
    lowest = min(float(sole[:, 2].min()) for sole in kinematics.sole_points(*kinematics.pose(q)))
    root = kinematics.bodies[0]
    root.pos = np.array([0.0, 0.0, root.pos[2] - lowest - sink])


def stance_of(kinematics: KinematicModel, q: np.ndarray) -> Stance:
    """Stance in a pose [J]; the hip height is the mean height of each leg's first joint."""
    xpos, xrot = kinematics.pose(q)
    floor = min(float(sole[:, 2].min()) for sole in kinematics.sole_points(xpos, xrot))
    shared = {
        j
        for f in range(len(kinematics.feet))
        for g in range(f)
        for j in kinematics.leg(f)
        if j in kinematics.leg(g)
    }
    hips = []
    for f in range(len(kinematics.feet)):
        own = [j for j in kinematics.leg(f) if j not in shared] or kinematics.leg(f)
        hips.append(max(float(kinematics.data.xanchor[j + 1][2]) for j in own) - floor)
    reach = float(np.ptp(xpos, axis=0).max())
    return Stance(xpos, xrot, floor, max(float(np.mean(hips)), 0.02 * reach, 1e-3))


def _leg_length(kinematics: KinematicModel, foot: int) -> float:
    """Leg length in m along the joints down to the sole, in the latest pose."""
    anchors = kinematics.data.xanchor[[j + 1 for j in kinematics.leg(foot)]]
    sole = kinematics.sole_points(
        kinematics.data.xpos[1:], kinematics.data.xmat[1:].reshape(-1, 3, 3)
    )[foot]
    path = np.concatenate([anchors, sole.mean(0)[None]])
    return max(float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum()), 1e-3)


def across(sole: np.ndarray) -> np.ndarray:
    """Up direction [3] of a nearly flat sole [n, 3]: perpendicular to its longest side."""
    along = np.linalg.svd(sole - sole.mean(0))[2][0]
    up = np.array([0.0, 0.0, 1.0]) - along[2] * along
    return np.asarray(up / np.linalg.norm(up))


def straightness(path: np.ndarray) -> float:
    """Straightness of thigh and shank; 1 is a straight leg.

    path: [n, 3] from joint to joint to the sole. Thigh and shank are its longest two consecutive
    parts.
    """
    parts = np.linalg.norm(np.diff(path, axis=0), axis=1)
    if len(parts) < 2:
        return NEUTRAL
    k = int((parts[:-1] + parts[1:]).argmax())
    return float(np.linalg.norm(path[k + 2] - path[k])) / max(float(parts[k] + parts[k + 1]), 1e-9)


class Search:
    """Cross-entropy search for a pose; symmetric bodies get symmetric poses."""

    def __init__(
        self,
        kinematics: KinematicModel,
        start: np.ndarray,
        mirror: tuple[np.ndarray, np.ndarray] | None,
        planar: bool,
    ) -> None:
        self.kinematics, self.mirror, self.planar = kinematics, mirror, planar
        self.start = symmetric(np.clip(start, kinematics.low, kinematics.high), mirror)
        stance = stance_of(kinematics, self.start)
        self.hip = 0.85 * float(
            np.mean([_leg_length(kinematics, f) for f in range(len(kinematics.feet))])
        )
        self.segments = [
            s
            for s in kinematics.segments()
            if not any(set(s) & set(group) for group in kinematics.feet)
        ]
        lying = self._lying(stance, straight=False)
        if not lying and len(kinematics.feet) == 1:
            # A body on one foot needs its whole sole, even if the shank reaches the floor.
            lying = self._lying(stance_of(kinematics, self._straightest()), straight=True)
            above = {int(kinematics.parent[kinematics.feet[f][0]]) for f in lying} - {0}
            self.segments = [s for s in self.segments if not set(s) & above]
        self.flat, self.ups = list(lying), list(lying.values())
        self.legs = [kinematics.leg(f) for f in range(len(kinematics.feet))]
        self.upright = bool(kinematics.arms.any())

    def _straightest(self) -> np.ndarray:
        """Pose [J] with all joints as near to 0 as their limits allow."""
        nearest = np.clip(np.zeros_like(self.start), self.kinematics.low, self.kinematics.high)
        return symmetric(nearest, self.mirror)

    def _lying(self, stance: Stance, straight: bool) -> dict[int, np.ndarray]:
        """Feet that lie on a broad sole below an ankle, and the up direction [3] in their frames.

        straight: take the direction across the sole, which may be slightly tilted there.
        """
        up = np.array([0.0, 0.0, 1.0])
        found = {}
        for f, sole in enumerate(self.kinematics.sole_points(stance.xpos, stance.xrot)):
            low = lowest_part(sole, self.hip)
            broad = len(low) > 1 and np.ptp(low[:, :2], axis=0).max() > 0.12 * self.hip
            if broad and all(tip.far.all() for tip in self.kinematics.tips[f]):
                found[f] = stance.xrot[self.kinematics.feet[f][0]].T @ (
                    across(low) if straight else up
                )
        return found

    def run(self, sampling: Sampling, seed: int) -> np.ndarray:
        """Return the best pose [J] found."""
        rng, beside = np.random.default_rng(seed), sampling.beside
        # Arms hang; they must not balance the body.
        free = ~self.kinematics.arms
        mean, width = self.start.copy(), sampling.spread * free
        best, least = mean, self.cost(mean, beside)
        for i in range(ROUNDS):
            shape = (SAMPLES, len(mean))
            drawn = mean + width * (
                rng.normal(size=shape) if i else rng.uniform(-1, 1, (FIRST, len(mean)))
            )
            poses = [
                symmetric(np.clip(q, self.kinematics.low, self.kinematics.high), self.mirror)
                for q in ([*drawn, *self._crouched()] if i == 0 else drawn)
            ]
            costs = np.array([self.cost(q, beside) for q in poses])
            order = costs.argsort()[: sampling.elite]
            if costs[order[0]] < least:
                best, least = poses[order[0]], float(costs[order[0]])
            elite = np.array([poses[i] for i in order])
            mean, width = elite.mean(0), (elite.std(0) + 1e-3) * free
        return best

    def _crouched(self) -> list[np.ndarray]:
        """Poses [J] of a figure with bent knees, feet as level as before and beneath the hips.

        Random draws seldom bend hip, knee and ankle together.
        """
        if not self.upright:
            return []
        self.kinematics.pose(self.start)
        ways = np.zeros_like(self.start)
        for leg in self.legs:
            bending = self._lateral(leg)
            if len(bending) != len(BENDS):
                return []
            along = np.sign(self.kinematics.data.xaxis[1:, 1][bending])
            knee = bending[1]
            room = (
                (self.kinematics.high - self.start)[knee],
                (self.start - self.kinematics.low)[knee],
            )
            ways[bending] = BENDS * along * along[1] * (1 if room[0] > room[1] else -1)
        return [self.start + bend * ways for bend in CROUCHES]

    def _lateral(self, leg: list[int]) -> list[int]:
        """Hinges of a leg about the y axis in the latest pose."""
        return [j for j in leg if abs(self.kinematics.data.xaxis[j + 1][1]) > LATERAL]

    def at_ends(self, q: np.ndarray) -> bool:
        """Whether a hinge of a leg about the y axis is at an end of its range in a pose [J]."""
        self.kinematics.pose(q)
        room = np.minimum(q - self.kinematics.low, self.kinematics.high - q)
        return bool((room[[j for leg in self.legs for j in self._lateral(leg)]] < AT_ITS_END).any())

    def stretch(self, q: np.ndarray) -> float:
        """Mean straightness of the legs in a pose [J]."""
        soles = self.kinematics.sole_points(*self.kinematics.pose(q))
        ratios = []
        for sole, leg in zip(soles, self.legs, strict=True):
            path = np.concatenate(
                [self.kinematics.data.xanchor[[j + 1 for j in leg]], sole.mean(0)[None]]
            )
            ratios.append(straightness(path))
        return float(np.mean(ratios))

    def cost(self, q: np.ndarray, beside: float) -> float:
        """Cost of a stance [J]. beside: see `Sampling`.

        Terms: uneven feet, weight beside them, other parts low, stretched legs, feet within the
        hips, closeness to limits, distance from the file's pose.
        """
        kinematics, hip = self.kinematics, self.hip
        xpos, xrot = kinematics.pose(q)
        soles = kinematics.sole_points(xpos, xrot)
        lows = np.array([sole[:, 2].min() for sole in soles])
        floor = float(lows.min())
        middles = np.array([lowest_part(sole, hip).mean(0) for sole in soles])
        off = (kinematics.centre_of_mass() - middles.mean(0))[:2] / hip
        others = [kinematics.lowest(xpos, xrot, s) - floor for s in self.segments]
        others.append(kinematics.shank_height(xpos, xrot) - floor)
        crouched = sum(max(0.2 - h / hip, 0.0) for h in others)
        stretched, beneath, narrow, ahead = self._of_legs(middles)
        near = (
            np.maximum(MARGIN - np.minimum(q - kinematics.low, kinematics.high - q), 0.0) / MARGIN
        )
        tilted = sum(
            1 - float((xrot[kinematics.feet[f][0]] @ up)[2])
            for f, up in zip(self.flat, self.ups, strict=True)
        )
        low_trunk = max(0.6 - (xpos[0][2] - floor) / hip, 0.0)
        return float(
            400 * (((lows - floor) / hip) ** 2).sum()
            + beside * (off[0] ** 2 + (0 if self.planar else off[1] ** 2))
            + 20 * crouched
            + 40 * stretched
            + 0.3 * (near**2).mean()
            + 3 * beneath
            # A leg steps equally far forward and back from beneath its hip; but two feet must be
            # beneath the weight.
            + (10 * ahead if len(self.legs) > 2 else 0)
            + (0 if self.planar else 20 * narrow)  # a body that steps within its hips tips over
            + 200 * tilted
            + 5 * low_trunk
            + 0.2 * ((q - self.start) ** 2).mean()
        )

    def _of_legs(self, middles: np.ndarray) -> tuple[float, float, float, float]:
        """Sums over the legs in the latest pose; middles: [F, 3] m, of the soles.

        How far legs are stretched or folded, feet beside their hips, feet within the hips, and
        feet before or behind them (squared); lengths in hip heights.
        """
        stretched = beneath = narrow = ahead = 0.0
        least, most = UPRIGHT if self.upright else BENT
        for middle, leg in zip(middles, self.legs, strict=True):
            anchors = self.kinematics.data.xanchor[[j + 1 for j in leg]]
            path = np.concatenate([anchors, middle[None]])
            off = (middle - anchors[0])[:2]
            beneath += max(float(np.linalg.norm(off)) / self.hip - 0.3, 0.0)
            ahead += (float(off[0]) / self.hip) ** 2
            side = float(anchors[np.abs(anchors[:, 1]).argmax(), 1])
            narrow += max(abs(side) - float(middle[1]) * np.sign(side), 0.0) / self.hip
            ratio = straightness(path)
            stretched += max(ratio - most, 0.0) + max(least - ratio, 0.0)
        return stretched, beneath, narrow, ahead
