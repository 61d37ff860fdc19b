"""From somebody's model file (MJCF or URDF) to a creature folder."""

from mjxgait.importing.convert import ImportChoices, Imported, import_model

__all__ = ["ImportChoices", "Imported", "import_model"]
