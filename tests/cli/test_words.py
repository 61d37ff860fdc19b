"""Commands as a user types them: help, other names, a creature first, exit codes, errors."""

import importlib
import logging
import re
from pathlib import Path

import pytest
from helpers import STOOL, said_by

from mjxgait.cli import COMMANDS
from mjxgait.cli.options import _sentence, parsed
from mjxgait.cli.train_options import COMMON
from mjxgait.config.layers import shipped_creatures
from mjxgait.output import LOG, print_details

PAGE = Path(__file__).parents[2] / "docs" / "reference" / "command-line.md"


@pytest.fixture
def given(monkeypatch: pytest.MonkeyPatch) -> list[list[str]]:
    """The options that subcommands were called with; they do nothing."""
    calls: list[list[str]] = []
    for name in ("train", "refine", "repertoire", "list"):
        command = f"mjxgait.cli.{name}.{name}_command"
        monkeypatch.setattr(command, lambda options: calls.append(list(options)) or 0)
    return calls


@pytest.mark.parametrize(
    ("typed", "meant"),
    [
        ("train crab", "--env crab"),
        ("train crab --seed 3", "--env crab --seed 3"),
        ("train envs/my_dog", "--env envs/my_dog"),
        ("train --env crab", "--env crab"),
        ("train", ""),
        ("refine duck --keys walk.glb", "--env duck --keys walk.glb"),
        ("repertoire duck", "--env duck"),
        ("train help", "--help"),
        ("help train", "--help"),
        ("envs", ""),
    ],
)
def test_what_is_typed_is_what_is_meant(
    typed: str, meant: str, given: list[list[str]], capsys: pytest.CaptureFixture
):
    said_by(capsys, *typed.split(), code=0)
    assert given == [meant.split()]


@pytest.mark.parametrize("asked", ["--help", "-h", "help", "help help", "--help-all"])
def test_help_lists_every_subcommand(asked: str, capsys: pytest.CaptureFixture):
    said = said_by(capsys, *asked.split(), code=0)
    assert all(f"{one.what}: {one.example}" in said for one in COMMANDS.values())
    assert max(map(len, said.splitlines())) <= 100


@pytest.mark.parametrize(
    ("typed", "answer"),
    [
        ("crab", 'mjxgait: "crab" is a creature; evolve its walk with: mjxgait train crab'),
        ("trian", 'mjxgait: unknown subcommand "trian"; did you mean "train"?'),
        ("train crab --env duck", "mjxgait: the creature is named twice, crab and with --env"),
        ("train --generations many", "mjxgait: --generations: 'many': give a whole number;"),
        ("train --evolution.target high", "mjxgait: --evolution.target: 'high': give a number;"),
        ("train --generatoins 3", "did you mean --generations"),
        ("train --physics mjy", "--physics"),
        ("render runs/x --size 3 --out walk.webp", "--size"),
        ("cache cler", "'clear'"),
        ("stress", "RUN|PATH"),
    ],
)
def test_a_mistake_is_one_sentence(typed: str, answer: str, capsys: pytest.CaptureFixture):
    said = said_by(capsys, *typed.split(), code=2)
    assert said.startswith("mjxgait: ")
    assert re.search(answer.replace("?", r"\?"), said), said
    assert len(said.splitlines()) == 1
    assert "NoneType" not in said
    assert not set("╭│╰─+") & set(said)


@pytest.mark.parametrize("frame", ["╭╮│╰╯─", "     -"], ids=["unicode", "ascii"])
def test_the_frame_of_an_error_is_taken_away(frame: str):
    first, last, side, low, end, rule = frame
    shown = f"""{first}{rule} Value error {rule * 4}{last}
{side} Error parsing --x: 'abc': give a whole   {side}
{side} number.                                  {side}
{side} {rule * 40} {side}
{side} Perhaps you meant:                       {side}
{side}     --xx INT  of --other things          {side}
{side} {rule * 40} {side}
{side} Argument helptext:                       {side}
{side}     --x INT                              {side}
{low}{rule * 42}{end}
"""
    assert _sentence(shown) == "--x: 'abc': give a whole number; did you mean --xx?"


def test_help_all_lists_every_key_and_help_the_common_options(capsys: pytest.CaptureFixture):
    said = said_by(capsys, "train", "--env", STOOL, "--help-all", code=0)
    assert "--evolution.elite" in said
    short = said_by(capsys, "train", "--help", code=0)
    listed = re.findall(r"^[ │] +(?:-\w, )?--([\w-]+)", short, re.M)
    assert set(COMMON) | {"seed"} <= {name.replace("-", "_") for name in listed}
    assert all(f"--{name.replace('_', '-')}" in said for name in COMMON)


def test_the_page_lists_all_commands_and_exit_codes():
    page = PAGE.read_text(encoding="utf-8")
    assert re.findall(r"^\| `(\w+)", page.partition("## Exit codes")[0], re.M) == [*COMMANDS]
    assert re.findall(r"^\| (\d+) \|", page, re.M) == ["0", "1", "2", "130"]


def test_exit_codes(capsys: pytest.CaptureFixture, monkeypatch: pytest.MonkeyPatch):
    """0 and 2 end most tests of commands."""
    monkeypatch.setattr("mjxgait.cli.doctor.free_memory", lambda: 1.0)
    monkeypatch.setattr("mjxgait.cli.doctor.accelerator", lambda: _missing())
    monkeypatch.setattr("mjxgait.cli.doctor.working", lambda backends: [])
    said_by(capsys, "doctor", code=1)

    def interrupted(options: object) -> int:
        raise KeyboardInterrupt

    monkeypatch.setattr("mjxgait.cli.list.list_command", interrupted)
    assert said_by(capsys, "list", code=130) == "mjxgait: interrupted\n"


def _missing() -> object:
    from mjxgait.cli.doctor import Finding

    return Finding("devices", "none", "mend it", needed=True)


def test_a_creature_is_not_a_subcommand():
    assert not set(shipped_creatures()) & COMMANDS.keys()


@pytest.mark.parametrize("name", ["train", "refine", "repertoire", "ablate"])
@pytest.mark.parametrize("flag", ["", "-v", "--verbose"])
def test_verbose_commands_print_details(name: str, flag: str, monkeypatch: pytest.MonkeyPatch):
    printed: list[bool] = []
    monkeypatch.setattr("mjxgait.cli.options.print_details", lambda: printed.append(True))
    module = importlib.import_module(f"mjxgait.cli.{name}")
    options = parsed(getattr(module, f"{name.capitalize()}Options"), name, flag.split())
    assert (bool(printed), options.verbose, options.quiet) == (bool(flag), bool(flag), False)


def test_details_are_printed_beside_the_progress(capsys: pytest.CaptureFixture):
    before = LOG.handlers[:]
    try:
        print_details()
        LOG.debug("evaluate: compiled")
        LOG.info("Compiling…")
    finally:
        LOG.handlers[:] = before
        LOG.setLevel(logging.NOTSET)
    said = capsys.readouterr()
    assert (said.out, said.err.split(" ", 1)[1]) == ("", "evaluate: compiled\n")
