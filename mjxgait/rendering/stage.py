"""Scene of one or several walks on one floor, and the camera that follows them.

Letters: `G` geoms.
"""

from collections.abc import Iterator, Sequence
from functools import cached_property

import mujoco
import numpy as np
from PIL import Image

from mjxgait.rendering.floor import Camera, Relief, view_of
from mjxgait.rendering.painter import COMPASS, Painter, paint
from mjxgait.rendering.shapes import Silhouettes
from mjxgait.rendering.surroundings import Surroundings
from mjxgait.rendering.walk import Walk

UP = np.array([0.0, 0.0, 1.0])


class Participant:
    """A participant of a scene, before its shift into a lane.

    outline: [points, 3] m, outermost points of the creature at the start. across, along: m, its
    width and length. top: m, its highest point. back: m, its hindmost point along the direction of
    travel, from the start.
    """

    def __init__(self, walk: Walk, origin: np.ndarray, forward: np.ndarray) -> None:
        """Scene's start, origin [2] m, and direction of travel, forward [2] unit.

        All go that way: the scene turns each walk about its start.
        """
        self.walk, self.origin = walk, origin
        self.start, self.step = walk.trunk_pos[0, :2], walk.time_step
        ahead, left = walk.forward @ forward, _left(walk.forward) @ forward
        self.turn = np.array([[ahead, -left, 0.0], [left, ahead, 0.0], UP])
        self.painter = Painter(walk.shown, soft=walk.grown)
        self._measure(np.append(forward, 0.0))

    def frame(self, time: float) -> int:
        """Return the walk's frame at s since the start; its last once it is over."""
        return min(round(time / self.step), len(self.walk.qpos) - 1)

    def placed(self, points: np.ndarray) -> np.ndarray:
        """Return points [..., 3] m of the walk's own world in the scene."""
        return (points - np.append(self.start, 0.0)) @ self.turn.T + np.append(self.origin, 0.0)

    def trunk(self, time: float) -> np.ndarray:
        """Return the trunk's position [3] m in the scene."""
        return self.placed(self.walk.trunk_pos[self.frame(time)])

    @property
    def light(self) -> np.ndarray | None:
        """Place [3] m of the task's light in the scene; None if it has none."""
        start = self.walk.start
        if start is None or not start.light[0].any():
            return None
        return self.placed(self.walk.trunk_pos[0] + start.light[0])

    def poses(self, time: float) -> tuple[np.ndarray, np.ndarray]:
        """Return positions [G, 3] m and rotations [G, 3, 3] in the scene of all geoms shown."""
        pos, rot = self.walk.geom_poses(np.array([self.frame(time)]))
        return self.placed(pos[0]), self.turn @ rot[0]

    def turned_pose(self, time: float, lane: np.ndarray) -> np.ndarray:
        """Return the pose [nq] in the scene, moved by lane [3] m, at s since the start."""
        qpos, place = self.walk.qpos[self.frame(time)].copy(), self.walk.creature.root_qpos
        qpos[place : place + 3] = self.placed(qpos[place : place + 3]) + lane
        turn, before = np.zeros(4), qpos[place + 3 : place + 7].copy()
        mujoco.mju_mat2Quat(turn, self.turn.ravel())
        mujoco.mju_mulQuat(qpos[place + 3 : place + 7], turn, before)
        return qpos

    def reach(self, times: np.ndarray, directions: np.ndarray) -> np.ndarray:
        """Return how far [T, K] m the creature reaches along unit directions [K, 3] of the scene.

        times: [T] s since the start. From the scene's origin; goals and bar do not count.
        """
        frames, (pos, rot) = [self.frame(time) for time in times], self._motion
        points = self.outlines.outermost(pos, rot, directions)
        reached: np.ndarray = (points * directions).sum(-1).max(1)[frames]
        return reached

    @cached_property
    def middle(self) -> np.ndarray:
        """Middle [frames of the walk, 3] m in the scene, which the camera follows.

        It is the trunk's; of a body that grew the mean of its blocks, for the root may be its tip.
        """
        if self.walk.grown:
            mean: np.ndarray = self._motion[0].mean(1)
            return mean
        return self.placed(self.walk.trunk_pos)

    @cached_property
    def _motion(self) -> tuple[np.ndarray, np.ndarray]:
        """Positions [frames, own, 3] m and rotations [frames, own, 3, 3] of the own geoms."""
        pos, rot = self.walk.geom_poses(np.arange(len(self.walk.qpos)))
        return self.placed(pos[:, self.own]), self.turn @ rot[:, self.own]

    def ground_heights(self, places: np.ndarray) -> np.ndarray:
        """Return the ground heights [n] m at places [n, 2] m of the scene."""
        own = (places - self.origin) @ self.turn[:2, :2] + self.start
        return self.walk.ground_heights(own)

    def _measure(self, forward: np.ndarray) -> None:
        model, own = self.walk.shown, self._own_geoms()
        self.own, self.outlines = own, Silhouettes(model, own)
        pos, rot = (poses[own] for poses in self.poses(0.0))
        left = np.cross(UP, forward)
        side = pos @ left - (pos @ left).mean()
        if not self.walk.grown:
            # The parts of a body that grew differ in colour, and have no side of their own.
            far = np.clip(side / max(float(np.abs(side).max()), 1e-6), 0.0, 1.0)
            self.painter.far[: len(own)] = far
        flat = np.column_stack([COMPASS, np.zeros(len(COMPASS))])
        outline = self.outlines.outermost(pos, rot, np.concatenate([flat, [UP, -UP]]))
        self.outline = outline.reshape(-1, 3)
        self.across, self.along = np.ptp(self.outline @ left), np.ptp(self.outline @ forward)
        self.top = float(self.outline[:, 2].max())
        self.back = float(((self.outline[:, :2] - self.origin) @ forward[:2]).min())

    def _own_geoms(self) -> np.ndarray:
        """Visible geoms of the creature: goals and bar are bodies behind its own."""
        geoms = self.painter.geoms
        own = self.walk.shown.geom_bodyid[geoms] < self.walk.creature.model.nbody
        return geoms[own]


def _left(forward: np.ndarray) -> np.ndarray:
    return np.array([-forward[1], forward[0]])


ROOM = 1.35
"""Size of the picture in units of the creature's."""
LANE, LONG_LANE = 1.25, 0.6
"""Least width of a lane, in units of the creature's width and length."""
RACE_ELEVATION = np.radians(33.0)
LAG = 0.15
"""Distance of a race's leader from the middle, as a share of the picture's width."""
SMOOTH_SECONDS = 0.6
"""Averaging window of the camera's path, so that it does not shake with each step."""
MARGINS = np.array([0.03, 0.03, 0.06, 0.10])
"""Least distance of a body from the picture's edges (right, left, upper, lower), as a share of the
picture; captions stand above, numbers below.
"""
LEAST_SCALE = 0.05
"""Smallest scale in units of the usual one: a body that flies apart is not shown as a dot."""


class Stage:
    """A scene: walks in lanes side by side, the first one nearest, seen from the side.

    Frames are control steps of the first walk. view: a name in `floor.VIEWS`; by default slightly
    from the front and from above. clear: see `Surroundings`.
    """

    def __init__(
        self,
        walks: Sequence[Walk],
        width: int,
        height: int,
        view: str | None = None,
        clear: bool = False,
    ) -> None:
        self.clear = clear
        self.width, self.height, self.time_step = width, height, walks[0].time_step
        self.origin, self.forward = walks[0].trunk_pos[0, :2], walks[0].forward
        self.left = np.array([-self.forward[1], self.forward[0], 0.0])
        self.participants = [Participant(walk, self.origin, self.forward) for walk in walks]
        self.frames = max(round(walk.seconds / self.time_step) for walk in walks)
        usual = {} if len(walks) == 1 else {"elevation": float(RACE_ELEVATION)}
        self.view = usual if view is None else view_of(view)
        self.lanes = self._lanes()
        self._choose_view()

    @property
    def alike(self) -> bool:
        """True if all walks have the same creature, goals and bar."""
        first = self.participants[0].walk
        return all(_same_scene(first, participant.walk) for participant in self.participants[1:])

    def picture(self, frame: int) -> Image.Image:
        """Draw a frame; a finished walk stays in its last pose."""
        shown = []
        for participant, lane in zip(self.participants, self.lanes, strict=True):
            pos, rot = participant.poses(frame * self.time_step)
            shown.append((participant.painter, pos + lane, rot))
        return paint(self.camera(frame), shown, self.origin, self.relief, self.around)

    def root_poses(self, time: float) -> np.ndarray:
        """Return poses [lanes, nq] of walks that are alike, each in its lane; time: s."""
        pairs = zip(self.participants, self.lanes, strict=True)
        return np.array([one.turned_pose(time, lane) for one, lane in pairs])

    def pictures(self, frames: Sequence[int]) -> Iterator[Image.Image]:
        """Draw several frames."""
        return map(self.picture, frames)

    def camera(self, frame: int) -> Camera:
        """Return the camera of a frame; it follows the leader."""
        way = self.way[min(frame, len(self.way) - 1)]
        centre = np.append(
            self.origin + way[0] * self.forward + way[1] * self.left[:2], self.middle + way[2]
        )
        return Camera(
            centre + self.shift, self.forward, self.scale, self.width, self.height, **self.view
        )

    def behind(self, frame: int, place: int) -> np.ndarray:
        """Return the pixel [2] right behind a lane's creature, at half its standing height."""
        participant = self.participants[place]
        trunk = participant.trunk(frame * self.time_step) + self.lanes[place]
        point = trunk[:2] + participant.back * self.forward
        level = float(self.relief(*point)) if self.relief else 0.0
        middle = trunk[2] if participant.walk.afloat else 0.5 * participant.top + level
        return self.camera(frame).pixels(np.append(point, middle))

    @cached_property
    def around(self) -> Surroundings:
        """Surroundings of all, by their medium; the light is that of the first with one."""
        walks = [one.walk for one in self.participants]
        places = zip(self.participants, self.lanes, strict=True)
        lights = [one.light + lane for one, lane in places if one.light is not None]
        water = all(walk.afloat for walk in walks)
        sand = not water and all(walk.grown for walk in walks)
        return Surroundings(water, sand, lights[0] if lights else None, self.clear)

    @property
    def relief(self) -> Relief | None:
        """Heights of uneven ground, each lane with its own walk's; None for the plane."""
        if all(participant.walk.ground is None for participant in self.participants):
            return None
        return self._height

    def _height(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Height in m at places of the world, from the nearest lane's ground."""
        places = np.stack(np.broadcast_arrays(x, y), -1).reshape(-1, 2)
        aside = (places - self.origin) @ self.left[:2]
        nearest = np.abs(aside[:, None] - self.lanes @ self.left).argmin(-1)
        heights = np.zeros(len(places))
        for lane, participant in enumerate(self.participants):
            mine = nearest == lane
            heights[mine] = participant.ground_heights(places[mine] - self.lanes[lane, :2])
        return heights.reshape(np.shape(x))

    def _lanes(self) -> np.ndarray:
        """Offsets of the lanes [lanes, 3] m from their common middle."""
        widths = np.array(
            [max(LANE * one.across, LONG_LANE * one.along) for one in self.participants]
        )
        places = np.cumsum(widths) - widths / 2
        return (places - places[[0, -1]].mean())[:, None] * self.left

    def _choose_view(self) -> None:
        """Set scale, height and path of the camera such that all lanes fill the picture."""
        flat = Camera(np.append(self.origin, 0.0), self.forward, 1.0, 0, 0, **self.view)
        pairs = zip(self.participants, self.lanes, strict=True)
        seen = flat.pixels(np.concatenate([one.outline + lane for one, lane in pairs]))
        size = np.ptp(seen, axis=0)
        self.scale = float(min(self.width / (ROOM * size[0]), self.height / (ROOM * size[1])))
        self.shift = float(seen[:, 0].max() + seen[:, 0].min()) / 2 * flat.axes[0]
        # Slightly below the middle, to leave room for the numbers on the floor.
        self.middle = (
            float(-seen[:, 1].min() - 0.5 * size[1]) / np.cos(flat.elevation)
            - 0.03 * self.height / self.scale
        )
        paths = np.array([self._path(participant) for participant in self.participants])
        # A race needs room behind the leader.
        behind = 0.0 if len(paths) == 1 else LAG * self.width / self.scale
        front = np.column_stack(
            [paths[..., 0].max(0) - behind, paths[..., 1].mean(0), paths[..., 2].mean(0)]
        )
        self.way = smooth(front, round(SMOOTH_SECONDS / self.time_step))
        self._make_room(paths)

    def _make_room(self, paths: np.ndarray) -> None:
        """Move the camera away, and its middle, if a body leaves the picture in any frame.

        paths: paths [lanes, frames, 3] m, see `_path`. In a race a body counts as if it were as
        far as the camera, because bodies that are left behind leave the picture.
        """
        times = np.arange(self.frames) * self.time_step
        right, up, _ = axes = self.camera(0).axes
        centre = np.array([self.camera(frame).centre for frame in range(self.frames)]) @ axes.T
        sides = np.stack([right, -right, up, -up])
        alone, reach = len(paths) == 1, np.zeros((len(paths), self.frames, 4))
        for place, (one, lane) in enumerate(zip(self.participants, self.lanes, strict=True)):
            behind = np.zeros((self.frames, 3)) if alone else self._behind_camera(paths[place])
            reach[place] = one.reach(times, sides) + (lane + behind) @ sides.T
        x, y = centre[:, 0], centre[:, 1]
        # How far a body reaches from the middle of the picture, each way, at the worst moment.
        most = (reach.max(0) - np.stack([x, -x, y, -y], 1)).max(0)
        size = np.repeat([self.width, self.height], 2)
        room = (0.5 - MARGINS) * size
        if (most * self.scale <= room).all():
            return
        fitting = float(((room[::2] + room[1::2]) / (most[::2] + most[1::2])).min())
        self.scale = min(self.scale, max(fitting, LEAST_SCALE * self.scale))
        excess = most - room / self.scale
        off_x, off_y = (excess[::2] - excess[1::2]) / 2
        self.shift = self.shift + off_x * right + off_y * up

    def _behind_camera(self, path: np.ndarray) -> np.ndarray:
        """Offset [frames, 3] m from a body's own path [frames, 3] to the camera's."""
        own = smooth(path, round(SMOOTH_SECONDS / self.time_step))
        directions = np.stack([np.append(self.forward, 0.0), self.left, UP])
        offset: np.ndarray = (self.way - own) @ directions
        return offset

    def _path(self, participant: Participant) -> np.ndarray:
        """Path [frames, 3] m of the middle: ahead of the start, to its left, the ground's height.

        For a swimmer its rise instead of that height.
        """
        steps = [participant.frame(frame * self.time_step) for frame in range(self.frames)]
        middle = participant.middle[steps]
        places = middle[:, :2]
        moved = places - self.origin
        afloat = participant.walk.afloat
        level = middle[:, 2] - middle[0, 2] if afloat else participant.ground_heights(places)
        return np.column_stack([moved @ self.forward, moved @ self.left[:2], level])


def _same_scene(first: Walk, other: Walk) -> bool:
    """Return whether one model shows both walks."""
    if first.creature.files["creature.xml"] != other.creature.files["creature.xml"]:
        return False
    if first.creature.settings.creature.beside:
        return False
    specs = [walk.source for walk in (first, other)]
    return len({None if spec is None else spec.to_xml() for spec in specs}) == 1


def smooth(path: np.ndarray, frames: int) -> np.ndarray:
    """Return a path [T, D] averaged over this many frames."""
    frames = max(min(frames, len(path)), 1)
    padded = np.concatenate(
        [
            np.repeat(path[:1], frames // 2, 0),
            path,
            np.repeat(path[-1:], frames - 1 - frames // 2, 0),
        ]
    )
    return np.column_stack(
        [np.convolve(column, np.ones(frames) / frames, mode="valid") for column in padded.T]
    )
