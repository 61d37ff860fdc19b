"""Recognition of a finished run from its folder, with the options that would continue it."""

import dataclasses
import json

import numpy as np
import pytest
from helpers import made_up_certificate
from inspection.made_up import LAST

from mjxgait.inspect import read_snapshot
from mjxgait.training.ended import nothing_left
from mjxgait.training.folder import CERTIFICATE, CHAMPION, kept_champion, open_run

ALL = f"all {LAST} generations are done"


def certify(run, passed=True, **others):
    creature, _ = open_run(run)
    failed = () if passed else ((7, "gait"),)
    document = made_up_certificate(kept_champion(run, creature).fingerprint, *failed)
    (run / CERTIFICATE).write_text(json.dumps(document | others))


def said(run, evolution=None, examination=None, kept=None):
    """Message on a run that is continued with these settings."""
    creature, config = open_run(run)
    config = dataclasses.replace(
        config,
        evolution=dataclasses.replace(config.evolution, **(evolution or {})),
        examination=dataclasses.replace(config.examination, **(examination or {})),
    )
    return nothing_left(run, creature, config, config if kept is None else open_run(run)[1])


def next_goal(run, *options):
    return f"To go on: mjxgait train --resume {run} {' '.join(map(str, options))}"


def test_the_last_generation_ends_the_run(run):
    certify(run, passed=False)
    told = said(run)
    assert (
        told == f"{run}: nothing is left to do: {ALL}. {next_goal(run, '--generations', 2 * LAST)}"
    )
    assert said(run, {"generations": LAST + 1}, {"every": 0}) is None


@pytest.mark.parametrize(
    "spoil",
    [
        lambda run: (run / CERTIFICATE).unlink(),
        lambda run: certify(run, champion="another"),
        lambda run: (run / CERTIFICATE).write_text("[]"),
        lambda run: (run / CHAMPION).write_text("[]"),
        lambda run: (run / CHAMPION).unlink(),
    ],
    ids=["no certificate", "of another", "a damaged one", "a damaged champion", "no champion"],
)
def test_without_champion_or_certificate_the_run_is_not_finished(run, spoil):
    certify(run)
    assert said(run)
    spoil(run)
    assert said(run) is None


def test_without_examinations_no_certificate_is_needed(run):
    assert said(run) is None
    assert ALL in said(run, examination={"candidates": 0})


def test_another_level_of_examination_continues_the_run(run):
    certify(run)
    assert said(run, examination={"level": "anywhere"}, kept="as it was") is None


def test_a_certificate_ends_the_run(run):
    certify(run)
    early = {"generations": 9}, {"every": LAST}
    told = said(run, *early)
    assert f"certified with a margin of 0.50 in generation {LAST}. " in told
    assert told.endswith(next_goal(run, "--examination.every", 0))
    certify(run, passed=False)
    assert said(run, *early) is None


def test_reaching_the_target_ends_the_run(run):
    certify(run)
    told = said(run, {"generations": 9, "target": 1.0})
    assert "the target fitness of 1 is reached" in told
    assert told.endswith(next_goal(run, "--evolution.target", None))
    both = said(run, {"target": 1.0})
    assert both.endswith(next_goal(run, "--evolution.target", None, "--generations", 2 * LAST))


def test_failed_forced_phases_end_the_run(run):
    certify(run)
    _, config = open_run(run)
    forced = dataclasses.replace(config.evolution.forced, patience=1)
    snapshot = read_snapshot(run)
    assert "forced evolution" not in snapshot.ended
    snapshot = dataclasses.replace(snapshot, arrays={**snapshot.arrays, "barren": np.int32(1)})
    patient = dataclasses.replace(
        config, evolution=dataclasses.replace(config.evolution, forced=forced, generations=9)
    )
    ended = dataclasses.replace(snapshot, config=patient).ended
    assert ended == "forced evolution no longer pays: no growth in the last phase"
    islands = dataclasses.replace(patient.evolution.islands, count=2)
    several = dataclasses.replace(
        patient, evolution=dataclasses.replace(patient.evolution, islands=islands)
    )
    assert dataclasses.replace(snapshot, config=several).ended is None


def test_without_a_checkpoint_the_run_is_not_finished(run):
    certify(run)
    for folder in (run / "checkpoints").iterdir():
        folder.rename(folder.with_name(f"{folder.name}.tmp"))
    assert said(run) is None
