"""A walk as an animation file that other programs open."""

from mjxgait.animation.glb import build_glb, export_glb
from mjxgait.animation.loop import RATES, WalkLoop, walk_loop, walk_take

__all__ = ["RATES", "WalkLoop", "build_glb", "export_glb", "walk_loop", "walk_take"]
