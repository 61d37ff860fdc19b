"""A certificate counts only for the examined champion."""

import dataclasses
import json
import os

import numpy as np
import pytest
from helpers import made_up_certificate

from mjxgait.certification import (
    CertificateConfig,
    Criterion,
    certify,
    outdated,
    read_certificate,
    verdict_of,
    verdict_on,
)
from mjxgait.certification.validity import differences
from mjxgait.champion import read_champion, write_champion
from mjxgait.config.tables import build
from mjxgait.errors import UserError

BRIEF = {
    "seconds": 1.5,
    "warmup": 0.5,
    "starts": {"count": 1},
    "pushes": {"count": 1, "window": [0.1, 0.2], "ladder": [2.0], "ladder_count": 1},
}


@pytest.fixture(scope="module")
def run(tiny, trotter, tmp_path_factory):
    """A folder with a champion and its certificate."""
    folder = tmp_path_factory.mktemp("run")
    write_champion(trotter, tiny, folder / "champion.json")
    (folder / "certificate.json").write_text(
        certify(tiny, trotter, build(CertificateConfig, BRIEF, "test")).to_json()
    )
    return folder


def test_a_certificate_counts_for_the_examined_champion(run, tiny, trotter):
    document = read_certificate(run / "certificate.json")
    assert document["champion"] == trotter.fingerprint
    assert outdated(document, trotter, tiny) is None
    assert outdated(document, read_champion(run / "champion.json", tiny), tiny) is None


def test_file_times_do_not_matter(run, tiny):
    os.utime(run / "certificate.json", (0, 0))
    assert (
        outdated(
            read_certificate(run / "certificate.json"),
            read_champion(run / "champion.json", tiny),
            tiny,
        )
        is None
    )


@pytest.mark.parametrize(
    "change",
    [
        lambda c: {
            "genome": {**c.genome, "key_poses": c.genome["key_poses"] + np.eye(2, 8) * 1e-6}
        },
        lambda c: {"genome": {**c.genome, "tuning": c.genome["tuning"] + np.eye(1, 7)[0] * 0.01}},
        lambda c: {
            "settings": dataclasses.replace(c.settings, interpolation=c.settings.interpolation + 1)
        },
        lambda c: {"drive": dataclasses.replace(c.drive, stiffness=1.01)},
        lambda c: {"digest": "another body"},
    ],
    ids=["pose", "tuning", "controller", "drive", "body"],
)
def test_a_change_of_motion_makes_another_champion(run, tiny, trotter, change):
    other = dataclasses.replace(trotter, **change(trotter))
    assert "another champion" in outdated(read_certificate(run / "certificate.json"), other, tiny)


def test_fitness_and_origin_do_not_affect_the_certificate(run, tiny, trotter):
    same = dataclasses.replace(
        trotter, fitness=9.0, terms={"distance": 1.0}, origin={"generation": 3}
    )
    assert outdated(read_certificate(run / "certificate.json"), same, tiny) is None


def test_single_precision_poses_keep_their_fingerprint_in_the_file(tiny, trotter, tmp_path):
    """Evolution returns float32."""
    single = dataclasses.replace(
        trotter,
        genome={name: array.astype(np.float32) for name, array in trotter.genome.items()},
    )
    write_champion(single, tiny, tmp_path / "champion.json")
    assert read_champion(tmp_path / "champion.json", tiny).fingerprint == single.fingerprint


def test_a_certificate_that_names_no_champion_is_outdated(run, tiny, trotter):
    document = read_certificate(run / "certificate.json")
    del document["champion"]
    assert "does not say which champion" in outdated(document, trotter, tiny)


@pytest.mark.parametrize(
    "text",
    [
        "[]",
        "{",
        "7",
        '{"passed": true}',
        '{"passed": true, "criteria": [{}]}',
        '{"passed": 1, "criteria": []}',
    ],
)
def test_a_file_that_is_no_certificate_is_reported(tmp_path, text):
    assert read_certificate(tmp_path / "certificate.json") is None
    (tmp_path / "certificate.json").write_text(text)
    with pytest.raises(UserError, match="not a certificate"):
        read_certificate(tmp_path / "certificate.json")


def test_the_file_is_read_as_written(run):
    assert read_certificate(run / "certificate.json") == json.loads(
        (run / "certificate.json").read_text()
    )


@pytest.mark.parametrize(
    ("change", "said"),
    [({"task": "hop"}, "for the task walk"), ({"terrain": "rough:0.2"}, "on flat ground")],
)
def test_a_certificate_counts_for_one_task_and_one_ground(run, tiny, trotter, change, said):
    document = read_certificate(run / "certificate.json")
    ground = change.pop("terrain", "flat")
    champion = dataclasses.replace(trotter, **change)
    assert champion.fingerprint == trotter.fingerprint
    assert said in outdated(document, champion, tiny.on(ground))


def test_without_criteria_nothing_passes():
    assert not verdict_on(()).passed
    assert not verdict_on((Criterion(2, "progress", ()),)).passed
    assert not verdict_of(made_up_certificate("", criteria=[])).passed


def test_a_stored_result_is_derived_from_its_measures():
    good, bad = made_up_certificate("", margin=0.25), made_up_certificate("", (2, "progress"))
    assert verdict_of(good).certified
    assert verdict_of(good).margin == pytest.approx(0.25)
    for lie in ({"passed": True}, {"passed": True, "margin": 0.9}):
        verdict = verdict_of(bad | lie)
        assert not verdict.passed
        assert verdict.margin == pytest.approx(-0.5)
        assert verdict.contradiction.endswith("it says passed, its measures say failed")
    assert not verdict_of(good | {"passed": False}).certified
    criteria = [bad["criteria"][0] | {"passed": True}]
    assert verdict_of(bad | {"criteria": criteria}).contradiction.endswith(
        "otherwise of criteria 2"
    )


def test_a_certificate_of_an_earlier_version_keeps_its_margin():
    document = made_up_certificate("", margin=0.25)
    del document["criteria"][0]["measures"][0]["room"]
    assert verdict_of(document).margin == pytest.approx(0.25)
    assert verdict_of(document).certified


def test_other_thresholds_are_reported_but_not_those_of_other_tasks():
    def rules(task="walk", **tables):
        config = build(CertificateConfig, tables, "test")
        return verdict_of(made_up_certificate("", task=task, config=config))

    lax = rules(progress={"drift": 5.0}, seconds=4.0)
    assert lax.passed
    assert not lax.certified
    assert lax.other_rules == (
        "seconds = 4.0 instead of 22.0",
        "progress.drift = 5.0 instead of 0.25",
    )
    assert lax.in_words() == f"by other rules: {', '.join(lax.other_rules)}"
    assert rules(hop={"near": 0.5}).certified
    assert not rules("hop", hop={"near": 0.5}).certified
    assert not rules("follow", swim={"speed": 0.01}).certified
    assert not verdict_of(made_up_certificate("") | {"config": None}).certified


def test_a_repeated_examination_is_compared_by_measure(run, tiny, trotter):
    stored = read_certificate(run / "certificate.json")
    again = certify(tiny, trotter, build(CertificateConfig, BRIEF, "test")).document()
    assert differences(stored, again) == []
    measure = stored["criteria"][1]["measures"][2]
    for key, value in (("value", measure["value"] + 1e-5), ("threshold", 0.0)):
        altered = json.loads(json.dumps(stored))
        altered["criteria"][1]["measures"][2][key] = value
        told = [said for said in differences(altered, again) if not said.startswith("the file")]
        assert len(told) == 1
        assert told[0].startswith("2 progress, speed (body lengths/s): ")
    fewer = stored | {"criteria": stored["criteria"][1:]}
    assert any(said.endswith("is missing") for said in differences(fewer, again))
    assert differences(stored | {"task": "hop"}, again) == ["task: hop, again walk"]


def test_missing_numbers_are_equal():
    document = made_up_certificate("") | {"creature_digest": ""}
    document["criteria"][0]["measures"][0]["value"] = None
    document["criteria"][0]["passed"] = document["passed"] = False
    assert differences(document, document) == []
