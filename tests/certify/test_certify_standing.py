"""A certificate counts for the champion that was examined, and for no other."""

import dataclasses
import json
import os

import numpy as np
import pytest

from mjxgait.certify import CertificateConfig, certify, outdated, read_certificate
from mjxgait.champion import read_champion, write_champion
from mjxgait.errors import UserError
from mjxgait.settings.tables import build

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


def test_a_certificate_is_of_the_champion_that_was_examined(run, tiny, trotter):
    document = read_certificate(run / "certificate.json")
    assert document["champion"] == trotter.fingerprint
    assert outdated(document, trotter) is None
    assert outdated(document, read_champion(run / "champion.json", tiny)) is None


def test_times_of_files_do_not_matter(run, tiny):
    os.utime(run / "certificate.json", (0, 0))
    assert (
        outdated(
            read_certificate(run / "certificate.json"), read_champion(run / "champion.json", tiny)
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
def test_whatever_moves_otherwise_is_another_champion(run, trotter, change):
    other = dataclasses.replace(trotter, **change(trotter))
    assert "another champion" in outdated(read_certificate(run / "certificate.json"), other)


def test_fitness_and_origin_are_not_what_was_examined(run, trotter):
    same = dataclasses.replace(
        trotter, fitness=9.0, terms={"distance": 1.0}, origin={"generation": 3}
    )
    assert outdated(read_certificate(run / "certificate.json"), same) is None


def test_poses_in_single_precision_have_the_fingerprint_of_what_is_written(tiny, trotter, tmp_path):
    """Evolution hands over float32."""
    single = dataclasses.replace(
        trotter,
        genome={name: array.astype(np.float32) for name, array in trotter.genome.items()},
    )
    write_champion(single, tiny, tmp_path / "champion.json")
    assert read_champion(tmp_path / "champion.json", tiny).fingerprint == single.fingerprint


def test_a_certificate_that_does_not_say_whose_it_is_is_outdated(run, trotter):
    document = read_certificate(run / "certificate.json")
    del document["champion"]
    assert "does not say which champion" in outdated(document, trotter)


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
def test_what_is_not_a_certificate_is_said(tmp_path, text):
    assert read_certificate(tmp_path / "certificate.json") is None
    (tmp_path / "certificate.json").write_text(text)
    with pytest.raises(UserError, match="not a certificate"):
        read_certificate(tmp_path / "certificate.json")


def test_the_file_is_read_as_written(run):
    assert read_certificate(run / "certificate.json") == json.loads(
        (run / "certificate.json").read_text()
    )
