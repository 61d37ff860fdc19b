"""Ancestors, read from the log of a run."""

from mjxgait.training.logs import MOTHERS, mothers_line

LOG = [
    {"generation": 0, MOTHERS: [-1, -1, -1]},
    {"generation": 1, MOTHERS: [2, 0, 2]},
    {"generation": 2, MOTHERS: [1, 0, 0]},
]


def test_ancestors_are_followed_mother_by_mother():
    assert mothers_line(LOG, 2, 0) == {2: 0, 1: 1, 0: 0}
    assert mothers_line(LOG, 2, 1) == {2: 1, 1: 0, 0: 2}
    assert mothers_line(LOG, 1, 2) == {1: 2, 0: 2}


def test_ancestors_are_followed_as_far_as_the_log_goes():
    assert mothers_line(LOG[1:], 2, 0) == {2: 0, 1: 1, 0: 0}
    assert mothers_line([LOG[0], {"generation": 1}, LOG[2]], 2, 0) == {2: 0, 1: 1}
    assert mothers_line([], 4, 1) == {4: 1}
