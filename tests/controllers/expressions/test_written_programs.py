"""Programs written by hand: parsing, initial population, and certification."""

import dataclasses
import json
import re
from pathlib import Path

import numpy as np
import pytest
from controllers.expressions.small_run import TABLES
from helpers import SHORT, STOOL, said_by

import mjxgait
from mjxgait.config.layers import find_creature
from mjxgait.controllers.expressions.parse import Vocabulary, read_programs
from mjxgait.controllers.expressions.serialize import program_text
from mjxgait.controllers.expressions.text import EMPTY, terminals
from mjxgait.controllers.expressions.written import with_expressions, written_champion
from mjxgait.creature import Creature, load_creature
from mjxgait.errors import UserError
from mjxgait.inspect import read_snapshot
from mjxgait.plugins import resolve_config
from mjxgait.plugins.registry import build_config
from mjxgait.training.experiment import build_experiment
from mjxgait.training.folder import METRICS
from mjxgait.training.logs import read_metrics

# The program that Gritz & Hahn printed for the lamp, from the transcript of the slides, line by
# line. The transcript lost every +, * and %, so one of them fills each missing function. Also
# added: the parenthesis before the last `ifltz` of the elbow, and the `*` for a "0" before "s0 vx".
SLIDES = """\
(list (- (ifltz a0 pz a2) (% a1 t))
(ifltz (- (- (ifltz a0 pz a2) (% a1 t)) (ifltz
(+ a2 15.4963) (ifltz a0 pz a2) (* a1 a2)))
(ifltz (+ (* s0 vx) (* a2 s0)) (* (- s0 vx) (+
a2 s0)) (% (- a1 a1) (- a1 t))) (+ (* a1 vz)
(ifltz (* pz a1) (* a0 pz) (% px a0)))) (-
(ifltz s0 (ifltz (- (* vx a0) (* vx vx)) (- (* vx
a0) (- (* -28.43282 t) (% a1 t))) (+ 16.5266
s0)) vz) (* a1 vz)) )
"""


@pytest.fixture(scope="module")
def luxo() -> Creature:
    return load_creature(find_creature("luxo"))


@pytest.fixture
def limits(luxo: Creature) -> Vocabulary:
    return Vocabulary(terminals(luxo, ("goal_distance",)), 64)


def read(text: str, luxo: Creature, limits: Vocabulary) -> list[str]:
    """The programs of a text, as stored in a run's settings."""
    programs = read_programs(text, luxo.joints.names, limits, "f.txt")
    return [program_text(luxo, program) for program in programs]


# Parsing


def test_the_program_of_the_slides_is_parsed(luxo: Creature, limits: Vocabulary):
    [found] = read(SLIDES, luxo, limits)
    assert found == " ".join(SLIDES.split()).replace("%", "/").replace(" )", ")")
    [(code, value)] = read_programs(SLIDES, luxo.joints.names, limits, "f.txt")
    assert (code != EMPTY).sum() == len(re.findall(r"[^\s()]+", SLIDES)) - 1
    assert np.float32(-28.43282) in value[2]


def test_a_program_may_have_one_line_per_joint(luxo: Creature, limits: Vocabulary):
    text = """
    # a comment, and the joints in any order
    neck = (* 2 ; here too
       a1)
    elbow=a0
    ankle = .5
    (list 1 2 (% a0 a1))
    """
    assert read(text, luxo, limits) == ["(list 0.5 a0 (* 2 a1))", "(list 1 2 (/ a0 a1))"]


def test_a_stored_program_parses_to_the_same_arrays(luxo: Creature, limits: Vocabulary):
    [first] = read_programs(SLIDES, luxo.joints.names, limits, "f.txt")
    [again] = read_programs(program_text(luxo, first), luxo.joints.names, limits, "f.txt")
    for one, other in zip(first, again, strict=True):
        np.testing.assert_array_equal(one, other)


def test_many_functions_side_by_side_can_be_parsed(luxo: Creature, limits: Vocabulary):
    """511 functions: recursion depth grows only with nesting."""
    text = "a0"
    for _ in range(9):
        text = f"(+ {text} {text})"
    [(code, _)] = read_programs(
        f"(list {text} 1 2)", luxo.joints.names, dataclasses.replace(limits, nodes=1024), "f.txt"
    )
    assert (code[0] != EMPTY).sum() == 1023


MISTAKES = [
    ("", "f.txt: holds no program; write (list EXPRESSION ...)"),
    ("# nothing\n", "f.txt: holds no program"),
    ("(list 1 2\n3", 'line 1: "(list" ends too early'),
    ("(list 1 2\n(+ 3", "line 2: ends too early"),
    ("(list 1 2)", '"list" has 2 expressions; give 3, one for each of ankle, elbow, neck'),
    ("(list 1\n2 3 4)", 'line 1: "list" has 4 expressions'),
    ("\n(+ 1 2)", 'line 2: a program begins with "(list"'),
    ("ankle = 1\nelbow = 2", 'line 2: no expression for joint "neck"'),
    ("ankle = 1\nankle = 2", 'line 2: a second expression for joint "ankle"'),
    ("ankle = 1\nelbow = (+ 2\nneck = 3", "line 2: ends too early"),
    ("elbo = 1", 'line 1: there is no joint "elbo"; did you mean "elbow"?'),
    ("ankle 1", 'line 1: "ankle": a program begins with'),
    ("(list 1 2\n(plus a0 1))", 'line 2: there is no function "plus"'),
    ("(list 1 2 a9)", '"a9" is neither a sense nor a number'),
    ("(list 1 2 b0)", '"b0" is neither a sense nor a number'),
    # From the transcript of the slides, without its operators.
    ("(list (- (ifltz a0 pz a2) ( a1 t)) 1 2)", '"a1" stands where a function must'),
    ("(list 1 2\n" + "(+ a0 " * 40 + "1" + ")" * 41, "line 2: 81 nodes; an expression may have 64"),
    ("(list 1 2\n" + "(abs " * 12 + "1" + ")" * 13, "line 2: more than 9 functions within"),
]


@pytest.mark.parametrize(("text", "words"), MISTAKES)
def test_a_mistake_is_reported_with_file_and_line(
    luxo: Creature, limits: Vocabulary, text: str, words: str
):
    with pytest.raises(UserError) as told:
        read(text, luxo, dataclasses.replace(limits, depth=9))
    assert str(told.value).startswith("f.txt")
    assert words in str(told.value)


# Initial population


def options(luxo: Creature, **tables: dict) -> dict:
    usual = dataclasses.asdict(resolve_config(luxo.settings.train, "luxo"))
    return usual | {name: {**usual[name], **table} for name, table in tables.items()}


def test_a_disallowed_symbol_error_says_how_to_allow_it(luxo: Creature, tmp_path: Path):
    file, config = tmp_path / "p.txt", build_config(options(luxo), "test")
    for text, words in (
        (SLIDES, 'line 1: "t" is not among controller.senses; add it: --controller.senses '),
        ("(list 1 2\n(sin a0))", 'line 2: "sin" is not among controller.functions; add it: '),
    ):
        file.write_text(text)
        with pytest.raises(UserError) as told:
            with_expressions(luxo, config, file)
        assert f"{file}, {words}" in str(told.value)
    assert str(told.value).endswith("'+' '-' '*' '/' 'ifltz' 'sin'")
    senses = [*config.controller.senses, "px", "t"]
    file.write_text(SLIDES)
    allowed = build_config(options(luxo, controller={"senses": senses}), "test")
    assert len(with_expressions(luxo, allowed, file).controller.expressions) == 1


def test_the_first_generation_starts_with_the_programs(luxo: Creature, tmp_path: Path):
    file = tmp_path / "p.txt"
    file.write_text("(list 0.25 a0 (* a1 2))\n(list 1 2 3)")
    small = {"population": 6, "initial_choice": 1}
    config = build_config(options(luxo, evolution=small), "test")
    begun = with_expressions(luxo, config, file)
    first, plain = (build_experiment(luxo, c).init().genomes for c in (begun, config))
    texts = [
        program_text(luxo, (np.asarray(first.code[i]), np.asarray(first.value[i])))
        for i in range(2)
    ]
    assert texts == ["(list 0.25 a0 (* a1 2))", "(list 1 2 3)"]
    # All other programs are drawn as without given ones.
    np.testing.assert_array_equal(first.code[2:], plain.code[2:])
    np.testing.assert_array_equal(first.value[2:], plain.value[2:])
    assert (np.asarray(first.code[:2]) != np.asarray(plain.code[:2])).any()


def test_written_programs_start_on_the_unscaled_body(luxo: Creature, tmp_path: Path):
    file = tmp_path / "p.txt"
    file.write_text("(list 0.25 a0 (* a1 2))")
    small = {"population": 4, "initial_choice": 1, "body": 1.2}
    config = build_config(options(luxo, evolution=small), "test")
    genomes = build_experiment(luxo, with_expressions(luxo, config, file)).init().genomes
    code, value = (np.asarray(leaf[0]) for leaf in (genomes.plan.code, genomes.plan.value))
    assert program_text(luxo, (code, value)) == "(list 0.25 a0 (* a1 2))"
    assert not genomes.sizes[0].any()
    assert genomes.sizes[1].any()


def trained(out: Path, file: Path, *more: object, generations: int = 1) -> tuple[object, ...]:
    """The command that trains a stool from the programs of a file."""
    settings = out.parent / "small.toml"
    settings.write_text(TABLES)
    begin = ("train", "--env", STOOL, "--controller", "program", "--expressions", file)
    limit = ("--generations", generations, "--out", out)
    return (*begin, "--config", settings, *limit, "--no-plots", *more)


FOUR = "(list 0.1 (* 0.3 (- 0 t)) (% a0 2) 0.2)\n"


def test_a_run_holds_its_programs_and_resumes_without_the_file(
    tmp_path: Path, capsys: pytest.CaptureFixture
):
    """Given programs fill the first generation; none is lost before its evaluation."""
    file = tmp_path / "mine.txt"
    texts = [f"(list 0.1 0.{i} (/ a0 2) (* t 0.{i}))" for i in range(1, 9)]
    file.write_text("\n".join(texts).replace("/", "%"))
    all_of_them = ("--evolution.initial-choice", 1)
    said_by(capsys, *trained(tmp_path / "whole", file, *all_of_them), code=0)
    begin = trained(tmp_path / "parts", file, *all_of_them, generations=0)
    said_by(capsys, *begin, code=0)
    file.unlink()
    begun = mjxgait.open(tmp_path / "parts")
    genomes = read_snapshot(begun.folder).arrays
    pairs = zip(genomes["genomes.code"], genomes["genomes.value"], strict=True)
    assert sorted(program_text(begun.creature, pair) for pair in pairs) == texts
    resumed = ("train", "--resume", tmp_path / "parts", "--no-plots")
    said_by(capsys, *resumed, "--generations", 1, code=0)
    whole, parts = (mjxgait.open(tmp_path / name) for name in ("whole", "parts"))
    assert whole.config.controller.expressions == tuple(texts)
    assert whole.champion.fingerprint == parts.champion.fingerprint
    lines = [read_metrics(run.folder / METRICS) for run in (whole, parts)]
    assert [line["best"] for line in lines[0]] == [line["best"] for line in lines[1]]
    told = ("train", "--resume", tmp_path / "parts", "--expressions", file)
    assert "a resumed run keeps the programs" in said_by(capsys, *told, code=2)


@pytest.mark.parametrize(
    ("content", "more", "words"),
    [
        (FOUR.encode() * 9, (), "9 programs, and a population of 8; take --population 9"),
        (FOUR.encode("utf-16"), (), "not a text file in UTF-8"),
        (b"", (), "holds no program"),
        (None, (), "no such file"),
        (b"(list 1 2 3 (+ 1 nose))", (), 'mine.txt, line 1: "nose" is neither'),
        (b"(list 1 2 3 (abs 1))", (), '"abs" is not among controller.functions'),
        (FOUR.encode(), ("--controller.depth", "1"), "more than 1 functions within each other"),
    ],
)
def test_a_mistake_is_reported_before_anything_is_written(
    content: bytes | None, more: tuple, words: str, tmp_path: Path, capsys: pytest.CaptureFixture
):
    file, out = tmp_path / "mine.txt", tmp_path / "run"
    if content is not None:
        file.write_bytes(content)
    if "--controller.depth" in more:
        more = (*more, "--controller.initial-depth", "1", "1")
    said = said_by(capsys, *trained(out, file, *more), code=2)
    assert words in said
    assert str(file) in said
    assert not out.exists()


def test_programs_require_the_program_controller(tmp_path: Path, capsys: pytest.CaptureFixture):
    file, out = tmp_path / "mine.txt", tmp_path / "run"
    file.write_text(FOUR)
    command = ("train", "--env", STOOL, "--expressions", file, "--out", out)
    assert "take --controller program" in said_by(capsys, *command, code=2)
    assert not out.exists()


def test_programs_in_a_settings_file_are_checked_too(tmp_path: Path, capsys: pytest.CaptureFixture):
    settings = tmp_path / "mine.toml"
    settings.write_text('[use]\ncontroller = "program"\n[controller]\nexpressions = ["(list 1)"]\n')
    out = tmp_path / "run"
    said = said_by(capsys, "train", "--env", STOOL, "--config", settings, "--out", out, code=2)
    assert "controller.expressions: program 1: " in said
    assert '"list" has 1 expressions; give 4' in said
    assert not out.exists()


# Certification


def test_a_program_is_certified_without_a_run(tmp_path: Path, capsys: pytest.CaptureFixture):
    file, short, out = tmp_path / "p.txt", tmp_path / "short.toml", tmp_path / "c.json"
    file.write_text(SLIDES)
    short.write_text(SHORT + "[hop]\nstay = 1.0\n")
    command = ("certify", "--env", "luxo", "--expressions", file, "--config", short)
    before = sorted(tmp_path.iterdir())
    said = said_by(capsys, *command, code=1)
    assert "arrives and stays" in said
    assert "Not certified" in said
    assert sorted(tmp_path.iterdir()) == before
    said_by(capsys, *command, "--task", "limbo", "--out", out, code=1)
    document = json.loads(out.read_text())
    assert (document["task"], document["passed"]) == ("limbo", False)
    again = said_by(capsys, *command, "--out", out, code=2)
    assert "exists already" in again


def test_a_passing_program_exits_with_0(tmp_path: Path, capsys: pytest.CaptureFixture):
    """A lamp that only has to stand; with changed criteria it passes by other rules."""
    file, short = tmp_path / "p.txt", tmp_path / "short.toml"
    file.write_text("(list 0 0 0)")
    short.write_text(SHORT + "[hop]\nstay = 1.0\nnear = 2.0\n")
    command = ("certify", "--env", "luxo", "--expressions", file, "--config", short)
    assert "it passes by other rules" in said_by(capsys, *command, code=0)


def test_a_written_champion_has_the_fingerprint_of_a_runs(luxo: Creature, tmp_path: Path):
    """The same fingerprint gives the same starts and goals as a champion of a default run."""
    file = tmp_path / "p.txt"
    file.write_text("(list 0 (+ a0 0) 1)")
    config = build_config(options(luxo), "test")
    champion = written_champion(luxo, config, file)
    begun = with_expressions(luxo, config, file)
    first = build_experiment(luxo, begun)
    assert champion.fingerprint == first.champion(first.init(), {}, 0).fingerprint


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ((), "name the run to examine"),
        (("runs/x", "--env", "luxo"), "name the run to examine"),
        (("--expressions", "FILE"), "name the creature and no run"),
        (("runs/x", "--env", "luxo", "--expressions", "FILE"), "name the creature and no run"),
        (("--env", "luxo", "--expressions", "TWO"), "holds 2 programs"),
        (("--env", "luxo", "--expressions", "gone.txt"), "gone.txt: no such file"),
        (("--env", "luxo", "--expressions", "FILE", "--task", "swim"), "only bodies that grow"),
    ],
)
def test_unusable_certify_options_are_reported_in_one_sentence(
    arguments: tuple, words: str, tmp_path: Path, capsys: pytest.CaptureFixture
):
    for name, text in (("FILE", "(list 1 2 3)"), ("TWO", "(list 1 2 3) (list 1 2 3)")):
        (tmp_path / name).write_text(text)
    places = {name: tmp_path / name for name in ("FILE", "TWO")}
    said = said_by(capsys, "certify", *[places.get(a, a) for a in arguments], code=2)
    assert words in said
