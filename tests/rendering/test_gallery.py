"""Champions side by side: their words, their order, and the sheet of pictures."""

import numpy as np
import pytest
from rendering.grown import STEP, grown_walk, leaps, straight

from mjxgait.rendering.gallery import TILE, Entry, Sheet, by_strategy, motion_of, tally


def entry(name: str, task: str, way: np.ndarray, doubt: str = "") -> Entry:
    return Entry(name, grown_walk(task, way), doubt)


@pytest.fixture(scope="module")
def shown() -> list[Entry]:
    return by_strategy(
        [
            entry("slow", "roam", straight(0.8, 0.0, 0.0, 300)),
            entry("rising", "swim", straight(1.0, 0.0, 2.0, 300), "Not certified: it sinks"),
            entry("fast", "roam", straight(2.0, 1.0, 0.0, 300)),
        ]
    )


def test_they_stand_by_strategy_and_the_fastest_first(shown: list[Entry]):
    assert [one.name for one in shown] == ["rising", "fast", "slow"]
    assert [one.strategy for one in shown] == ["spin", "crawl", "crawl"]
    assert [one.certified for one in shown] == [False, True, True]
    assert tally(shown) == "spin 1, crawl 2"


def test_a_motion_has_the_corners_of_the_blocks():
    walk = grown_walk("roam", straight(1.0, 0.0, 0.0, 300))
    motion = motion_of(walk)
    model = walk.creature.model
    boxes = np.flatnonzero(model.geom_bodyid > 0)
    np.testing.assert_allclose(motion.volume, 8 * model.geom_size[boxes].prod(1))
    assert motion.points.shape[1:] == (len(boxes), 8, 3)
    # The first 2 s do not count.
    assert motion.seconds == pytest.approx(walk.seconds - 2.0, abs=2 * STEP)
    assert motion.speed * motion.length == pytest.approx(1.0 / (300 * STEP), rel=0.01)


def test_a_leap_is_given_in_metres():
    one = entry("leaper", "jump", leaps(0.8, 300) + np.array([0.0, 0.0, 0.3]))
    assert one.strategy == "jump"
    assert "m off the ground" in one.does


def test_a_sheet_has_a_picture_of_each(shown: list[Entry]):
    sheet = Sheet(shown, "three", 1.0)
    assert sheet.columns == 3
    picture = np.asarray(sheet.picture(0.5), int)
    assert picture.shape[:2] == (sheet.size[1], sheet.size[0])
    middle = picture[46 + TILE[1] // 2]
    # Water, and sand twice.
    assert middle[20, 2] > middle[20, 0]
    assert all(
        middle[20 + place * (TILE[0] + 10), 2] < middle[20 + place * (TILE[0] + 10), 0]
        for place in (1, 2)
    )
    frames = list(sheet.pictures(0.1, 20))
    assert len(frames) == 2
    assert (np.asarray(frames[0]) != np.asarray(frames[1])).any()
