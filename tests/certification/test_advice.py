"""What stood in the way of a certificate, in words: every measure has some, every option exists."""

import ast
import dataclasses
import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from mjxgait.certification.advice import ADVICE, FELL_AFTER, advice, advised, entry_of
from mjxgait.certification.criteria import Criterion, Measure
from mjxgait.certification.remedies import AGAIN, TABLE
from mjxgait.certification.skills import of_skill
from mjxgait.cli.train_options import TrainOptions
from mjxgait.config.schema import UseConfig
from mjxgait.creature import Creature
from mjxgait.creature.settings import Identity, JointSettings
from mjxgait.kinds import tasks
from mjxgait.plugins.registry import config_class
from mjxgait.tasks.walk.targets import WalkTargets

PACKAGE = Path(__file__).parents[2] / "mjxgait"
MAKERS = {"at_least", "at_most", "steady", "Measure"}
GOALS, MODULAR = ("hop", "limbo", "travel"), tuple(k.name for k in tasks().values() if k.modular)
OF_FOLDER = {"walk": ("walk",), "hop": GOALS, "modular": MODULAR, "turn": ("turn",)}
"""Tasks of the criteria in each folder; those in `certification` are of all."""
SHARES = ("share that arrives and stays", "share that travels")
"""Names that the source states apart from the measure."""


def stated() -> Iterator[tuple[str, tuple[str, ...]]]:
    """Yield each measure's name in the source, and its tasks; what is filled in becomes `x`."""
    files = [*PACKAGE.rglob("*criteria.py"), *PACKAGE.glob("certification/describe.py")]
    for path in files:
        folder = path.parent.name
        of = OF_FOLDER.get(folder, tuple(tasks()))
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            named = isinstance(node, ast.Call) and getattr(node.func, "id", "") in MAKERS
            if not named or not node.args:
                continue
            name = node.args[0]
            if isinstance(name, ast.JoinedStr):
                parts = (getattr(part, "value", None) for part in name.values)
                yield "".join(p if isinstance(p, str) else "height" for p in parts), of
            elif isinstance(name, ast.Constant):
                yield str(name.value), of
    yield from ((name, GOALS) for name in SHARES)


STATED = dict(stated())


def made_up(name: str, criterion: str = "x", value: float = 0.4) -> tuple[Criterion, Measure]:
    measure = Measure(name, value, ">=", 0.9, 0.1)
    return Criterion(1, criterion, (measure,)), measure


CRITERIA = (
    "x",
    "perturbed starts",
    "pushes",
    "half the time step",
    "as in evolution",
    "a light that moves",
)


def entries_on(name: str) -> list:
    found = [entry_of(*made_up(name, criterion)) for criterion in CRITERIA]
    return [entry for entry in found if entry in TABLE]


def test_the_source_states_the_measures_that_a_certificate_shows():
    assert {"body speed / sqrt(g h)", "drift / distance", "failures in height"} <= set(STATED)
    assert len(STATED) > 45


@pytest.mark.parametrize("name", STATED)
def test_every_measure_has_words(name: str):
    assert entries_on(name), "add an entry to certification/remedies.py"


def test_every_entry_is_of_a_measure():
    used = {id(entry) for name in STATED for entry in entries_on(name)}
    # Targets are filled in by name.
    posture = [e for e in TABLE if e.measure.startswith("off the ") and e.measure.endswith(" of *")]
    left = [entry.measure for entry in TABLE if id(entry) not in used and entry not in posture]
    assert not left


def options_in(text: str) -> set[str]:
    return set(re.findall(r"(?<=--)[a-z_.]+[a-z_]", text))


def known_options(task: str) -> set[str]:
    """Options of `mjxgait train` for a task, as they are written."""

    def keys(of: object, before: str = "") -> Iterator[str]:
        for field in dataclasses.fields(of):
            value = getattr(of, field.name)
            if dataclasses.is_dataclass(value):
                yield from keys(value, f"{before}{field.name}.")
            else:
                yield f"{before}{field.name}"

    short = {f.name for f in dataclasses.fields(TrainOptions)} - {"settings"}
    targets = {field.name for field in dataclasses.fields(WalkTargets)}
    return short - (targets if task != "walk" else set()) | set(
        keys(config_class(UseConfig(task=task))())
    )


@pytest.mark.parametrize(
    ("task", "skill"),
    [(task, skill) for task, kind in tasks().items() for skill in kind.skills or (None,)],
)
def test_every_option_in_a_remedy_exists(task: str, skill: str | None):
    """Of a body with several skills too: options of a skill's fitness are in a table of its own."""
    known, own = known_options(task), skill or task
    for name in (name for name, of in STATED.items() if own in of):
        for entry in entries_on(name):
            remedy = entry.remedy_for(own)
            remedy = of_skill(remedy, skill) if skill else remedy
            imports = {"search"} if "mjxgait import" in remedy else set()
            assert options_in(remedy) <= known | imports, remedy


def test_every_key_of_creature_toml_in_a_remedy_exists():
    known = {f.name for of in (JointSettings, Identity) for f in dataclasses.fields(of)}
    remedies = [text for e in TABLE for text in (e.remedy, *e.by_task.values())]
    named = {key for text in remedies for key in re.findall(r"`(\w+)`", text)}
    assert named == {"range", "torque_limit", "ground"}
    assert named <= known


def test_the_worst_measure_is_the_cause_and_has_the_remedy():
    slip = Measure("worst foot's slip / distance", 0.2, "<=", 0.15, 0.15)
    fast = Measure("body speed / sqrt(g h)", 3.8, "<=", 3.0, 1.0)
    said = advice([Criterion(7, "gait", (slip,)), Criterion(8, "physics", (fast,))], "walk", {})
    assert said[0] == "Its fastest part moves at 3.8 sqrt(g h); 3 is allowed."
    assert said[1] == "A foot slides 20% of the way; 15% is allowed."
    assert "--fitness.weights.foot_speed" in said[2]
    assert len(said) == 3


def test_falls_from_perturbed_starts_have_their_time():
    share = Measure("share that stays up", 0.77, ">=", 0.9, 0.1)
    said = advice([Criterion(4, "perturbed starts", (share,))], "walk", {FELL_AFTER: 4.13})
    assert said == [
        "It falls on 23% of the perturbed starts after 4.1 s on average; 10% may fall.",
        "Simulate more starts in each generation (--rollout.starts), or train longer "
        "(--generations).",
    ]


def test_a_fall_is_the_only_cause_and_half_the_step_is_none():
    down = Measure("least upright", -0.9, ">=", 0.5, 0.5)
    slip = Measure("worst foot's slip / distance", 9.0, "<=", 0.15, 0.15)
    halved = Measure("failures in criteria 1 to 3", 9.0, "<=", 0.0, 0.0)
    lost = Measure("least clearance / hip height", np.nan, ">=", 0.03, 0.03)
    rest = Criterion(7, "gait", (lost, slip)), Criterion(6, "half the time step", (halved,))
    said = advice([*rest, Criterion(1, "stays up", (down,))], "walk", {})
    assert said[0] == "It falls over without any disturbance."
    assert len(said) == 2
    assert advice(rest, "walk", {})[:2] == [
        "A foot slides 900% of the way; 15% is allowed.",
        "Its least clearance / hip height could not be measured.",
    ]


def test_a_limit_of_the_body_takes_the_place_of_the_remedy():
    criterion, _ = made_up("speed (body lengths/s)")
    weak = ("The knees are 40% too weak.", "Raise `torque_limit`.")
    assert advice([criterion], "walk", {}, [weak])[1:] == [*weak]


def test_a_body_that_grew_has_no_standing_pose_to_blame(stool: Creature):
    criterion, _ = made_up("speed (body lengths/s)")
    strained = dataclasses.replace(
        stool, gains=dataclasses.replace(stool.gains, torque_limit=stool.gains.torque_limit / 99)
    )
    assert "too weak" in " ".join(advised([criterion], "walk", {}, strained)[ADVICE])
    assert "too weak" not in " ".join(advised([criterion], "roam", {}, strained)[ADVICE])


def test_a_measure_of_the_user_is_named_with_its_numbers(stool: Creature):
    criterion, _ = made_up("height of the ball")
    said = advice([criterion], "mine.py:Juggle", {})
    assert said == ["Its height of the ball is 0.4; 0.9 is needed.", AGAIN]
    assert advised([criterion], "mine.py:Juggle", {}, stool) == {ADVICE: said}


def test_what_passes_needs_no_advice(stool: Creature):
    criterion, _ = made_up("speed (body lengths/s)", value=1.0)
    assert advised([criterion], "walk", {}, stool) == {}
