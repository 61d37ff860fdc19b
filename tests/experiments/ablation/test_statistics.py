"""Comparisons on made-up samples, checked against scipy, published examples and known truths."""

import numpy as np
import pytest
from scipy import stats

from mjxgait.experiments.ablation import findings
from mjxgait.experiments.ablation.findings import (
    Estimate,
    compare,
    estimate,
    holm,
    improvement,
    permutation_p,
    share,
    trimmed_mean,
)

RNG = np.random.default_rng


def test_the_interquartile_mean_is_the_mean_of_the_middle_half():
    assert trimmed_mean(np.array([100.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, -50.0])) == pytest.approx(
        3.5
    )


@pytest.fixture
def fewer_resamples(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fewer resamples, for hundreds of studies; the error rate does not depend on their number."""
    monkeypatch.setattr(findings, "RESAMPLES", 399)


def test_the_interval_has_its_nominal_coverage(fewer_resamples: None):
    """Of 200 samples of a normal distribution, about 190 intervals contain its mean."""
    covered = 0
    for seed in range(200):
        found = estimate(RNG(seed).normal(3.0, 1.0, 24))
        covered += found.low <= 3.0 <= found.high
    assert 175 <= covered <= 199


def test_successes_are_compared_by_their_share():
    """The middle half of 12 successes in 16 would be all successes."""
    found = estimate(np.array([1.0] * 12 + [0.0] * 4), trim=0.0)
    assert found.value == 0.75
    assert 0.4 < found.low < 0.75 < found.high < 1.0


def test_a_sample_without_spread_has_an_interval_of_zero_width():
    assert estimate(np.full(16, 2.5)) == Estimate(2.5, 2.5, 2.5)


def test_the_chance_of_being_better_is_mann_whitneys_u():
    base, values = RNG(0).normal(0, 1, 12), RNG(1).normal(0.5, 1, 15)
    expected = stats.mannwhitneyu(values, base).statistic / (12 * 15)
    assert improvement(base, values).value == pytest.approx(expected)


@pytest.mark.parametrize(
    ("values", "expected"), [([4.0, 5.0, 6.0], 1.0), ([1.0, 2.0, 3.0], 0.5), ([0.0, 0.0, 0.0], 0.0)]
)
def test_the_chance_of_being_better_from_never_to_always(values: list[float], expected: float):
    assert improvement(np.array([1.0, 2.0, 3.0]), np.array(values)).value == pytest.approx(expected)


def test_an_exact_permutation_test_by_hand():
    """Of the 20 splits of {1..6} into threes, two are as extreme as the observed one."""
    assert permutation_p(
        np.array([1.0, 2.0, 3.0]), np.array([4.0, 5.0, 6.0]), paired=False
    ) == pytest.approx(2 / 20)


def test_a_paired_test_finds_what_an_unpaired_one_misses():
    """Seeds differ much, the variant adds a little to each."""
    base = RNG(0).normal(0, 5, 12)
    values = base + RNG(1).normal(0.5, 0.1, 12)
    assert (
        permutation_p(base, values, paired=True)
        < 0.02
        < 0.5
        < permutation_p(base, values, paired=False)
    )


def test_holms_published_example():
    """Holm 1979: smallest p times the number of tests, next times one less, never decreasing."""
    assert holm([0.01, 0.04, 0.03, 0.005]) == pytest.approx([0.03, 0.06, 0.06, 0.02])
    assert holm([]) == []


def test_wilsons_interval_as_published():
    """Newcombe 1998, table I: 81 of 263 gives 0.2553 to 0.3662, 0 of 20 gives 0 to 0.1611."""
    found, none = share(81, 263), share(0, 20)
    assert (found.low, found.high) == pytest.approx((0.2553, 0.3662), abs=1e-4)
    assert (none.low, none.high) == pytest.approx((0.0, 0.1611), abs=1e-4)


def test_no_difference_is_found_in_19_of_20_null_studies(fewer_resamples: None):
    """200 null studies, seeds 0 to 199, of three variants: about 5% false alarms at most."""
    alarms = 0
    for seed in range(200):
        samples = RNG(seed).gamma(2.0, 1.0, (4, 16))
        ps = [permutation_p(samples[0], values, paired=False) for values in samples[1:]]
        alarms += min(holm(ps)) < 0.05
    assert alarms <= 17


def test_a_true_difference_is_found():
    base, values = RNG(0).normal(0, 1, 16), RNG(1).normal(2, 1, 16)
    found = compare(base, [values], paired=False)[0]
    assert found.corrected < 0.01
    assert found.difference.low > 0.5
    assert found.improvement.low > 0.7


def test_the_same_values_give_the_same_numbers():
    base, values = RNG(0).normal(0, 1, 16), RNG(1).normal(0.3, 1, 16)
    assert compare(base, [values], paired=True) == compare(base, [values], paired=True)
