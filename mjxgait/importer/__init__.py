"""Import of a model file (MJCF or URDF) as a creature folder."""

from mjxgait.importer.convert import (
    TOML,
    WRITTEN,
    ImportChoices,
    Imported,
    import_model,
)
from mjxgait.importer.robots import robot_name

__all__ = ["TOML", "WRITTEN", "ImportChoices", "Imported", "import_model", "robot_name"]
