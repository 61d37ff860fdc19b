"""One HTML file in which several champions move side by side in one scene, without any network."""

import base64
import dataclasses
import html
from collections.abc import Sequence

import numpy as np

from mjxgait.animation.export import WalkLoop, walk_loop, walk_take
from mjxgait.animation.export.school import School, Track, build_school
from mjxgait.errors import UserError
from mjxgait.rendering.gallery import Entry, tally
from mjxgait.rendering.walk import Walk
from mjxgait.web.certificate import table
from mjxgait.web.templates import asset, embedded, embedded_json, style, template, viewer_script

RATE = 25
"""Key frames per second; the page interpolates."""
CERTIFIED = "Certified"
DIGITS = 4
"""Decimals of lengths in m."""


def build_gallery(shown: Sequence[Entry], title: str) -> str:
    """Return the text of the page. Swimmers have a scene of their own, below those on land."""
    scenes = [
        _scene([one for one in shown if one.walk.afloat == water], water)
        for water in (False, True)
        if any(one.walk.afloat == water for one in shown)
    ]
    certified = sum(one.certified for one in shown)
    return template("gallery.html").substitute(
        title=html.escape(title),
        style=style(),
        lead=html.escape(f"{certified} of {len(shown)} certified. By strategy: {tally(shown)}."),
        facts=embedded_json({"scenes": scenes}),
        table=_table(shown),
        viewer=embedded(viewer_script()),
        code=asset("school.js") + asset("gallery.js"),
    )


@dataclasses.dataclass(frozen=True)
class Words:
    """What a page says of a creature in a scene.

    name, does, verdict: shown together at the pointer. label: always shown beside it. well: False
    for a bold verdict.
    """

    name: str
    label: str
    does: str
    verdict: str
    well: bool


def scene_of(loops: Sequence[WalkLoop], words: Sequence[Words], water: bool) -> dict[str, object]:
    """Return everything that `school.js` needs to show motions side by side in one scene."""
    school = build_school(loops, water)
    pairs = zip(words, school.tracks, strict=True)
    return {
        "water": water,
        "glb": base64.b64encode(school.glb).decode("ascii"),
        **_camera(school),
        "members": [_member(number, *pair) for number, pair in enumerate(pairs)],
    }


def looped(walk: Walk) -> WalkLoop:
    """Return the motion as a loop; the whole recording, with a seam, where it never repeats."""
    try:
        return walk_loop(walk, RATE)
    except UserError:
        return walk_take(walk, RATE)


def _scene(shown: Sequence[Entry], water: bool) -> dict[str, object]:
    words = [
        Words(one.name, one.strategy, one.does, one.doubt or CERTIFIED, one.certified)
        for one in shown
    ]
    return scene_of([looped(one.walk) for one in shown], words, water)


def _camera(school: School) -> dict[str, object]:
    azimuth, polar = school.orbit
    return {
        "target": _rounded(school.target),
        "far": round(school.far, DIGITS),
        "azimuth": azimuth,
        "polar": polar,
    }


def _member(number: int, one: Words, track: Track) -> dict[str, object]:
    return {
        "number": number,
        "name": one.name,
        "strategy": one.label,
        "does": one.does,
        "verdict": one.verdict,
        "certified": one.well,
        "seconds": track.seconds,
        "parts": track.parts,
        "motion": _floats(track.bodies),
        "lamp": None if track.lamp is None else _floats(track.lamp),
        "marks": _rounded(track.marks),
        "flow": round(track.flow, DIGITS),
        "half": _rounded(track.half),
        "middle": _rounded(track.middle),
    }


def _floats(values: np.ndarray) -> str:
    """Little-endian float32 in base64."""
    return base64.b64encode(values.astype("<f4").tobytes()).decode("ascii")


def _rounded(values: np.ndarray) -> list[float]:
    rounded: list[float] = np.round(values, DIGITS).tolist()
    return rounded


def _table(shown: Sequence[Entry]) -> str:
    rows = [[one.strategy, one.name, one.does, one.doubt or CERTIFIED] for one in shown]
    return table(("strategy", "run", "does", "certificate"), rows)
