"""Options of a command that continues something."""

import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from mjxgait.errors import UserError

if TYPE_CHECKING:
    from _typeshed import DataclassInstance


def check_resumed(
    request: "DataclassInstance", folder: Path, free: Sequence[str], kept: str
) -> None:
    """Refuse options that what is resumed would ignore.

    Args:
      free: names of the options that may be given besides `resume`.
      kept: what the folder keeps, as the beginning of a sentence: "a resumed study keeps its runs".

    Raises:
      UserError: another option has not its default.
    """
    plain = type(request)()
    allowed = {name: getattr(plain, name) for name in ("resume", *free)}
    if dataclasses.replace(request, **allowed) != plain:
        options = ", ".join(f"--{name.replace('_', '-')}" for name in free)
        raise UserError(f"{folder}: {kept}; only {options} may be given")
