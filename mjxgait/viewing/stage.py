"""One or several walks on one floor, and the camera that goes along with them."""

from collections.abc import Iterator, Sequence

import numpy as np
from PIL import Image

from mjxgait.viewing.camera import Camera, view_of
from mjxgait.viewing.painter import COMPASS, Painter
from mjxgait.viewing.relief import Relief
from mjxgait.viewing.shapes import Silhouettes
from mjxgait.viewing.walk import Walk

ROOM = 1.35
"""Of the picture, in units of the creature."""
LANE, LONG_LANE = 1.25, 0.6
"""Least width of a lane in units of the creature's width and length."""
RACE_ELEVATION = np.radians(33.0)
LAG = 0.15
"""Of the picture's width that the first in a race is ahead of its middle."""
SMOOTH_SECONDS = 0.6
"""Over which the camera's way is averaged, so that it does not shake with each step."""


class Stage:
    """Walks of one creature in lanes side by side, the first one nearest, seen from the side.

    Frames are control steps. view: a name in `camera.VIEWS`; by default a little from the front and
    from above.
    """

    def __init__(
        self, walks: Sequence[Walk], width: int, height: int, view: str | None = None
    ) -> None:
        self.walks, self.width, self.height = walks, width, height
        self.painter = Painter(walks[0].shown)
        self.origin = walks[0].trunk_pos[0, :2]
        self.forward = walks[0].forward
        self.frames = max(len(walk.qpos) for walk in walks)
        usual = {} if len(walks) == 1 else {"elevation": float(RACE_ELEVATION)}
        self.view = usual if view is None else view_of(view)
        self._place_lanes()
        self._choose_view()

    def picture(self, frame: int) -> Image.Image:
        """The moment of a frame; a walk that is over stays as it ended."""
        shown = []
        for walk, lane in zip(self.walks, self.lanes, strict=True):
            pos, rot = walk.geom_poses(np.array([min(frame, len(walk.qpos) - 1)]))
            shown.append((pos[0] + lane, rot[0]))
        return self.painter.picture(self.camera(frame), shown, self.origin, self.relief)

    def pictures(self, frames: Sequence[int]) -> Iterator[Image.Image]:
        """The moments of several frames."""
        return map(self.picture, frames)

    def camera(self, frame: int) -> Camera:
        """Goes along with the one in front."""
        way = self.way[min(frame, len(self.way) - 1)]
        centre = np.append(
            self.origin + way[0] * self.forward + way[1] * self.left[:2], self.middle + way[2]
        )
        return Camera(
            centre + self.shift, self.forward, self.scale, self.width, self.height, **self.view
        )

    def behind(self, frame: int, place: int) -> np.ndarray:
        """[2] pixels, right behind the creature in a lane and half as high as it stands."""
        walk = self.walks[place]
        trunk = walk.trunk_pos[min(frame, len(walk.qpos) - 1)] + self.lanes[place]
        point = trunk[:2] + self.back * self.forward
        level = float(self.relief(*point)) if self.relief else 0.0
        return self.camera(frame).pixels(np.append(point, 0.5 * self.top + level))

    @property
    def relief(self) -> Relief | None:
        """The ground, if it is no plane; each lane has that of its own walk."""
        if self.walks[0].ground is None:
            return None
        return self._height

    def _height(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """m at places of the world, seen from the nearest lane."""
        ground = self.walks[0].ground
        assert ground is not None
        aside = (x - self.origin[0]) * self.left[0] + (y - self.origin[1]) * self.left[1]
        lane = self.lanes[np.abs(np.asarray(aside)[..., None] - self.lanes @ self.left).argmin(-1)]
        return ground.height(x - lane[..., 0], y - lane[..., 1])

    def _place_lanes(self) -> None:
        forward = np.append(self.forward, 0.0)
        self.left = np.cross([0.0, 0.0, 1.0], forward)
        model = self.walks[0].creature.model
        own = self.painter.geoms[self.painter.geoms < model.ngeom]
        pos, rot = (poses[0][own] for poses in self.walks[0].geom_poses(np.array([0])))
        side = pos @ self.left - (pos @ self.left).mean()
        far = np.clip(side / max(float(np.abs(side).max()), 1e-6), 0.0, 1.0)
        self.painter.far[: len(own)] = far
        directions = np.concatenate(
            [np.column_stack([COMPASS, 0 * COMPASS[:, 0]]), [[0, 0, 1], [0, 0, -1]]]
        )
        self.outline = Silhouettes(model, own).outermost(pos, rot, directions).reshape(-1, 3)
        self.top = float(self.outline[:, 2].max())
        self.back = float(((self.outline[:, :2] - self.origin) @ self.forward).min())
        across, along = np.ptp(self.outline @ self.left), np.ptp(self.outline @ forward)
        places = (np.arange(len(self.walks)) - (len(self.walks) - 1) / 2) * max(
            LANE * across, LONG_LANE * along
        )
        self.lanes = places[:, None] * self.left

    def _choose_view(self) -> None:
        """Scale and height at which all lanes fill the picture well."""
        flat = Camera(np.append(self.origin, 0.0), self.forward, 1.0, 0, 0, **self.view)
        seen = flat.pixels((self.outline[None] + self.lanes[[0, -1], None]).reshape(-1, 3))
        size = np.ptp(seen, axis=0)
        self.scale = float(min(self.width / (ROOM * size[0]), self.height / (ROOM * size[1])))
        self.shift = float(seen[:, 0].max() + seen[:, 0].min()) / 2 * flat.axes[0]
        # The middle of what is seen, a little lower for the numbers on the floor.
        self.middle = (
            float(-seen[:, 1].min() - 0.5 * size[1]) / np.cos(flat.elevation)
            - 0.03 * self.height / self.scale
        )
        ways = []
        for walk in self.walks:
            moved = walk.trunk_pos[:, :2] - self.origin
            level = walk.ground_heights(walk.trunk_pos[:, :2])
            path = np.column_stack([moved @ self.forward, moved @ self.left[:2], level])
            ways.append(np.concatenate([path, np.repeat(path[-1:], self.frames - len(path), 0)]))
        everyone = np.array(ways)
        # In a race there is room behind the one in front.
        behind = 0.0 if len(ways) == 1 else LAG * self.width / self.scale
        front = np.column_stack(
            [everyone[..., 0].max(0) - behind, everyone[..., 1].mean(0), everyone[..., 2].mean(0)]
        )
        self.way = smooth(front, round(SMOOTH_SECONDS / self.walks[0].time_step))


def smooth(path: np.ndarray, frames: int) -> np.ndarray:
    """A path [T, D] averaged over so many frames."""
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
