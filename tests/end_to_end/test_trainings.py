"""Every shipped configuration ends with a certificate, for each creature and task that it names.

`python -m pytest tests/end_to_end/test_trainings.py --matrix FILE` also writes a table of them
(docs/testing.md).
"""

import json
import time
import tomllib
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from end_to_end.shipped import (
    CONFIGS,
    CREATURES,
    FEW_STARTS,
    ROOT,
    STYLES,
    TASKS,
    TINY,
    WITH_GAITS,
    Way,
    creature_of,
    first_of_each_task,
    read_config,
    task_of,
    trainings,
    use_of,
)
from helpers import STOOL, said_by

from mjxgait.certification import CertificateConfig, nominal_check
from mjxgait.champion import Champion, write_champion
from mjxgait.controllers.key_poses.config import gene_names
from mjxgait.kinds import meant_of_grown
from mjxgait.plugins import resolve_config
from mjxgait.tasks.walk.gaits import GAITS
from mjxgait.training.folder import (
    CERTIFICATE,
    CHAMPION,
    METRICS,
    create_run,
    open_champion,
    open_run,
)
from mjxgait.training.initial import read_initial

WAYS = list(trainings())
TRAINED = {
    "walk": "tests/training/test_run.py",
    "hop": "tests/tasks/hop/test_hop.py",
    "limbo": "tests/tasks/hop/test_limbo.py",
    "turn": "tests/tasks/turn/test_turn.py",
    "swim": "tests/tasks/modular/test_swimming.py",
    "follow-on-land": "tests/tasks/modular/test_roaming.py",
    **dict.fromkeys(("jump", "follow"), "tests/tasks/modular/test_roaming.py"),
    "travel": "tests/tasks/hop/test_travel.py",
    "compete": "tests/tasks/modular/test_compete.py",
    **dict.fromkeys(("amphibian", "all-trades"), "tests/tasks/modular/test_skills.py"),
}
"""Tasks that another test evolves, and where.

test_roaming.py evaluates individuals on land, and test_hop.py those of `hop`; both compare parts of
their tasks with the reference simulator, and `--thorough` evolves them.
"""
EVOLVED = [way for way in first_of_each_task(WAYS) if task_of(way) not in TRAINED]


def train(capsys: pytest.CaptureFixture, folder: Path, *given: str) -> dict:
    """Train, check the run folder, and return the certificate."""
    said_by(capsys, "train", *TINY, *given, "--out", folder, code=0)
    document = json.loads((folder / CERTIFICATE).read_text())
    _, champion = open_champion(folder)
    assert document["champion"] == champion.fingerprint
    assert len(document["criteria"]) >= 5
    assert json.loads((folder / METRICS).read_text().splitlines()[-1])["generation"] == 1
    return document


HEADER = "| configuration | creature | task | certificate | processor, s |\n|---|---|---|---|---|\n"


@pytest.fixture
def told(request: pytest.FixtureRequest) -> Iterator[Callable[[Way, str, dict], None]]:
    """Collects results for the table of `--matrix`, with the CPU seconds of this process."""
    file, began, rows = request.config.getoption("--matrix"), time.process_time(), []

    def tell(way: Way, task: str, document: dict) -> None:
        passed = "passed" if document["passed"] else "not passed"
        given = f"style {way.style}" if way.style else way.config or "the creature's own"
        rows.append((given, way.creature, task, passed, f"{time.process_time() - began:.0f}"))

    yield tell
    if file is not None:
        table = "".join(f"| {' | '.join(row)} |\n" for row in rows)
        with file.open("a", encoding="utf-8") as written:
            written.write(table if written.tell() else HEADER + table)


@pytest.mark.slow
@pytest.mark.parametrize("way", WAYS, ids=[way.name for way in WAYS])
def test_a_training_ends_with_a_certificate(way: Way, tmp_path: Path, capsys, told, request):
    """Without `--thorough` it only evolves if no other test trains its task."""
    if way in EVOLVED:
        request.getfixturevalue("evolving")
    document = train(capsys, tmp_path / "run", *way.arguments)
    _, config = open_run(tmp_path / "run")
    told(way, config.use.task, document)
    requested = way.task or (way.config and read_config(way.config).get("use", {}).get("task"))
    task = requested or use_of(way.creature).task
    if creature_of(way.creature).settings.creature.grows:
        task = meant_of_grown(task)
    assert config.use.task == document["task"] == task


def test_the_trainings_cover_all_that_is_shipped():
    assert {way.creature for way in WAYS} == set(CREATURES)
    assert {way.config for way in WAYS} - {None} == set(CONFIGS)
    assert {way.style for way in WAYS} - {None} == set(STYLES)
    on_foot = {len(creature_of(name).feet.names) for name in WITH_GAITS}
    assert {way.gait for way in WAYS} - {None} == {g for feet in on_foot for g in GAITS[feet]}
    assert {way.task or use_of(way.creature).task for way in WAYS} == set(TASKS)
    assert len(WAYS) == len(set(WAYS))
    thesis = {way.creature for way in WAYS if way.config == "wilson"}
    assert thesis == {name for name in CREATURES if use_of(name).task == "walk"}
    paper, all_of_blocks = (
        {way.task for way in WAYS if way.creature == "blocks" and way.config == config}
        for config in ("sims", None)
    )
    assert paper == all_of_blocks >= {None, "walk", "jump", "follow", "follow-on-land"}


def test_every_task_is_evolved_by_a_test():
    assert {task_of(way) for way in EVOLVED} == {task_of(way) for way in WAYS} - TRAINED.keys()
    assert all((ROOT / file).is_file() for file in TRAINED.values())


def test_every_settings_file_is_in_a_known_folder():
    files = {path.relative_to(ROOT / "configs") for path in (ROOT / "configs").rglob("*.toml")}
    assert {path.parts[0] for path in files if len(path.parts) > 1} == {
        "ablations",
        "certificate",
        "styles",
    }
    for path in files:
        tomllib.loads((ROOT / "configs" / path).read_text(encoding="utf-8"))


WALKERS = [name for name in CREATURES if use_of(name).controller == "poses"]
OF_POSES = [name for name in CONFIGS if read_config(name).get("use", {}) == {}]
UNTRAINED = [
    (config, name)
    for config in OF_POSES
    for name in WALKERS
    if Way(name, config=config) not in WAYS
]
"""Configurations and walkers that `test_a_training_ends_with_a_certificate` does not combine."""


@pytest.mark.parametrize(("config", "name"), UNTRAINED)
def test_every_walker_can_be_checked_with_every_configuration(
    config: str, name: str, tmp_path: Path
):
    """From a new run folder to the nominal check in C MuJoCo, with the stand as key poses."""
    creature = creature_of(name)
    settings = resolve_config(creature.settings.train, name, Path(config))
    folder = create_run(tmp_path / "run", creature, settings)
    joints = creature.joints
    poses = np.tile(joints.stand, (settings.controller.key_poses, 1))
    genes = [getattr(settings.controller.tuning, g, (0.0,))[0] for g in gene_names(False)]
    genome = {"key_poses": poses, "tuning": np.array(genes)}
    made = Champion.of(creature, settings, genome, fitness=0.0, terms={}, origin={})
    write_champion(made, creature, folder / CHAMPION)
    body, champion = open_champion(folder)
    assert champion.fingerprint == made.fingerprint
    assert nominal_check(body, champion, CertificateConfig(seconds=0.6, warmup=0.2)).criteria


VARIANTS = {
    "plain MJX": ("--rollout.physics", "mjx"),
    "sizes evolve under a pose span": ("--config", "wilson", "--evolve-body", "1.2"),
    "expressions under a pose span": (
        *("--use.controller", "program", "--evolution.pose-span", "60"),
        *("--controller.nodes", "16", "--controller.depth", "4"),
        *("--controller.initial-depth", "2", "4"),
    ),
    "another way, scaled, on other ground": (
        *("--way", "back", "--scale", "front*=1.1", "--ground", "rough:0.03", *FEW_STARTS),
    ),
}
"""Options that change the creature or the simulator before certification."""


@pytest.mark.slow
@pytest.mark.parametrize("name", VARIANTS)
def test_a_changed_body_or_simulator_ends_with_a_certificate(name: str, tmp_path: Path, capsys):
    """`--thorough` evolves; tests/physics/test_mjx.py and
    tests/training/test_evolve_body.py always do.
    """
    train(capsys, tmp_path / "run", "--env", str(STOOL), *VARIANTS[name])


@pytest.mark.slow
def test_a_body_that_the_light_steers_ends_with_a_certificate(tmp_path: Path, capsys):
    """Its genomes hold weights of the light, which its ancestors do not use."""
    follow = Way("blocks", task="follow")
    steered = ("--controller.steer", "--controller.evolves", "steering")
    train(capsys, tmp_path / "run", *follow.arguments, *steered)
    assert "nerves.steer" in open_champion(tmp_path / "run")[1].genome
    ancestors = read_initial(tmp_path / "run") or {}
    assert "nerves.kind" in ancestors
    assert "nerves.steer" not in ancestors
