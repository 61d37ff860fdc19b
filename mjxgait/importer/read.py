"""Reading of a model file: MJCF, URDF, xacro, or a skeleton."""

import xml.etree.ElementTree as ET
from collections.abc import Sequence
from pathlib import Path

from mjxgait.animation.clips.clip import ELSEWHERE
from mjxgait.errors import UserError
from mjxgait.files import read_bytes
from mjxgait.importer.clean_mjcf import clean_mjcf
from mjxgait.importer.clean_urdf import clean_urdf
from mjxgait.importer.notes import Notes
from mjxgait.importer.rigged import RIGS, source_of_rig
from mjxgait.importer.source import MOST_XML, Places, Source, parse_text, parse_xml
from mjxgait.importer.xacro import TEMPLATE, expanded


def source_of(
    path: Path, search: Sequence[Path], up: str | None, height: float | None, notes: Notes
) -> Source:
    """Read a model file, or build the tree of a skeleton.

    search: further folders. up, height: of a skeleton, if the user states them; height in m.

    Raises:
      UserError: it cannot be read, or is of no known kind.
    """
    kind = path.suffix.lower()
    if kind in ELSEWHERE:
        raise UserError(f'{path}: cannot read "{kind}"; {ELSEWHERE[kind]}')
    if kind not in RIGS:
        if height is not None:
            raise UserError(
                f"--height is for skeletons ({', '.join(RIGS)}); {path} has its lengths"
            )
        return read_source(path, search, notes)
    return source_of_rig(path, up, height, notes)


def read_source(path: Path, search: Sequence[Path], notes: Notes) -> Source:
    """Read and clean the tree of a file.

    Raises:
      UserError: it cannot be read, or is neither MJCF nor URDF.
    """
    source, places = Source(_parsed(path, search)), Places(path, search)
    match source.tree.tag:
        case "mujoco":
            clean_mjcf(source, path, places, notes)
        case "robot":
            clean_urdf(source, path, places, notes)
        case other:
            raise UserError(
                f"{path}: begins with <{other[:40]}>; a model file begins with <mujoco> (MJCF) or "
                "<robot> (URDF)"
            )
    return source


def _parsed(path: Path, search: Sequence[Path]) -> ET.Element:
    if path.suffix.lower() == TEMPLATE:
        read_bytes(path, MOST_XML)
        return parse_text(expanded(path, search), path)
    return parse_xml(path)
