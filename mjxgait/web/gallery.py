"""One HTML file in which several champions move side by side in one scene, without any network."""

import base64
import html
from collections.abc import Sequence

import numpy as np

from mjxgait.animation.export import WalkLoop, walk_loop, walk_take
from mjxgait.animation.export.school import School, Track, build_school
from mjxgait.errors import UserError
from mjxgait.rendering.gallery import Entry, tally
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
        code=asset("gallery.js"),
    )


def _scene(shown: Sequence[Entry], water: bool) -> dict[str, object]:
    """Everything that the page needs of one scene."""
    school = build_school([_loop(one) for one in shown], water)
    pairs = zip(shown, school.tracks, strict=True)
    return {
        "water": water,
        "glb": base64.b64encode(school.glb).decode("ascii"),
        **_camera(school),
        "members": [_member(number, *pair) for number, pair in enumerate(pairs)],
    }


def _loop(one: Entry) -> WalkLoop:
    """The motion as a loop; the whole recording, with a seam, where it never repeats."""
    try:
        return walk_loop(one.walk, RATE)
    except UserError:
        return walk_take(one.walk, RATE)


def _camera(school: School) -> dict[str, object]:
    azimuth, polar = school.orbit
    return {
        "target": _rounded(school.target),
        "far": round(school.far, DIGITS),
        "azimuth": azimuth,
        "polar": polar,
    }


def _member(number: int, one: Entry, track: Track) -> dict[str, object]:
    return {
        "number": number,
        "name": one.name,
        "strategy": one.strategy,
        "does": one.does,
        "verdict": one.doubt or CERTIFIED,
        "certified": one.certified,
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
