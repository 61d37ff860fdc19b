"""docs/worked-example.md: its code, run as it stands, comes to the certificate's numbers, and
its table shows them.
"""

import ast
import json
import re
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "worked-example.md").read_text(encoding="utf-8")
CODE = re.search(r"```python\n(.*?)```", PAGE, re.DOTALL).group(1)
FOLDER = ROOT / "docs" / "data" / "tall_quadruped-0"


@pytest.fixture(scope="module")
def by_hand():
    names = {}
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(ROOT)
        exec(CODE, names)
    return {name: float(value) for name, value in names["by_hand"].items()}


@pytest.fixture(scope="module")
def certified():
    document = json.loads((FOLDER / "certificate.json").read_text())
    return {
        m["name"]: m["value"]
        for c in document["criteria"]
        if c["number"] in (2, 3, 7)
        for m in c["measures"]
    }


def test_the_code_knows_nothing_of_the_examiner():
    imported = {
        a.name
        for node in ast.walk(ast.parse(CODE))
        if isinstance(node, ast.Import)
        for a in node.names
    }
    assert imported == {"numpy"}
    assert not any(isinstance(node, ast.ImportFrom) for node in ast.walk(ast.parse(CODE)))


def test_every_number_of_criteria_2_3_and_7_comes_out_by_hand(by_hand, certified):
    assert by_hand.keys() == certified.keys()
    for name, value in by_hand.items():
        assert value == pytest.approx(certified[name], rel=1e-5), name


def test_the_table_shows_both(by_hand, certified):
    table = re.findall(r"^\| ([^|]+) \| ([\d.]+) \| ([\d.]+) \|$", PAGE, re.MULTILINE)
    assert [row[0] for row in table] == list(by_hand)
    for name, hand, certificate in table:
        assert float(hand) == pytest.approx(by_hand[name], rel=1e-5)
        assert float(certificate) == pytest.approx(certified[name], rel=1e-5)


def test_the_walk_is_that_of_the_champion_and_its_certificate():
    champion, certificate = (
        json.loads((FOLDER / f"{name}.json").read_text()) for name in ("champion", "certificate")
    )
    assert champion["creature_digest"] == certificate["creature_digest"]
    walk = np.load(FOLDER / "walk.npz")
    window = certificate["config"]["seconds"] - certificate["config"]["warmup"]
    assert len(walk["trunk"]) == round(window / walk["time_step"])
    assert (FOLDER / "walk.npz").stat().st_size < 400_000
