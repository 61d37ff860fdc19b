"""The whole examination, its report and its files."""

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest
from certify_made_up import DOG, make_champion, walk

from mjxgait.certification import CertificateConfig, certify, nominal_check, trial_run, trials
from mjxgait.certification.describe import (
    cost_of_transport,
    describe,
    footfall_phases,
    gait_name,
)
from mjxgait.config.tables import build, read_toml
from mjxgait.errors import UserError
from mjxgait.reference.measure import dimensions
from mjxgait.reference.starts import nominal_starts

SMALL = {
    "seconds": 7.0,
    "warmup": 1.0,
    "starts": {"count": 4},
    "pushes": {
        "count": 4,
        "window": [1.0, 3.0],
        "ladder": [0.3, 2.0],
        "ladder_count": 4,
        "ladder_seconds": 2.0,
    },
}


@pytest.fixture(scope="module")
def certificate(tiny, trotter):
    return certify(tiny, trotter, build(CertificateConfig, SMALL, "test"))


@pytest.fixture(scope="module")
def seen(tiny, trotter, certificate):
    return nominal_check(tiny, trotter, certificate.config)


@pytest.fixture(scope="module")
def again(tiny, trotter, certificate, seen):
    """The third examination of a run, by one thread and after a nominal check."""
    return certify(tiny, trotter, certificate.config, threads=1, seen=seen, attempts=3)


def test_a_walk_is_examined_by_all_nine_criteria(certificate):
    verdicts = {c.number: c.passed for c in certificate.criteria}
    assert set(verdicts) == set(range(1, 10))
    assert [n for n in (1, 3, 4, 5, 8, 9) if not verdicts[n]] == []
    assert certificate.passed == all(verdicts.values())
    assert certificate.margin == min(c.margin for c in certificate.criteria)


def test_standing_is_no_walk(tiny):
    few = {"count": 2, "ladder": [0.3], "ladder_count": 2, "window": [1.0, 2.0]}
    short = {"seconds": 4.0, "warmup": 1.0, "starts": {"count": 2}, "pushes": few}
    certificate = certify(tiny, make_champion(tiny), build(CertificateConfig, short, "test"))
    assert [c.number for c in certificate.criteria if c.passed and c.number in (1, 2, 4, 7, 8)] == [
        1,
        4,
        8,
    ]
    assert not certificate.passed
    assert certificate.margin < 0
    assert certificate.report["gait"] == "none"


def test_the_file_is_strict_json_with_value_threshold_and_result(certificate):
    document = json.loads(certificate.to_json(), parse_constant=lambda name: pytest.fail(name))
    assert document["passed"] is certificate.passed
    assert [c["number"] for c in document["criteria"]] == list(range(1, 10))
    for measure in (m for c in document["criteria"] for m in c["measures"]):
        assert set(measure) == {
            "name",
            "value",
            "sense",
            "threshold",
            "room",
            "passed",
            "margin",
        }
    assert document["report"]["gait"] in ("trot", "walk", "running walk")
    assert document["report"]["push_survival"]["2"] < 0.5
    assert 0.1 < document["report"]["push_that_fells_half"] <= 2.0


def test_every_champion_is_examined_on_its_own_draw(tiny, trotter):
    config, other = CertificateConfig(), make_champion(tiny)
    mine, again, others, common = (
        trials.starts(tiny, config, draw, 8).joint_offset
        for draw in (
            trials.own_draw(trotter, config),
            trials.own_draw(dataclasses.replace(trotter, fitness=3.0, origin={"seed": 4}), config),
            trials.own_draw(other, config),
            trials.common_draw(config),
        )
    )
    np.testing.assert_array_equal(mine, again)
    for draw in (others, common):
        assert not np.isin(mine, draw).any()
    reseeded = dataclasses.replace(config, seed=1)
    for draw in (trials.own_draw(trotter, reseeded), trials.common_draw(reseeded)):
        assert not np.isin(trials.pushes(tiny, config, draw, 8).push_time, common).any()
        assert not np.isin(trials.starts(tiny, config, draw, 8).joint_offset, (mine, common)).any()


def test_the_starts_have_every_disturbance_of_the_settings(tiny):
    starts = trials.starts(tiny, CertificateConfig(), trials.Draw((0,)), 16)
    plain = nominal_starts(tiny, 16)
    changed = {
        field.name
        for field in dataclasses.fields(starts)
        if not np.array_equal(getattr(starts, field.name), getattr(plain, field.name))
    }
    assert changed == {
        "joint_offset",
        "joint_velocity",
        "friction",
        "mass",
        "stiffness",
        "damping",
        "delay",
        "slope",
        "floor",
    }


def test_the_trial_run_returns_the_margin_of_criteria_4_and_5(tiny, trotter):
    config = build(CertificateConfig, SMALL, "test")
    assert trial_run(tiny, trotter, 4, config) == 1.0
    flat = make_champion(tiny, np.tile([1.0, 1.4], (2, 4)))
    assert trial_run(tiny, flat, 2, config) == pytest.approx(-9.0)
    # The first fall puts the wanted margin out of reach.
    assert -9.0 <= trial_run(tiny, flat, 2, config, wanted=0.0) <= -4.0


def test_the_file_has_the_number_of_examinations_of_the_run(certificate, again):
    assert json.loads(certificate.to_json())["attempts"] == 1
    assert json.loads(again.to_json())["attempts"] == 3
    assert again.criteria == certificate.criteria


def test_the_table_has_a_row_per_measure(certificate):
    rows = certificate.rows()
    assert len(rows) == sum(len(c.measures) for c in certificate.criteria)
    assert all(row[-1] in ("pass", "FAIL") for row in rows)


def test_the_same_examination_twice_gives_the_same_numbers(certificate, again):
    assert again.rows() == certificate.rows()
    assert again.report == certificate.report


def test_the_shipped_file_shows_the_defaults():
    file = Path(__file__).parents[2] / "configs" / "certificate" / "default.toml"
    assert build(CertificateConfig, read_toml(file), str(file)) == CertificateConfig()


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ({"secnds": 10}, 'did you mean "seconds"'),
        ({"warmup": 30.0}, "shorter"),
        ({"gait": {"slip": -1}}, "gait.slip"),
        ({"upright": {"height": [1.2, 1.5]}}, "around 1"),
    ],
)
def test_a_wrong_setting_is_named(table, words):
    with pytest.raises(UserError, match=words):
        build(CertificateConfig, table, "mine.toml")


def test_dimensions_have_the_places_of_the_feet(tiny):
    size = dimensions(tiny)
    np.testing.assert_allclose(
        size.foot_places, [(0.2, 0.11), (0.2, -0.11), (-0.2, 0.11), (-0.2, -0.11)], atol=1e-12
    )
    assert size.foot_names == tuple(
        f"{leg}_lower" for leg in ("front_left", "front_right", "hind_left", "hind_right")
    )


def test_the_report_of_a_made_up_walk():
    report = describe(walk().window(2.0), 0.03)
    assert report["speed"] == pytest.approx(0.8)
    assert report["froude_number"] == pytest.approx(0.8**2 / (9.81 * 0.36))
    assert report["stride_length"] == pytest.approx(0.64, rel=0.01)
    assert list(report["duty_factor"].values()) == pytest.approx([0.6] * 4, abs=0.01)
    assert report["footfall_diagram"]["front_left"] == "#" * 12 + "." * 8
    assert report["gait"] == "trot"


def test_cost_of_transport_counts_positive_work_only():
    good = walk()
    power = dataclasses.replace(
        good, torque=np.full((4400, 4), 2.0), joint_vel=np.tile([1.0, 1.0, -1.0, 0.0], (4400, 1))
    )
    assert cost_of_transport(power) == pytest.approx(4.0 / (20.0 * 9.81 * 0.8), rel=1e-3)


def test_footfall_phases_are_recovered():
    phases = footfall_phases(walk(phases=(0.0, 0.5, 0.25, 0.75)).window(2.0))
    # A foot that leads by a quarter stands a quarter of a cycle earlier.
    np.testing.assert_allclose(phases, [0.0, 0.5, 0.75, 0.25], atol=0.01)


# Phases in cycles at which each foot stands: front left, front right, hind left, hind right.
@pytest.mark.parametrize(
    ("phases", "duty", "name"),
    [
        ((0.0, 0.5, 0.5, 0.0), 0.6, "trot"),
        ((0.0, 0.5, 0.0, 0.5), 0.6, "pace"),
        ((0.0, 0.5, 0.75, 0.25), 0.65, "walk"),
        ((0.0, 0.5, 0.75, 0.25), 0.85, "crawl"),
        ((0.0, 0.02, 0.5, 0.48), 0.4, "bound"),
        ((0.0, 0.02, 0.01, 0.99), 0.4, "pronk"),
        ((0.0, 0.2, 0.5, 0.65), 0.35, "gallop"),
        ((0.0, 0.0, 0.0, 0.0), 1.0, "none"),
    ],
)
def test_names_of_quadruped_gaits(phases, duty, name):
    assert gait_name(DOG, np.full(4, duty), np.array(phases)) == name


@pytest.mark.parametrize(
    ("phases", "duty", "name"),
    [((0.0, 0.5), 0.6, "walk"), ((0.0, 0.45), 0.4, "run"), ((0.0, 0.05), 0.4, "hop")],
)
def test_names_of_biped_gaits(phases, duty, name):
    duck = dataclasses.replace(
        DOG, foot_names=("left", "right"), foot_places=((0.0, 0.1), (0.0, -0.1))
    )
    assert gait_name(duck, np.full(2, duty), np.array(phases)) == name


@pytest.mark.parametrize(
    ("phases", "duty", "name"),
    [
        ((0.0, 0.5, 0.5, 0.0, 0.0, 0.5), 0.55, "tripod"),
        ((0.0, 0.5, 0.66, 0.16, 0.33, 0.83), 0.8, "wave"),
        ((0.0, 0.5, 0.66, 0.16, 0.33, 0.83), 0.6, "metachronal"),
    ],
)
def test_names_of_hexapod_gaits(phases, duty, name):
    places = tuple((x, y) for x in (0.2, 0.0, -0.2) for y in (0.3, -0.3))
    crab = dataclasses.replace(DOG, foot_names=tuple("abcdef"), foot_places=places)
    assert gait_name(crab, np.full(6, duty), np.array(phases)) == name


def test_the_gait_of_a_crawler_is_crawl():
    alien = dataclasses.replace(
        DOG, foot_names=("left", "right"), foot_places=((0.1, 0.1), (0.1, -0.1)), crawler=True
    )
    assert gait_name(alien, np.full(2, 0.5), np.array([0.0, 0.5])) == "crawl"


def test_the_nominal_check_has_the_margin_of_the_undisturbed_walk(certificate, seen):
    """`again` covers the examination after a nominal check."""
    alone = min(c.margin for c in certificate.criteria if c.number not in (4, 5))
    assert seen.margin == alone
