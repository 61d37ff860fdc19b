"""Import of a model (MJCF, URDF, xacro) or a skeleton (BVH, GLB, FBX) as a creature folder."""

from mjxgait.importer.convert import (
    TOML,
    WRITTEN,
    ImportChoices,
    Imported,
    import_model,
)
from mjxgait.importer.robots import robot_name

__all__ = ["TOML", "WRITTEN", "ImportChoices", "Imported", "import_model", "robot_name"]
