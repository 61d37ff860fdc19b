"""Commands that README.md and the guide show: each is accepted up to where its work begins."""

import importlib
import re
import shlex
import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest
from helpers import STOOL

from mjxgait.cli import main

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs" / "guide").glob("*.md"))]
BLOCK = re.compile(r"```sh\n(.*?)```", re.DOTALL)
INLINE = re.compile(r"`(mjxgait [^`]+)`")
ELSEWHERE = re.compile(r"robot:|my\.py|SUBCOMMAND|\[|…|\$|--resume|--help|--version")
"""Robots that must be downloaded; code that tests/plugins runs; forms with placeholders."""
PLACEHOLDERS = {"MODEL": "robot.urdf", "FILE": "walk.glb", "DIR": "envs/mine", "NAME": "duck"}


class Begun(BaseException):
    """The work of a command would begin."""


def begin(*given: object, **named: object) -> None:
    raise Begun


def commands() -> Iterator[str]:
    """Each command once, without its comment."""
    seen: set[str] = set()
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        lines = [line for block in BLOCK.findall(text) for line in block.splitlines()]
        # README.md shows whole commands in a table; elsewhere such words are parts of a sentence.
        inline = INLINE.findall(text) if page.name == "README.md" else []
        for line in [*lines, *inline]:
            for part in line.split("&&"):
                found = part.partition("  #")[0].strip()
                if found.startswith("mjxgait ") and not ELSEWHERE.search(found):
                    if found not in seen:
                        yield found
                    seen.add(found)


@pytest.fixture(autouse=True)
def files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The files that the commands of the guide name."""
    monkeypatch.chdir(tmp_path)
    for name in ("mine", "dog"):
        shutil.copytree(STOOL, tmp_path / "envs" / name)
    lamp = (ROOT / "docs" / "guide" / "lamp.md").read_text(encoding="utf-8")
    (tmp_path / "mine.txt").write_text("\n".join(re.findall(r"^    (\w+ = .+)$", lamp, re.M)))


@pytest.mark.parametrize("command", list(commands()))
def test_a_command_of_the_guide_is_accepted(command: str, monkeypatch: pytest.MonkeyPatch):
    _, *words = [PLACEHOLDERS.get(word, word) for word in shlex.split(command)]
    file = {"import": "import_", "train": "training"}.get(words[0], words[0])
    module = importlib.import_module(f"mjxgait.cli.{file}")
    if words[0] == "train":
        monkeypatch.setattr(module, "evolve", begin)
        monkeypatch.setattr(module, "evolve_seeds", begin)
    else:
        parsed = module.parsed
        monkeypatch.setattr(module, "parsed", lambda *given: begin(parsed(*given)))
    with pytest.raises(Begun):
        main(words)


def test_a_wrong_command_is_not_accepted(monkeypatch: pytest.MonkeyPatch):
    for wrong in ("mjxgait train --env crab --gati trot", "mjxgait render runs/first"):
        with pytest.raises(SystemExit):
            test_a_command_of_the_guide_is_accepted(wrong, monkeypatch)
