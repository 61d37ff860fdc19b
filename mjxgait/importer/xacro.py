"""Expansion of a xacro template into a URDF, through the package xacrodoc.

A template is a small program: it may include any file that it names, so it must come from a source
that can be trusted. The result is read like any other untrusted model.
"""

import contextlib
import importlib
from collections.abc import Sequence
from pathlib import Path

from mjxgait.errors import UserError
from mjxgait.extras import install_command

TEMPLATE = ".xacro"
"""Suffix of a template."""


def expanded(path: Path, search: Sequence[Path]) -> bytes:
    """Return the URDF of a template.

    search: further folders in which `$(find PACKAGE)` looks for ROS packages.

    Raises:
      UserError: the package is missing, or the template cannot be expanded; says why.
    """
    try:
        xacrodoc = importlib.import_module("xacrodoc")
    except ImportError:
        raise UserError(
            f"{path}: a xacro template needs an extra: {install_command('robots')}; or run "
            f"`xacro {path.name} > robot.urdf` where ROS is installed, and import robot.urdf"
        ) from None
    full = path.resolve()
    try:
        text = full.read_text(encoding="utf-8")
        xacrodoc.packages.walk_up_from(full)
        xacrodoc.packages.look_in([str(folder.resolve()) for folder in search])
        # A template names other files from its own folder.
        with contextlib.chdir(full.parent):
            document = xacrodoc.XacroDoc.from_string(
                text, resolve_packages=False, rootdir=full.parent
            )
            urdf: str = document.to_urdf_string()
    except OSError as error:
        raise UserError(f"{path}: cannot be read ({error.strerror or error})") from None
    except Exception as error:  # a template can fail like any program
        why = " ".join(str(error).split()) or type(error).__name__
        raise UserError(f"{path}: this xacro template cannot be expanded ({why[:300]})") from None
    return urdf.encode()
