"""`mjxgait inspect`: contents of a checkpoint, and clear messages on damaged ones."""

import dataclasses
import json
import os
import re
import shutil
import subprocess
import sys
from types import SimpleNamespace

import numpy as np
import pytest
from helpers import made_up_certificate, said_by
from inspection.made_up import FORCED, LAST, POPULATION

from mjxgait.certification import CertificateConfig
from mjxgait.certification.stress import TRIALS, Stress, StressConfig, Trial
from mjxgait.champion import read_champion
from mjxgait.cli import main
from mjxgait.config.tables import build
from mjxgait.inspect import (
    facts,
    individual_facts,
    read_snapshot,
    text,
)
from mjxgait.training.folder import CERTIFICATE, CHAMPION, STRESS
from mjxgait.training.lock import locked


def tell(capsys, *arguments):
    """Exit code and printed text."""
    with pytest.raises(SystemExit) as ended:
        main(["inspect", *map(str, arguments)])
    said = capsys.readouterr()
    return ended.value.code, said.out + said.err


def test_a_run_is_read_with_another_number_of_devices(finished_run):
    """benchmarks/inspect_seconds.py measures the time."""
    done = subprocess.run(
        [sys.executable, "-m", "mjxgait", "inspect", str(finished_run), "--json"],
        env=os.environ | {"JAX_NUM_CPU_DEVICES": "3"},
        capture_output=True,
        text=True,
        check=True,
    )
    assert json.loads(done.stdout)["generation"] == LAST


def test_the_facts_describe_the_run(finished_run):
    found = facts(read_snapshot(finished_run))
    assert (found["creature"], found["seed"], found["generation"], found["intact"]) == (
        "tall_quadruped",
        11,
        LAST,
        True,
    )
    assert found["settings_changed"]["evolution.population"]["here"] == POPULATION
    assert "drive.law" not in found["settings_changed"]
    assert found["versions"] == {"jax": "9.9"}
    assert found["ended"] == f"all {LAST} generations are done"
    assert found["checkpoints"][-1] == LAST
    assert found["bytes"] > 1000


def test_a_run_with_other_terms_keeps_all_other_facts(finished_run):
    """Its fitness had one term less."""
    snapshot = read_snapshot(finished_run)
    older = {**snapshot.arrays, "terms": snapshot.arrays["terms"][..., 1:]}
    now, found = facts(snapshot), facts(dataclasses.replace(snapshot, arrays=older))
    assert all(row["contributions"] == {} for row in found["population"])
    assert found["champion"]["terms"] == {}
    for name in ("fitness", "diversity", "verdict", "history"):
        assert found[name] == now[name]


def test_the_certificate_is_compared_with_the_champion(run):
    def said():
        return facts(read_snapshot(run))["certificate"]

    snapshot = read_snapshot(run)
    fingerprint = read_champion(run / CHAMPION, snapshot.creature).fingerprint
    certificate = made_up_certificate(fingerprint, margin=0.25)
    assert said() == "The champion has not been examined."
    failing = made_up_certificate(fingerprint, (7, "gait"))
    (run / CERTIFICATE).write_text(json.dumps(failing))
    assert said() == "The champion fails criteria 7."
    (run / CERTIFICATE).write_text(json.dumps(certificate))
    assert said() == "The champion is certified, margin 0.25."
    (run / CERTIFICATE).write_text(json.dumps(certificate | {"criteria": []}))
    assert said().startswith(
        "The champion is not certified: there are no criteria; the file contra"
    )
    (run / CERTIFICATE).write_text(json.dumps(failing | {"passed": True}))
    assert said() == (
        "The champion fails criteria 7; the file contradicts itself: it says passed, its measures "
        "say failed."
    )
    lax = build(CertificateConfig, {"progress": {"drift": 5.0}}, "lax")
    (run / CERTIFICATE).write_text(json.dumps(made_up_certificate(fingerprint, config=lax)))
    rules = "by other rules: progress.drift = 5.0 instead of 0.25"
    assert said() == f"The champion is not certified: it passes, but {rules}."
    assert not facts(read_snapshot(run))["verdict"]["certified"]
    for key, value in (("champion", "other"), ("task", "hop"), ("report", {"ground": "rough:0.2"})):
        (run / CERTIFICATE).write_text(json.dumps(certificate | {key: value}))
        assert "outdated" in said(), key
    (run / CERTIFICATE).write_text(json.dumps(certificate | {"schema": 1}))
    assert said().endswith("it was given under other rules than today's.")
    (run / CERTIFICATE).write_text("[]")
    assert "not a certificate" in said()


def test_verify_exits_with_0_only_if_all_measures_are_equal(run, capsys, monkeypatch):
    fingerprint = read_champion(run / CHAMPION, read_snapshot(run).creature).fingerprint
    again = made_up_certificate(fingerprint)
    found = SimpleNamespace(document=lambda: again)
    monkeypatch.setattr("mjxgait.certification.certify", lambda *_: found)
    assert "not there" in said_by(capsys, "inspect", run, "--verify", code=2)
    (run / CERTIFICATE).write_text(json.dumps(again))
    assert "every measure is that" in said_by(capsys, "inspect", run, "--verify", code=0)
    (run / CERTIFICATE).write_text(json.dumps(made_up_certificate(fingerprint, margin=0.4)))
    said = said_by(capsys, "inspect", run, "--verify", code=1)
    assert "2 progress, speed: 0.9 >= 0.5, again 1 >= 0.5" in said
    assert "takes one run folder" in said_by(
        capsys, "inspect", run, "--verify", "--individual", 1, code=2
    )


@pytest.mark.parametrize("text", ['{"schema": 1', "[]", "{}"], ids=["cut off", "a list", "empty"])
def test_a_damaged_champion_gets_one_sentence_everywhere(run, capsys, tmp_path, text):
    (run / CHAMPION).write_text(text)
    one = facts(read_snapshot(run))
    sentence = one["trouble"]
    assert sentence.startswith(f"{run / CHAMPION}: damaged, or not a champion file (")
    assert sentence.endswith(f"; write it anew with: mjxgait train --resume {run}")
    assert one["certificate"] == sentence
    whole = "".join(sentence.split())  # without the table's line breaks
    said = tell(capsys, run)[1]
    assert "".join(said.split()).count(whole) == 1
    assert "no champion" not in said
    assert "not been examined" not in said
    several = tell(capsys, run.parent)[1]
    assert "".join(several.split()).count(whole) == 1
    assert "champion unreadable" in several
    assert "not examined" not in several
    for command in (["share", "--out", tmp_path / "a.html"], ["certify"]):
        assert sentence in said_by(capsys, command[0], run, *command[1:], code=2)


def test_with_a_damaged_champion_the_end_of_the_run_is_unknown(run, capsys):
    config = run / "config.toml"
    config.write_text(config.read_text().replace(f"generations = {LAST}", "generations = 99"))
    assert "not finished" in tell(capsys, run)[1]
    (run / CHAMPION).write_text("[]")
    assert "not known without the champion" in tell(capsys, run)[1]


def test_walking_anywhere_is_reported(run):
    """Only trials of this champion count; the failed ones are named."""
    snapshot = read_snapshot(run)
    fingerprint = read_champion(run / CHAMPION, snapshot.creature).fingerprint
    certificate = made_up_certificate(fingerprint)
    (run / CERTIFICATE).write_text(json.dumps(certificate))
    trials = [Trial("bumps of 5%", 0.95, True), Trial("friction 0.4", 0.25, False)]

    def told(found: Stress) -> tuple[str, bool | None]:
        (run / STRESS).write_text(json.dumps(found.document()))
        known = facts(read_snapshot(run))
        return known["certificate"], known["verdict"]["anywhere"]

    said, anywhere = told(Stress(fingerprint, tuple(trials), StressConfig()))
    assert said.endswith("It does not walk anywhere: friction 0.4 25%.")
    assert anywhere is False
    said, anywhere = told(Stress(fingerprint, tuple(trials[:1]), StressConfig()))
    assert said.endswith("only 1 of 9 stress tests were run.")
    assert anywhere is False
    all_of_them = tuple(trials[:1]) * TRIALS
    said, _ = told(Stress(fingerprint, all_of_them, StressConfig(share=0.2)))
    assert said.endswith("its stress tests are by other settings: share = 0.2.")
    said, anywhere = told(Stress(fingerprint, all_of_them, StressConfig()))
    assert said.endswith("It walks anywhere.")
    assert anywhere is True
    said, anywhere = told(Stress("another", tuple(trials), StressConfig()))
    assert "anywhere" not in said
    assert anywhere is None


def test_a_folder_of_runs_shows_which_of_them_walk(run, capsys):
    """It shows margin, speed and gait of a valid certificate."""
    snapshot = read_snapshot(run)
    fingerprint = read_champion(run / CHAMPION, snapshot.creature).fingerprint
    report = {"speed": 1.25, "gait": "trot", "summary": "trot, 1.25 m/s"}
    certificate = made_up_certificate(fingerprint, report=report)

    def told() -> str:
        code, said = tell(capsys, run.parent)
        assert code == 0
        return said

    assert "not examined" in told()
    (run / CERTIFICATE).write_text(json.dumps(certificate))
    assert re.search(r"0\.50 +1\.25 +trot .* certified", told())
    failed = made_up_certificate(fingerprint, (7, "gait"), margin=0.25, report=report)
    (run / CERTIFICATE).write_text(json.dumps(failed))
    assert re.search(r"-0\.25 +1\.25 +trot .* fails 7", told())
    lax = build(CertificateConfig, {"progress": {"drift": 5.0}}, "lax")
    (run / CERTIFICATE).write_text(json.dumps(made_up_certificate(fingerprint, config=lax)))
    assert "by other rules: progress.drift = 5.0 instead of 0.25" in " ".join(told().split())
    assert not re.search(r"\bcertified", told())
    (run / CERTIFICATE).write_text(json.dumps(certificate | {"champion": "other"}))
    assert "not examined" in told()


def test_a_few_individuals_are_shown_and_all_with_an_option(finished_run, capsys, monkeypatch):
    monkeypatch.setattr(text, "FEW", 4)
    few, every = (tell(capsys, finished_run, *more)[1] for more in ((), ("--all",)))
    assert f"… and {POPULATION - 4} more; --all shows them" in few
    assert len(every.splitlines()) - len(few.splitlines()) == POPULATION - 4 - 1


def test_contributions_of_the_terms_add_up_to_the_fitness(finished_run):
    for row in facts(read_snapshot(finished_run))["population"]:
        assert sum(row["contributions"].values()) == pytest.approx(row["fitness"], abs=1e-5)


def test_the_population_has_age_and_kind(finished_run):
    rows = facts(read_snapshot(finished_run))["population"]
    assert [row["kind"] for row in rows[:4]] == ["crossover", "mutation", "newcomer", "initial"]
    assert {row["age"] for row in rows} == {1}
    assert [row["rank"] for row in rows] == list(range(1, POPULATION + 1))


def test_diversity_is_the_spread_in_degrees(finished_run):
    found = facts(read_snapshot(finished_run))["diversity"]
    assert found["unique"] == POPULATION
    assert set(np.round(list(found["spread_deg"].values()), 3)) == {
        round(np.arange(POPULATION).std(), 3)
    }


def test_forced_phases_are_reported(finished_run):
    (spell,) = facts(read_snapshot(finished_run))["forced_spells"]
    assert (spell["first"], spell["last"]) == (FORCED, FORCED)
    assert spell["best_after"] > spell["best_before"]


def test_an_earlier_generation_and_one_individual_can_be_read(finished_run):
    early = read_snapshot(finished_run, 1)
    assert early.generation == 1
    assert [line["generation"] for line in early.lines] == [0, 1]
    second = individual_facts(early, 2)
    moved = (
        second["key_poses_deg"][0]["spine_yaw"]
        - individual_facts(early, 1)["key_poses_deg"][0]["spine_yaw"]
    )
    assert moved == pytest.approx(1.0, abs=1e-4)


def test_a_checkpoint_folder_selects_its_generation(finished_run):
    assert read_snapshot(finished_run / "checkpoints" / "2").generation == 2


def test_difference_of_two_checkpoints(finished_run, capsys):
    code, said = tell(capsys, "--diff", finished_run / "checkpoints" / "2", finished_run, "--json")
    found = json.loads(said)
    assert code == 0
    assert found["settings"] == {}
    assert found["champion_moved_deg"]["spine_yaw"] == pytest.approx([1.0, 1.0], abs=1e-4)
    assert found["same_individuals"] == POPULATION - 1
    code, said = tell(capsys, "--diff", finished_run / "checkpoints" / "2", finished_run)
    assert code == 0
    assert "+1.0" in said


def test_everything_can_be_printed(finished_run, capsys):
    code, said = tell(capsys, finished_run)
    assert code == 0
    for word in (
        "tall_quadruped, generation 3 of 3",
        "seed",
        "intact",
        "newcomer",
        "spine_yaw",
        "forced evolution in generations 2 to 2",
    ):
        assert word in said
    assert "…" not in said
    code, said = tell(capsys, finished_run, "--individual", 2)
    assert "individual 2" in said
    assert code == 0


def test_a_folder_of_runs_has_one_line_per_run(run, capsys):
    broken = shutil.copytree(run, run.parent / "broken")
    shutil.rmtree(broken / "checkpoints")
    code, said = tell(capsys, run.parent)
    assert code == 0
    assert "3/3" in said
    assert "cannot be read" in said
    assert "no checkpoint yet" in said


def test_a_run_killed_half_way_is_read_up_to_its_latest_checkpoint(run, capsys):
    shutil.rmtree(run / "checkpoints" / str(LAST))
    (run / "checkpoints" / f"{LAST}.orbax-checkpoint-tmp").mkdir()
    log = run / "metrics.jsonl"
    log.write_text(log.read_text()[:-30])
    code, said = tell(capsys, run)
    assert code == 0
    assert "not finished" in said


def add_text(path, text):
    path.write_text(path.read_text() + text)


@pytest.mark.parametrize(
    ("damage", "words"),
    [
        (lambda run: shutil.rmtree(run / "checkpoints"), "no checkpoint yet"),
        (lambda run: (run / "config.toml").unlink(), "neither a run folder"),
        (lambda run: (run / "config.toml").write_text("seed = ["), "not valid TOML"),
        (
            lambda run: (run / "checkpoints" / str(LAST) / "manifest" / "metadata").write_text("{"),
            "damaged",
        ),
        (
            lambda run: add_text(run / "creature" / "creature.toml", "\n# another body\n"),
            "another body",
        ),
    ],
)
def test_damaged_and_foreign_folders_end_with_a_sentence(run, capsys, damage, words):
    damage(run)
    code, said = tell(capsys, run)
    assert code == 2
    assert words in said
    assert str(run) in said


def test_damaged_values_are_noticed_and_an_intact_checkpoint_is_named(run, capsys):
    for file in (run / "checkpoints" / str(LAST) / "state").rglob("d/*"):
        content = bytearray(file.read_bytes())
        content[len(content) // 2] ^= 255
        file.write_bytes(content)
    code, said = tell(capsys, run)
    assert code == 2
    assert f"--generation {LAST - 1}" in said


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--generation", 99], "no checkpoint of generation 99; there are"),
        (["--individual", 99], "ranks 1 to"),
        (["--individual", 0], "ranks 1 to"),
    ],
)
def test_a_missing_generation_or_individual_is_named(finished_run, capsys, arguments, words):
    code, said = tell(capsys, finished_run, *arguments)
    assert code == 2
    assert words in said


def test_other_folders_are_refused(tmp_path, capsys):
    code, said = tell(capsys, tmp_path)
    assert code == 2
    assert "neither a run folder" in said
    code, said = tell(capsys, tmp_path / "missing")
    assert code == 2
    assert "no such folder" in said


def test_a_running_run_is_shown_as_running(run, capsys):
    pytest.importorskip("fcntl", reason="this system has no flock")
    with locked(run):
        assert f"runs now: process {os.getpid()} on" in tell(capsys, run)[1]
        assert re.search(r"walk .* running$", tell(capsys, run.parent)[1], re.MULTILINE)
    assert "runs now" not in tell(capsys, run)[1]
