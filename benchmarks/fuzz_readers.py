"""Mutate files, guided by the code that they reach, and stop at the first that is not refused.
    pip install atheris
    python benchmarks/fuzz_readers.py bvh --seconds 600 --corpus fuzz/bvh

Readers: glb, bvh, urdf, expressions. A reader may return, or raise one `UserError` with a sentence
of one line. Anything else, and anything that takes more than ten seconds, is a finding: atheris
prints the traceback and writes the file as `crash-...`. The corpus keeps what reached new code, so
a second run goes on where the first has ended. docs/testing.md has the hours.
"""

import argparse
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import atheris

with atheris.instrument_imports(include=["mjxgait"]):
    from mjxgait.animation.clips.read_glb import read_glb
    from mjxgait.animation.clips.read_text import read_bvh
    from mjxgait.controllers.expressions.parse import read_programs
    from mjxgait.controllers.expressions.serialize import Vocabulary
    from mjxgait.controllers.expressions.text import Terminal
    from mjxgait.controllers.expressions.written import MOST_NODES
    from mjxgait.errors import UserError
    from mjxgait.importer.notes import Notes
    from mjxgait.importer.read import read_source
    from mjxgait.processes import python_command

ROOT = Path(__file__).resolve().parents[1]
WALK = ROOT / "docs" / "data" / "walk"
BVH = b"""HIERARCHY
ROOT hips
{
  OFFSET 0 1 0
  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
  JOINT leg
  {
    OFFSET 0.1 0 0
    CHANNELS 3 Zrotation Xrotation Yrotation
    End Site
    {
      OFFSET 0 -1 0
    }
  }
}
MOTION
Frames: 2
Frame Time: 0.033
0 1 0 0 0 0 10 0 0
0 1 0 0 0 0 20 0 0
"""
URDF = b"""<?xml version="1.0"?>
<robot name="r"><link name="base"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0"
ixz="0" iyz="0"/></inertial><collision><geometry><box size="1 1 1"/></geometry></collision></link>
<link name="leg"><visual><geometry><cylinder radius="0.1" length="1"/></geometry></visual></link>
<joint name="hip" type="revolute"><parent link="base"/><child link="leg"/><axis xyz="0 1 0"/>
<limit lower="-1" upper="1" effort="5" velocity="9"/></joint></robot>
"""
EXPRESSIONS = b"""# a lamp
(list (+ a0 (* 0.5 vx)) (ifltz (% px 2) (- a1) s0) (/ t -3e2))
base = (+ 1 (- a2 t))
"""


def expressions(path: Path) -> None:
    """Read a file of programs, as `--expressions` does."""
    names = ("a0", "a1", "a2", "vx", "px", "s0", "t")
    vocabulary = Vocabulary(
        tuple(Terminal(name, 20 + i, name) for i, name in enumerate(names)), MOST_NODES
    )
    text = path.read_bytes().decode("utf-8", "replace")
    read_programs(text, ("base", "knee", "neck"), vocabulary, path.name)


def urdf(path: Path) -> None:
    """Read and clean a model file; MuJoCo's own reader, which is C++, is not reached."""
    read_source(path, [], Notes())


def exported() -> bytes:
    """The walk of the documentation as a GLB file."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "walk.glb"
        subprocess.run(
            python_command("mjxgait", "export", str(WALK), "--out", str(out)), check=True
        )
        return out.read_bytes()


READERS: dict[str, tuple[Callable[[Path], object], str, Callable[[], bytes]]] = {
    "glb": (read_glb, ".glb", exported),
    "bvh": (read_bvh, ".bvh", lambda: BVH),
    "urdf": (urdf, ".urdf", lambda: URDF),
    "expressions": (expressions, ".txt", lambda: EXPRESSIONS),
}


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("reader", choices=READERS)
    parser.add_argument("--seconds", type=int, default=600)
    parser.add_argument("--corpus", type=Path, required=True, help="folder, made if missing")
    options = parser.parse_args()
    read, ending, seed = READERS[options.reader]
    options.corpus.mkdir(parents=True, exist_ok=True)
    (options.corpus / "seed").write_bytes(seed())
    folder = tempfile.TemporaryDirectory(prefix="mjxgait-fuzz-")
    path = Path(folder.name) / f"input{ending}"

    def once(data: bytes) -> None:
        path.write_bytes(data)
        try:
            read(path)
        except UserError as error:
            if "\n" in str(error):
                raise AssertionError(f"more than one line: {error}") from error

    atheris.Setup(
        [
            sys.argv[0],
            str(options.corpus),
            f"-max_total_time={options.seconds}",
            "-timeout=10",
            "-rss_limit_mb=4096",
            f"-artifact_prefix={options.corpus.parent}{os.sep}",
            "-print_final_stats=1",
        ],
        once,
    )
    atheris.Fuzz()


if __name__ == "__main__":
    main()
