"""Worked example of docs/research/worked-example.md.

Its code reproduces the certificate's numbers, its table shows them, and the stored champion repeats
the stored walk.
"""

import ast
import importlib.util
import json
import re
from pathlib import Path

import numpy as np
import pytest

from mjxgait.certification import CertificateConfig, outdated, record
from mjxgait.champion import read_champion
from mjxgait.creature import load_creature

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "research" / "worked-example.md").read_text(encoding="utf-8")
CODE = re.search(r"```python\n(.*?)```", PAGE, re.DOTALL).group(1)
FOLDER = ROOT / "docs" / "data" / "walk"
NOT_STORED = {
    "off straight ahead (deg)",
    "buzz of a joint / joint speed",
    "left and right amplitudes",
}
"""Measures of criteria 2, 3 and 7 that need more than `walk.npz` has."""


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


def test_the_code_imports_only_numpy():
    imported = {
        a.name
        for node in ast.walk(ast.parse(CODE))
        if isinstance(node, ast.Import)
        for a in node.names
    }
    assert imported == {"numpy"}
    assert not any(isinstance(node, ast.ImportFrom) for node in ast.walk(ast.parse(CODE)))


def test_the_code_reproduces_the_numbers_of_criteria_2_3_and_7(by_hand, certified):
    assert by_hand.keys() | NOT_STORED == certified.keys()
    assert not by_hand.keys() & NOT_STORED
    for name, value in by_hand.items():
        assert value == pytest.approx(certified[name], rel=1e-5), name


def test_the_table_shows_both_numbers(by_hand, certified):
    table = re.findall(r"^\| ([^|]+) \| ([\d.]+) \| ([\d.]+) \|$", PAGE, re.MULTILINE)
    assert [row[0] for row in table] == list(by_hand)
    for name, hand, certificate in table:
        assert float(hand) == pytest.approx(by_hand[name], rel=1e-5)
        assert float(certificate) == pytest.approx(certified[name], rel=1e-5)


@pytest.fixture(scope="module")
def store_walk():
    spec = importlib.util.spec_from_file_location("store_walk", ROOT / "scripts" / "store_walk.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_script_writes_the_page(store_walk):
    assert store_walk.page_of(PAGE, FOLDER) == PAGE
    without = store_walk.NUMBERS.sub(r"\1\3", PAGE)
    assert without.count("<!-- numbers: ") == 3
    assert store_walk.page_of(without, FOLDER) == PAGE


def test_the_stored_champion_walks_the_stored_walk(store_walk):
    """On another machine a new simulation differs in its last digits, but does not drift apart."""
    creature, config = load_creature(FOLDER / "creature"), CertificateConfig()
    champion = read_champion(FOLDER / "champion.json", creature)
    certificate = json.loads((FOLDER / "certificate.json").read_text())
    assert certificate["passed"]
    assert outdated(certificate, champion, creature) is None
    stored = np.load(FOLDER / "walk.npz")
    again = store_walk.arrays(record(creature, champion, config.seconds).window(config.warmup))
    assert again.keys() == set(stored)
    np.testing.assert_allclose(again["trunk"], stored["trunk"], atol=10_000)  # 1 cm
    np.testing.assert_allclose(again["joints"], stored["joints"], atol=20_000)  # 20 mrad
    assert (FOLDER / "walk.npz").stat().st_size < 400_000
