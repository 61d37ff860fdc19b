"""A word for how a body gets on, from its motion alone (docs/guide/seeing.md).

Every word is a comparison of a few measures with fixed numbers. Where no word fits, the motion is
`UNNAMED`. Letters: `T` frames, `B` parts, `K` outermost points of a part.
"""

import dataclasses
from functools import cached_property

import numpy as np

UNNAMED = "unnamed"
WATER = ("undulate", "wag", "scull", "paddle", "spin")
LAND = ("walk", "crawl", "rock", "inchworm", "hop", "jump", "roll")
WORDS = (*WATER, *LAND, UNNAMED)
"""All words, in the order in which a gallery shows them."""

STILL = 0.05
"""Least speed in body lengths per second; a slower body gets nowhere."""
SWING = 0.02
"""Least swing of a part (root mean square) in body lengths."""
SPIN, ROLL, TURNS = 0.25, 0.1, 1.0
"""Least turns per second in water, on land, and least turns in all."""
STEADY = 0.5
"""Least net turning over all turning: a body that rocks turns back."""
ALONG = 0.4
"""Least share of swinging along the way for a paddle; of swinging in all directions it is 1/3."""
REAR = -0.1
"""Place of the swinging in body lengths ahead of the middle, from which on it is a tail's."""
WAVE, CHAIN, LIVELY = 90.0, 3, 0.25
"""Least lag in degrees from the foremost part to the hindmost; least number of parts in the wave;
least swing of these over the largest.
"""
CLEAR = 0.01
"""Height above the ground in body lengths from which on a part is in the air."""
AIRBORNE = 0.1
"""Least share of the time with all parts in the air."""
SHORTENS, ARCHES = 0.25, -0.5
"""Least change of length over length, and largest correlation of length and height."""
DRAGS, CARRIED = 0.5, 0.1
"""Least share of the time on the ground of a part that drags; largest of one that is carried."""
ROCKS = 5.0
"""Least tilt to and fro in degrees (root mean square) of a part that rocks."""


@dataclasses.dataclass(frozen=True, eq=False)
class Motion:
    """A motion without its beginning.

    points: [T, B, K, 3] m, outermost points of each part above the ground z = 0. turn: [T, 3, 3]
    rotation of the largest part. volume: [B] of the parts. time_step: s. water: no ground.
    """

    points: np.ndarray
    turn: np.ndarray
    volume: np.ndarray
    time_step: float
    water: bool

    @cached_property
    def places(self) -> np.ndarray:
        """Middles [T, B, 3] m of the parts."""
        middles: np.ndarray = self.points.mean(2)
        return middles

    @cached_property
    def middle(self) -> np.ndarray:
        """Middle [T, 3] m of the body, by volume."""
        return np.einsum("tbi,b->ti", self.places, self.volume / self.volume.sum())

    @cached_property
    def way(self) -> np.ndarray:
        """Way [3] m from the first frame to the last; level on land."""
        gone: np.ndarray = (self.middle[-1] - self.middle[0]) * [1, 1, float(self.water)]
        return gone

    @cached_property
    def ahead(self) -> np.ndarray:
        """Unit vector [3] along the way."""
        length = np.linalg.norm(self.way)
        return self.way / length if length > 0 else np.array([1.0, 0.0, 0.0])

    @cached_property
    def span(self) -> np.ndarray:
        """Length [T] m of the body along the way."""
        along = self.points @ self.ahead
        length: np.ndarray = np.ptp(along, axis=(1, 2))
        return length

    @property
    def length(self) -> float:
        """Body length in m: the mean span along the way."""
        return float(self.span.mean())

    @property
    def seconds(self) -> float:
        """Duration."""
        return (len(self.points) - 1) * self.time_step

    @property
    def speed(self) -> float:
        """Speed along the way in body lengths per second."""
        return float(np.linalg.norm(self.way)) / self.seconds / self.length

    @cached_property
    def on_ground(self) -> np.ndarray:
        """Whether each part is on the ground [T, B]."""
        low: np.ndarray = self.points[..., 2].min(2) < CLEAR * self.length
        return low

    @property
    def airborne(self) -> float:
        """Share of the time with all parts in the air."""
        return float((~self.on_ground.any(1)).mean())


def strategy(motion: Motion) -> str:
    """Return the word for a motion, one of `WORDS`."""
    return _in_water(motion) if motion.water else _on_land(motion)


def _in_water(motion: Motion) -> str:
    if motion.speed < STILL:
        return UNNAMED
    net, share = turning(motion)
    if np.linalg.norm(net) >= SPIN and share >= STEADY:
        return "spin"
    swing = swinging(motion)
    if np.sqrt((swing**2).sum(2).mean(0)).max() < SWING * motion.length:
        return UNNAMED
    along, place = where_it_swings(motion, swing)
    if along >= ALONG:
        return "paddle"
    if lag_of_wave(motion, swing) >= WAVE:
        return "undulate"
    return "wag" if place <= REAR else "scull"


def _on_land(motion: Motion) -> str:
    moves = motion.speed >= STILL
    net, share = turning(motion)
    over = float(net @ np.cross([0.0, 0.0, 1.0], motion.ahead))
    if moves and over >= ROLL and over * motion.seconds >= TURNS and share >= STEADY:
        return "roll"
    if motion.airborne >= AIRBORNE:
        return "hop" if moves else "jump"
    if not moves:
        return UNNAMED
    if is_inchworm(motion):
        return "inchworm"
    down = motion.on_ground.mean(0)
    largest = int(motion.volume.argmax())
    others = np.delete(down, largest)
    if down[largest] <= CARRIED and ((others >= 0.1) & (others <= 0.9)).sum() >= 2:
        return "walk"
    if tilt(motion) >= ROCKS:
        return "rock"
    swing = np.sqrt((swinging(motion) ** 2).sum(2).mean(0)).max()
    return "crawl" if down[largest] >= DRAGS and swing >= SWING * motion.length else UNNAMED


def turning(motion: Motion) -> tuple[np.ndarray, float]:
    """Return the largest part's net turns per second [3] about the world's axes, and how steady.
    The steadiness is the net turning over all turning, 0 to 1.
    """
    change = motion.turn[1:] @ motion.turn[:-1].transpose(0, 2, 1)
    axis = change[:, [2, 0, 1], [1, 2, 0]] - change[:, [1, 2, 0], [2, 0, 1]]
    sine = np.linalg.norm(axis, axis=1, keepdims=True) / 2
    cosine = (np.trace(change, axis1=1, axis2=2)[:, None] - 1) / 2
    spin = axis / np.maximum(2 * sine, 1e-12) * np.arctan2(sine, cosine)
    net, whole = spin.sum(0), np.linalg.norm(spin, axis=1).sum()
    steadiness = float(np.linalg.norm(net) / whole) if whole > 0 else 0.0
    return net / (2 * np.pi * motion.seconds), steadiness


def swinging(motion: Motion) -> np.ndarray:
    """Return how far [T, B, 3] m each part is from its mean place of the cycle around.

    Places are those relative to the body's middle, so that neither the way nor a slow turn counts.
    """
    places = motion.places - motion.middle[:, None]
    frames = _cycle(places - places.mean(0))
    padded = np.pad(places, ((frames // 2, frames - 1 - frames // 2), (0, 0), (0, 0)), "edge")
    total = np.cumsum(np.concatenate([np.zeros_like(padded[:1]), padded]), axis=0)
    swing: np.ndarray = places - (total[frames:] - total[:-frames]) / frames
    return swing


def where_it_swings(motion: Motion, swing: np.ndarray) -> tuple[float, float]:
    """Return the share of swinging along the way, and the place of that across, in body lengths.

    A part counts by the area that it moves and the square of its swing. The place is 0 at the
    body's middle and positive ahead of it.
    """
    area = motion.volume ** (2 / 3)
    along = (swing @ motion.ahead) ** 2
    across = (swing**2).sum(2) - along
    work, beside = area * along.mean(0), area * across.mean(0)
    share = float(work.sum() / (work + beside).sum())
    place = ((motion.places - motion.middle[:, None]) @ motion.ahead).mean(0)
    return share, float(place @ beside / beside.sum() / motion.length) if beside.any() else 0.0


def lag_of_wave(motion: Motion, swing: np.ndarray) -> float:
    """Return by how many degrees the hindmost part swings after the foremost; 0 for no wave.

    Only a wave that each part passes on to the one behind it counts, in the plane in which the
    body swings most.
    """
    across = swing - (swing @ motion.ahead)[..., None] * motion.ahead
    flat = across.reshape(-1, 3)
    main = np.linalg.eigh(flat.T @ flat)[1][:, -1]
    spectrum = np.fft.rfft(across @ main, axis=0)
    rhythm = int(np.abs(spectrum[1:]).sum(1).argmax()) + 1
    strength = np.abs(spectrum[rhythm])
    place = ((motion.places - motion.middle[:, None]) @ motion.ahead).mean(0)
    front_to_rear = [b for b in np.argsort(-place) if strength[b] >= LIVELY * strength.max()]
    if len(front_to_rear) < CHAIN:
        return 0.0
    phase = np.angle(spectrum[rhythm, front_to_rear])
    lags = np.degrees((phase[:-1] - phase[1:] + np.pi) % (2 * np.pi) - np.pi)
    return float(lags.sum()) if (lags > 0).all() else 0.0


def tilt(motion: Motion) -> float:
    """Return the tilt in degrees (root mean square) of the largest part from its mean attitude."""
    up = motion.turn[:, 2]
    mean = up.mean(0) / np.linalg.norm(up.mean(0))
    return float(np.degrees(np.sqrt((np.arccos(np.clip(up @ mean, -1, 1)) ** 2).mean())))


def is_inchworm(motion: Motion) -> bool:
    """Return whether the body shortens as it arches up and lengthens as it lies down."""
    height = np.ptp(motion.points[..., 2], axis=(1, 2))
    low, high = np.percentile(motion.span, [5, 95])
    if (high - low) < SHORTENS * motion.length or np.std(height) == 0:
        return False
    return float(np.corrcoef(motion.span, height)[0, 1]) <= ARCHES


def _cycle(swing: np.ndarray) -> int:
    """Return the frames of a cycle: the strongest rhythm with at least two cycles in the motion."""
    power = (np.abs(np.fft.rfft(swing, axis=0)) ** 2).sum((1, 2))
    return max(round(len(swing) / (2 + int(power[2:].argmax()))), 1) if len(power) > 2 else 1
