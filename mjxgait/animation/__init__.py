"""Animation files: export to other programs, and import from them."""

from typing import Literal

Rate = Literal[24, 30, 60]
"""Key frames per second of an exported walk."""
