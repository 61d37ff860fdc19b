"""MuJoCo's step for walking creatures, written for many lanes at once: the same physics as MJX, several times faster on CPU.

Trees of bodies whose spheres and capsules touch one floor; anything else raises `UnsupportedModel`.
"""

from mjxgait.physics.lane_major.kernel import one_kernel
from mjxgait.physics.lane_major.plant import FastPlant, fast_plant
from mjxgait.physics.lane_major.support import UnsupportedModel

__all__ = ["FastPlant", "UnsupportedModel", "fast_plant", "one_kernel"]
