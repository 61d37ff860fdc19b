"""A creature with expressions as its controller: training, storing, editing, inspecting."""

import dataclasses
import json
import re
import shutil
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from controllers.expressions.small_run import small_settings
from helpers import SHORT, STOOL, said_by

import mjxgait
from mjxgait.certification.trials import simulate
from mjxgait.champion import read_champion, serializer_of
from mjxgait.controllers.expressions.config import ProgramConfig
from mjxgait.controllers.expressions.operators import Trees
from mjxgait.controllers.expressions.text import EMPTY
from mjxgait.inspect import facts, read_snapshot
from mjxgait.reference.starts import nominal_starts
from mjxgait.rendering.plots import plot_run
from mjxgait.training.experiment import build_experiment
from mjxgait.training.folder import CHAMPION, METRICS
from mjxgait.training.logs import read_metrics


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> mjxgait.Run:
    return mjxgait.train(
        STOOL,
        out=tmp_path_factory.mktemp("programs") / "run",
        controller="program",
        generations=2,
        settings=small_settings(),
        quiet=True,
    )


@pytest.fixture
def edited(run: mjxgait.Run, tmp_path: Path) -> Path:
    """A copy of the run."""
    return shutil.copytree(run.folder, tmp_path / "run")


def edit(folder: Path, joint: str, text: str) -> None:
    document = json.loads((folder / CHAMPION).read_text())
    document["genome"]["expressions"][joint] = text
    (folder / CHAMPION).write_text(json.dumps(document))


def commanded(run: mjxgait.Run, folder: Path) -> np.ndarray:
    """Targets of the first joint by a folder's champion, at each control step of 0.2 s."""
    champion = read_champion(folder / CHAMPION, run.creature)
    outcome = simulate(run.creature, champion, nominal_starts(run.creature, 1), 0.2, record=1)
    return outcome.trajectory.target[0, :, 0]


def test_evolution_and_reference_simulator_move_programs_alike(run: mjxgait.Run):
    """The reference simulator reads the expressions as text, node by node."""
    snapshot = read_snapshot(run.folder)
    told = snapshot.arrays["outcome"][:, 0, 0]
    everybody = [snapshot.champion(rank + 1) for rank in range(len(told))]
    starts, step = nominal_starts(run.creature, 1), run.creature.model.opt.timestep
    # The statistics end before the last step.
    seen = [simulate(run.creature, one, starts, 0.2 - step).travel[0, 0] for one in everybody]
    # Rounding may flip an `ifltz`, so not all individuals agree at the end.
    alike = abs(np.array(seen) - told) < 1e-5
    assert alike.sum() >= 3
    assert np.ptp(told[alike]) > 0.005


def test_programs_of_similar_length_share_a_batch(run: mjxgait.Run):
    """A batch takes as long per command as its longest program."""
    simulator = build_experiment(run.creature, run.config).simulator
    counts = np.array([[3, 9, 1, 4], [2, 9, 8, 0]])
    plans = jax.eval_shape(jax.vmap(simulator.controller.prepare, (0, None)), *genomes_of(run))
    plans = jax.tree.map(lambda leaf: jnp.zeros((2, 4, *leaf.shape[1:]), leaf.dtype), plans)
    joints = plans.count.shape[-1]
    longest = jnp.zeros((2, 4, joints), jnp.int32).at[..., 1].set(counts)
    turns = np.asarray(simulator._turns(dataclasses.replace(plans, count=longest), (2, 4, 3)))
    loads = np.repeat(counts.ravel(), 3)[turns]
    assert sorted(turns) == list(range(24))
    assert list(loads) == sorted(loads, reverse=True)


def genomes_of(run: mjxgait.Run) -> tuple[Trees, ProgramConfig]:
    """The population and its controller's settings."""
    arrays = read_snapshot(run.folder).arrays
    trees = Trees(jnp.asarray(arrays["genomes.code"]), jnp.asarray(arrays["genomes.value"]))
    return trees, run.config.controller


def test_an_expression_is_evaluated_every_fourth_step(run: mjxgait.Run, edited: Path):
    joint = run.creature.joints.names[0]
    edit(edited, joint, "t")
    told, step = commanded(run, edited), run.creature.model.opt.timestep
    assert told == pytest.approx(np.arange(len(told)) // 4 * 4 * step)


def test_the_champion_file_is_readable_and_keeps_its_fingerprint(run: mjxgait.Run):
    document = json.loads((run.folder / CHAMPION).read_text())
    assert set(document["genome"]["expressions"]) == set(run.creature.joints.names)
    kept = read_champion(run.folder / CHAMPION, run.creature)
    assert kept.fingerprint == read_snapshot(run.folder).champion(1).fingerprint


def test_programs_use_only_the_requested_observations(run: mjxgait.Run):
    texts = json.loads((run.folder / CHAMPION).read_text())["genome"]["expressions"].values()
    words = " ".join(texts).replace("(", " ").replace(")", " ").split()
    names = {word for word in words if word[0].isalpha()} - {"ifltz"}
    assert names <= {"a0", "a1", "a2", "a3", "aside", "t", "vx", "vz", "pitch"}


def test_inspect_prints_the_expressions(run: mjxgait.Run, capsys: pytest.CaptureFixture):
    said = said_by(capsys, "inspect", run.folder, code=0)
    told = facts(read_snapshot(run.folder))["champion"]
    assert "an expression per joint" in said
    for (joint, text), nodes in zip(told["expressions"].items(), told["nodes"], strict=True):
        assert joint in said
        assert len(re.findall(r"[^\s()]+", text)) == nodes


def test_inspect_reports_how_many_nodes_matter(run: mjxgait.Run, capsys: pytest.CaptureFixture):
    """Those that remain in the champion's file, which is simplified."""
    snapshot = read_snapshot(run.folder)
    told = facts(snapshot)["champion"]
    settled = serializer_of("program").settled(
        {name: array[0] for name, array in snapshot.genomes.items()}, snapshot.creature
    )
    assert told["nodes_that_matter"] == (settled["code"] != EMPTY).sum(1).tolist()
    assert all(m <= n for m, n in zip(told["nodes_that_matter"], told["nodes"], strict=True))
    share = told["nodes_that_matter"][0] / told["nodes"][0]
    assert f"{share:.0%}" in said_by(capsys, "inspect", run.folder, code=0)


def test_program_size_is_logged_every_generation(run: mjxgait.Run):
    lines, nodes = read_metrics(run.folder / METRICS), facts(read_snapshot(run.folder))
    assert len(lines) == 3
    assert lines[-1]["nodes_best"] == sum(nodes["champion"]["nodes"])
    assert lines[-1]["nodes_mean"] == pytest.approx(
        sum(nodes["diversity"]["nodes"]["mean"]), rel=1e-6
    )
    drawn = {file.stem for file in plot_run(run.folder, run.folder / "plots", ("svg",))}
    assert {"size", "expressions"} <= drawn
    assert "strobe" not in drawn


def test_an_edited_expression_takes_effect(run: mjxgait.Run, edited: Path):
    joint, changed = run.creature.joints.names[0], mjxgait.open(edited)
    edit(edited, joint, "0.3")
    assert commanded(run, edited) == pytest.approx(np.full(40, 0.3))
    edit(edited, joint, "(/ t (- a0 a0))")
    assert np.isfinite(mjxgait.walk(changed, 0.3)[f"pos_{joint}"]).all()


@pytest.mark.parametrize(
    ("text", "words"),
    [("(+ a0 a99)", '"a99" is neither a sense nor a number'), ("(+ a0", "ends too early")],
)
def test_a_mistake_is_reported_with_file_and_joint(
    run: mjxgait.Run, edited: Path, text: str, words: str, capsys: pytest.CaptureFixture
):
    joint = run.creature.joints.names[1]
    edit(edited, joint, text)
    (edited / "short.toml").write_text(SHORT)
    said = said_by(capsys, "certify", edited, "--config", edited / "short.toml", code=2)
    assert words in said
    assert joint in said
    assert CHAMPION in said


@pytest.mark.parametrize(
    ("option", "words"),
    [
        (("--controller.functions", "+", "pow"), '"pow" is no function'),
        (("--controller.senses", "a0", "nose"), 'there is no "nose" here'),
        (("--controller.initial-depth", "2", "40"), "must be a range"),
        (("--controller.every", "3"), "must be one of 1, 2, 4, 8, 16 control steps"),
    ],
)
def test_invalid_settings_are_reported_in_one_sentence(
    option: tuple[str, ...], words: str, tmp_path: Path, capsys: pytest.CaptureFixture
):
    arguments = ("train", "--env", STOOL, "--controller", "program", "--out", tmp_path / "x")
    said = said_by(capsys, *arguments, *option, code=2)
    assert words in said
