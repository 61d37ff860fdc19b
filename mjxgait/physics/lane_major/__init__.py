"""MuJoCo's step for walking creatures over many lanes: MJX's physics, several times faster on CPU.

It supports trees of bodies with spheres and capsules that touch one floor. Anything else raises
`UnsupportedModel`.
"""

from mjxgait.physics.lane_major.model import UnsupportedModel
from mjxgait.physics.lane_major.plant import LaneMajorPlant, lane_major_plant

__all__ = ["LaneMajorPlant", "UnsupportedModel", "lane_major_plant"]
