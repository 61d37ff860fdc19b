"""Roles of a skeleton's bones at rest. Axes are the file's. Letters: `B` bones."""

from functools import cached_property

import numpy as np

from mjxgait.animation.clips.clip import Rig

MIDDLE, PAIRED = 0.02, 0.002
"""Share of the skeleton's span within which a bone begins in the middle; share from which a bone
and its mirror image on the same parent, such as a bird's thighs, begin beside it.
"""
SHORT = 0.04
"""Share of the height below which a bone does not bend on its own."""
COLLAR = 0.2
"""Share of its reach within which an arm that begins with a collar bone leaves the middle."""
TOE = 0.5
"""Share of the longest toe's length from which another one is a toe, not a spur."""
LIMB, LOW = 0.4, 0.1
"""Share of the longest reach from which a branch is a limb, not an ear; share of the height within
which a limb ends at the floor.
"""
FOOT, ANKLE_HIGH, HEEL = 0.3, 0.1, 0.25
"""Share of its length by which a foot points forward; share of the height below which an ankle
lies; distance of the heel behind the ankle, over foot length.
"""


class Plan:
    """Skeleton in metres and the roles of its limbs. up: number of the axis that points up."""

    def __init__(self, up: int, rig: Rig) -> None:
        self.up, self.rig = up, rig
        spots = np.concatenate([rig.places, *rig.ends])
        self.span = float(np.ptp(spots, axis=0).max())
        self.height = float(np.ptp(np.concatenate([spots, *rig.skins])[:, up])) or self.span
        level = [axis for axis in range(3) if axis != up]  # X is the side if both fit equally
        self.side = min(level, key=self._unlike)
        self.ahead = next(axis for axis in level if axis != self.side)

    def _unlike(self, axis: int) -> float:
        """Largest distance in m of a joint from the nearest mirror image across an axis."""
        places = self.rig.places - self.rig.places[0]
        images = places * np.where(np.arange(3) == axis, -1.0, 1.0)
        return float(np.linalg.norm(places[:, None] - images, axis=2).min(1).max())

    def in_middle(self, bone: int) -> bool:
        """Return whether a bone begins between left and right."""
        return not self._paired[bone] and self.apart(bone) < MIDDLE * self.span

    def _aside(self, bone: int) -> float:
        """Way in m from the root to the side."""
        return float(self.rig.places[bone, self.side] - self.rig.places[0, self.side])

    def apart(self, bone: int) -> float:
        """Distance in m to the side of the root."""
        return abs(self._aside(bone))

    @cached_property
    def images(self) -> list[int]:
        """Mirror image of each bone; the bone itself where there is none."""
        own = np.concatenate([self.rig.places, self.tips], axis=1)
        mirrored, sides = own.copy(), [self.side, self.side + 3]
        mirrored[:, sides] = 2 * self.rig.places[0, self.side] - own[:, sides]
        away = np.linalg.norm(own[:, None] - mirrored, axis=2)
        near = away.min(0) < MIDDLE * self.span
        return [int(i) for i in np.where(near, away.argmin(0), np.arange(len(own)))]

    @cached_property
    def _paired(self) -> list[bool]:
        """Whether each bone's mirror image begins on the same parent."""
        near, places = PAIRED * self.span, self.rig.places

        def paired(bone: int) -> bool:
            image = places[bone].copy()
            image[self.side] -= 2 * self._aside(bone)
            brothers = self.rig.children(self.rig.parents[bone])
            return self.apart(bone) > near and any(
                np.linalg.norm(places[other] - image) < near for other in brothers
            )

        return [bone > 0 and paired(bone) for bone in range(len(places))]

    def carries(self, bone: int) -> bool:
        """Return whether a bone is the root, or in the middle with limbs of both sides below."""
        return bone == 0 or (self.in_middle(bone) and len(self.sides_below[bone]) > 1)

    @cached_property
    def sides_below(self) -> list[set[float]]:
        """Sides of the limbs that begin at each bone or below it."""
        found: list[set[float]] = [set() for _ in self.rig.names]
        for bone in self.limbs:
            found[bone].add(float(np.sign(self._aside(bone))))
        for bone in reversed(range(1, len(found))):
            found[self.rig.parents[bone]] |= found[bone]
        return found

    @cached_property
    def half_width(self) -> float:
        """Mean distance in m from the middle at which limbs begin."""
        return float(np.mean([self.apart(b) for b in self.limbs])) if self.limbs else 0.0

    def leaves_middle(self, bone: int) -> bool:
        """Return whether a limb or an ear leaves the trunk at this bone."""
        parent = self.rig.parents[bone]
        return not self.in_middle(bone) and (parent < 0 or self.in_middle(parent))

    def is_limb(self, bone: int) -> bool:
        """Return whether a limb begins at this bone: a long branch, or one down to the floor.

        Other branches are ears, eyes or handles.
        """
        if not self.leaves_middle(bone):
            return False
        return self.reach(bone) > LIMB * self.longest or self._comes_down(bone)

    def _comes_down(self, bone: int) -> bool:
        """Return whether a branch descends to the floor, as the short legs of a winged bird do."""
        drop = self.rig.places[bone, self.up] - self.tips[bone, self.up]
        return self._ends_low(bone) and bool(LOW * self.height < drop)

    @cached_property
    def on_limbs(self) -> list[bool]:
        """Whether each bone belongs to a limb or hangs on one; tails and bellies do not."""
        return self._below(set(self.limbs))

    @cached_property
    def on_legs(self) -> list[bool]:
        """Whether each bone belongs to a limb that ends at the floor."""
        return self._below(set(filter(self._ends_low, self.limbs)))

    def _below(self, firsts: set[int]) -> list[bool]:
        """Return whether each bone is one of these or below one."""
        found: list[bool] = []
        for bone, parent in enumerate(self.rig.parents):
            found.append(bone in firsts or (parent >= 0 and found[parent]))
        return found

    def _ends_low(self, first: int) -> bool:
        """Return whether the limb that a bone belongs to ends at the floor."""
        return bool(self.tips[first, self.up] - self.floor < LOW * self.height)

    @cached_property
    def limbs(self) -> list[int]:
        """First bone of each limb."""
        return [bone for bone in range(len(self.rig.names)) if self.is_limb(bone)]

    @cached_property
    def longest(self) -> float:
        """Longest reach in m of a branch that leaves the middle."""
        firsts = filter(self.leaves_middle, range(len(self.rig.names)))
        return max(map(self.reach, firsts), default=0.0)

    def reach(self, first: int) -> float:
        """Distance in m from the beginning of a bone to the end of its limb."""
        return float(np.linalg.norm(self.tips[first] - self.rig.places[first]))

    @cached_property
    def tips(self) -> np.ndarray:
        """End [B, 3] of the limb that each bone belongs to."""
        found = self.rig.places + [self.way(bone) for bone in range(len(self.rig.names))]
        for bone in reversed(range(len(found))):
            if below := self.rig.children(bone):
                found[bone] = found[max(below, key=self._length)]
        return found

    def _length(self, bone: int) -> float:
        return float(np.linalg.norm(self.way(bone)))

    @cached_property
    def stands(self) -> float:
        """Total descent in m of the limbs that end at the floor; large if `up` is right."""
        tips = self.tips[self.limbs, self.up]
        drops = np.maximum(self.rig.places[self.limbs, self.up] - tips, 0.0)
        return float(drops[tips - self.floor < LOW * self.height].sum())

    def segments(self, bone: int) -> list[tuple[np.ndarray, np.ndarray]]:
        """Start and ends [3] of a bone's segments, without those within the trunk."""
        rig, start = self.rig, self.rig.places[bone]
        below = rig.children(bone)
        if self.in_middle(bone):
            below = [b for b in below if not self.leaves_middle(b)] or below
        ends = [*rig.places[below], *rig.ends[bone]]
        if not ends and len(rig.skins[bone]):
            ends = [start + 1.8 * (rig.skins[bone].mean(0) - start)]
        return [(start, end) for end in ends if np.linalg.norm(end - start) > 1e-4 * self.span]

    def way(self, bone: int) -> np.ndarray:
        """Vector [3] in m from a bone's start to its farthest end; zeros if it has none."""
        ways = [end - start for start, end in self.segments(bone)]
        return max(ways, key=lambda way: float(way @ way), default=np.zeros(3))

    def limb(self, first: int) -> list[int]:
        """Bones of a limb from its first one down, along the longest."""
        chain = [first]
        while below := self.rig.children(chain[-1]):
            chain.append(max(below, key=self._length))
        return chain

    @cached_property
    def arms(self) -> dict[int, list[int]]:
        """Bones of each arm from the shoulder down, by the limb's first bone.

        A body on more feet, or a bird, has none. A collar bone, which begins near the middle, moves
        with the trunk.
        """
        found = {}
        for first in self.limbs:
            if self.feet and not self.on_legs[first] and self._upright(first):
                chain = self.limb(first)
                collar = len(chain) > 1 and self.apart(first) < COLLAR * self.reach(first)
                found[first] = chain[1:] if collar else chain
        return found

    def _upright(self, first: int) -> bool:
        """Return whether a limb begins above the root rather than ahead of it."""
        shoulder = self.rig.places[first] - self.rig.places[0]
        return bool(shoulder[self.up] > abs(shoulder[self.ahead]))

    def has_toes(self, bone: int) -> bool:
        """Return whether a limb splits at this bone into several of about equal reach (toes)."""
        reaches = sorted(map(self.reach, self.rig.children(bone)), reverse=True)
        return len(reaches) > 1 and reaches[1] > TOE * reaches[0]

    @cached_property
    def feet(self) -> list[int]:
        """Bones below the ankles of a two-footed body, which needs heels to stand; else none."""
        rig, floor = self.rig, self.floor
        found = []
        for first in self.limbs:
            for bone in self.limb(first):
                low = rig.places[bone, self.up] - floor < ANKLE_HIGH * self.height
                if low and foot_direction(self, bone):
                    found.append(bone)
                    break
        return found if len(found) == 2 else []

    @cached_property
    def floor(self) -> float:
        """Height in m of the lowest place."""
        return float(np.concatenate([self.rig.places, *self.rig.ends])[:, self.up].min())

    def capsules(self, bone: int, radius: float) -> list[tuple[np.ndarray, np.ndarray]]:
        """Ends [3], [3] of a bone's capsules; toes above a sole have none of their own."""
        above = self.rig.parents[bone]
        while above >= 0 and above not in self.feet:
            above = self.rig.parents[above]
        return [] if above >= 0 else self.sole(bone, radius) or self.segments(bone)

    def sole(self, bone: int, radius: float) -> list[tuple[np.ndarray, np.ndarray]]:
        """Sole from heel to toe on the floor for a bone below an ankle; empty for other bones."""
        if bone not in self.feet:
            return []
        spots = self.spots_below(bone)
        ahead = foot_direction(self, bone) * spots[:, self.ahead]
        heel, toe = spots[0].copy(), spots[ahead.argmax()].copy()
        heel[self.ahead] -= HEEL * (toe - heel)[self.ahead]
        if ahead.min() < foot_direction(self, bone) * heel[self.ahead]:
            heel[self.ahead] = spots[ahead.argmin(), self.ahead]
        heel[self.up] = toe[self.up] = self.floor + radius
        return [(heel, toe)]

    def spots_below(self, bone: int) -> np.ndarray:
        """Starts and ends [n, 3] of a bone and all bones below it."""
        order = self.rig.subtree(bone)
        ends = [end for other in order for _, end in self.segments(other)]
        return np.array([*self.rig.places[order], *ends])

    def moves(self, bone: int) -> bool:
        """Return whether a bone is long enough to bend on its own."""
        return self._length(bone) > SHORT * self.height


def foot_direction(plan: Plan, foot: int) -> float:
    """Direction of a foot along the forward axis: 1, -1, or 0 if it does not point along it."""
    way = plan.way(foot)
    share = float(way[plan.ahead]) / max(float(np.linalg.norm(way)), 1e-9)
    return float(np.sign(share)) if abs(share) > FOOT else 0.0
