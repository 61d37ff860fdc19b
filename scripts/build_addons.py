"""Build the add-ons for other programs to install: `python scripts/build_addons.py --out DIR`.
Writes `mjxgait-blender-VERSION.zip`, for Blender's "Install from Disk", and the same for Godot,
Unity and Unreal, to unpack in the folder of a project. The same files make the same bytes.
"""

import argparse
import io
import zipfile
from collections.abc import Mapping
from pathlib import Path

from mjxgait import __version__
from mjxgait.files import write_bytes, writing

ROOT = Path(__file__).parents[1]
ADDONS = ROOT / "addons"
PLACES = {"blender": "", "godot": "addons/", "unity": "Assets/", "unreal": "Content/Python/"}
"""Folder of each add-on's files in its archive."""
KINDS = (".py", ".toml", ".gd", ".cfg", ".cs", ".md", ".svg")
DATE = (1980, 1, 1, 0, 0, 0)
"""Of all files; the earliest that an archive can state."""


def main() -> None:
    """Write the archives and print their names."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True, help="folder for the archives")
    out = parser.parse_args().out
    with writing(out):
        out.mkdir(parents=True, exist_ok=True)
        for name in PLACES:
            file = out / f"mjxgait-{name}-{__version__}.zip"
            write_bytes(file, archive(files_of(name)))
            print(file)


def files_of(name: str) -> dict[str, bytes]:
    """Return the content of an add-on's files by their place in the archive."""
    found = sorted(p for p in (ADDONS / name).rglob("*") if p.suffix in KINDS)
    files = {
        PLACES[name] + path.relative_to(ADDONS / name).as_posix(): path.read_bytes()
        for path in found
    }
    top = PLACES[name] and f"{PLACES[name]}mjxgait/"
    return files | {f"{top}LICENSE": (ROOT / "LICENSE").read_bytes()}


def archive(files: Mapping[str, bytes]) -> bytes:
    """Return a ZIP archive of files."""
    data = io.BytesIO()
    with zipfile.ZipFile(data, "w") as packed:
        for name, content in files.items():
            entry = zipfile.ZipInfo(name, DATE)
            entry.compress_type, entry.external_attr = zipfile.ZIP_DEFLATED, 0o644 << 16
            packed.writestr(entry, content)
    return data.getvalue()


if __name__ == "__main__":
    main()
