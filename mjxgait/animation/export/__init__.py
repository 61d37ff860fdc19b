"""A walk as an animation file that other programs open."""

from mjxgait.animation.export.bvh import build_bvh, export_bvh
from mjxgait.animation.export.character import Character, read_character
from mjxgait.animation.export.facts import examined
from mjxgait.animation.export.footfalls import contacts
from mjxgait.animation.export.glb import (
    build_clips,
    build_driven,
    build_glb,
    export_glb,
)
from mjxgait.animation.export.loop import (
    LOOP,
    WalkLoop,
    animation_of,
    falls_of_first_foot,
    resampled,
    standing_still,
    stride_in_phase,
    walk_loop,
    walk_take,
)
from mjxgait.animation.export.onto import bones_of, build_onto, export_onto
from mjxgait.animation.export.usd import export_usd
from mjxgait.animation.export.viewpoint import viewpoint

__all__ = [
    "LOOP",
    "Character",
    "WalkLoop",
    "animation_of",
    "bones_of",
    "build_bvh",
    "build_clips",
    "build_driven",
    "build_glb",
    "build_onto",
    "contacts",
    "examined",
    "export_bvh",
    "export_glb",
    "export_onto",
    "export_usd",
    "falls_of_first_foot",
    "read_character",
    "resampled",
    "standing_still",
    "stride_in_phase",
    "viewpoint",
    "walk_loop",
    "walk_take",
]
