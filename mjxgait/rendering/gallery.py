"""Champions side by side: what each does, in a word and in numbers, and pictures of all."""

import dataclasses
from collections.abc import Iterator, Sequence
from functools import cached_property

import numpy as np
from PIL import Image, ImageDraw

from mjxgait.creature.geometry import beside
from mjxgait.inspect.strategy import WORDS, Motion, strategy
from mjxgait.rendering.floor import DARK_INK, font
from mjxgait.rendering.painter import seen_geoms
from mjxgait.rendering.shapes import Silhouettes
from mjxgait.rendering.stage import Stage
from mjxgait.rendering.walk import WARMUP, Walk, poses_of

EACH = 0.02
"""Time between the frames that are measured in s."""
CORNERS = np.stack(np.meshgrid(*[[-1.0, 1.0]] * 3), -1).reshape(-1, 3) / np.sqrt(3)
"""Directions [8, 3] in which the outermost points of a part lie; a box's are its corners."""


@dataclasses.dataclass(frozen=True, eq=False)
class Entry:
    """A champion in a gallery.

    name: of its run. walk: undisturbed. doubt: the reason why it is not certified; empty if it is.
    """

    name: str
    walk: Walk
    doubt: str

    @property
    def certified(self) -> bool:
        """True without a doubt."""
        return not self.doubt

    @cached_property
    def motion(self) -> Motion:
        """The walk without its first seconds, as far as strategies are measured."""
        return motion_of(self.walk)

    @cached_property
    def strategy(self) -> str:
        """How it gets on, in a word."""
        return strategy(self.motion)

    @property
    def speed(self) -> float:
        """Straight-line speed in m/s."""
        return self.motion.speed * self.motion.length

    @property
    def does(self) -> str:
        """Its speed, and the height of its leaps if it leaps."""
        leaps = self.strategy in ("hop", "jump")
        high = float(self.motion.points[..., 2].min((1, 2)).max()) if leaps else 0.0
        return f"{self.speed:.2f} m/s" + (f", {high:.2f} m off the ground" if leaps else "")


def motion_of(walk: Walk) -> Motion:
    """Return a walk as far as strategies are measured."""
    every = max(round(EACH / walk.time_step), 1)
    first = round(WARMUP / walk.time_step) if walk.seconds > 2 * WARMUP else 0
    frames = np.arange(first, len(walk.qpos), every)
    # Not the model as shown, which has eyes, goals and a bar.
    model = walk.creature.model
    pos, rot = poses_of(model, walk.qpos[frames], ("geom_xpos", "geom_xmat"))
    shown = seen_geoms(model)
    others = beside(model, walk.creature.settings.creature.beside)
    own = shown[~others[model.geom_bodyid[shown]]]
    flat = np.tile(np.eye(3), (len(own), 1, 1))
    local = Silhouettes(model, own).outermost(np.zeros((len(own), 3)), flat, CORNERS)
    points = np.einsum("tbij,bkj->tbki", rot[:, own], local) + pos[:, own, None]
    volume = np.ptp(local, axis=1).prod(1)
    if not walk.afloat and walk.ground is not None:
        places = points[..., :2].reshape(-1, 2)
        points[..., 2] -= walk.ground_heights(places).reshape(points.shape[:-1])
    turn = rot[:, own[int(volume.argmax())]]
    return Motion(points, turn, volume, every * walk.time_step, walk.afloat)


def by_strategy(shown: Sequence[Entry]) -> list[Entry]:
    """Return champions sorted by strategy, the fastest of each first."""
    return sorted(shown, key=lambda one: (WORDS.index(one.strategy), -one.speed))


def tally(shown: Sequence[Entry]) -> str:
    """Return the strategies with their numbers, such as "wag 3, paddle 1"."""
    words = [one.strategy for one in shown]
    return ", ".join(f"{word} {words.count(word)}" for word in dict.fromkeys(words))


TILE, STRIP, MOST_COLUMNS = (400, 260), 44, 5
"""Pixels of each picture, height of the text below, and most pictures in a row."""
HEAD, EDGE = 46, 10
PAPER, SOFT_INK = (250, 250, 249), (96, 100, 106)
MOMENT = 4.0
"""Time at which a still picture shows each champion, s."""


class Sheet:
    """A grid of pictures, each with its own scale and camera, and a title.

    They keep the whole body in the picture for all seconds shown.
    """

    def __init__(self, shown: Sequence[Entry], title: str, seconds: float) -> None:
        self.shown, self.title = shown, title
        self.stages = [Stage([_beginning(one.walk, seconds)], *TILE) for one in shown]
        rows = -(-len(shown) // MOST_COLUMNS)
        self.columns = -(-len(shown) // rows)
        width, height = TILE[0] + EDGE, TILE[1] + STRIP + EDGE
        self.size = self.columns * width + EDGE, HEAD + rows * height

    def picture(self, time: float) -> Image.Image:
        """Draw all champions at s since their starts; one that ended stays in its last pose."""
        sheet = Image.new("RGB", self.size, PAPER)
        draw = ImageDraw.Draw(sheet)
        draw.text((EDGE, HEAD / 2), self.title, DARK_INK, font(20), anchor="lm")
        for number, (one, stage) in enumerate(zip(self.shown, self.stages, strict=True)):
            row, column = divmod(number, self.columns)
            x = EDGE + column * (TILE[0] + EDGE)
            y = HEAD + row * (TILE[1] + STRIP + EDGE)
            sheet.paste(stage.picture(min(round(time / stage.time_step), stage.frames - 1)), (x, y))
            y += TILE[1]
            draw.text((x, y + 3), f"{one.strategy}, {one.does}", DARK_INK, font(17))
            verdict = "certified" if one.certified else "not certified"
            draw.text((x, y + 24), f"{one.name}, {verdict}", SOFT_INK, font(14))
        return sheet

    def pictures(self, seconds: float, fps: int) -> Iterator[Image.Image]:
        """Draw the frames of a video."""
        return (self.picture(frame / fps) for frame in range(max(int(seconds * fps), 1)))


def _beginning(walk: Walk, seconds: float) -> Walk:
    """The first seconds of a walk."""
    count = max(round(seconds / walk.time_step), 2)
    return dataclasses.replace(walk, trajectory=walk.trajectory.taken(slice(count)))
