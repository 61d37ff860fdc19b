"""Looks of the page that drives a repertoire; its motion is tested in `repertoire/test_driven.py`."""

from experiments.repertoire.made_up import begin, examine
from web.browser import check_dark, wait_until, watched_tab

from mjxgait.experiments.repertoire.clips import write_driven


def test_the_page_is_dark_where_the_user_wants_that(browser, tmp_path):
    made, page = begin(tmp_path / "set"), tmp_path / "drive.html"
    examine(*made)
    write_driven(made[0], page)
    tab, wrong, _ = watched_tab(browser, page.as_uri(), color_scheme="dark")
    wait_until(tab, "document.querySelector('circle.used')")
    used = "getComputedStyle(document.querySelector('circle.used')).fill"
    assert tab.evaluate(used) == "rgb(232, 234, 237)"
    check_dark(tab)
    assert wrong == []
    tab.close()
