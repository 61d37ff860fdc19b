"""Skinned files as strangers send them: a sentence, or the same skeleton."""

from pathlib import Path

import numpy as np
import pytest
from importer.hostile_rigs import ODD, REFUSED, Change, changed
from importer.rigs import glb

from mjxgait.errors import UserError
from mjxgait.importer.notes import Notes
from mjxgait.importer.rigged import source_of_rig
from mjxgait.importer.source import Source


def read(folder: Path, data: bytes) -> Source:
    file = folder / "dog.glb"
    file.write_bytes(data)
    return source_of_rig(file, None, None, Notes())


@pytest.mark.parametrize(("change", "words"), REFUSED.values(), ids=REFUSED)
def test_a_damaged_rig_is_one_sentence(tmp_path: Path, change: Change, words: str):
    with pytest.raises(UserError, match=words) as raised:
        read(tmp_path, changed(change))
    assert str(raised.value).startswith(str(tmp_path / "dog.glb"))
    assert "\n" not in str(raised.value)


def test_another_version_of_the_format_is_refused(tmp_path: Path):
    data = glb()
    with pytest.raises(UserError, match=r"of version 1 of glTF; export as glTF 2\.0"):
        read(tmp_path, data[:4] + b"\1" + data[5:])


@pytest.mark.parametrize("change", ODD.values(), ids=ODD)
def test_an_odd_rig_has_the_skeleton_of_a_plain_one(tmp_path: Path, change: Change):
    """Its bones are as long, in the same order."""
    odd, plain = (lengths(read(tmp_path, data)) for data in (changed(change), glb()))
    np.testing.assert_allclose(odd, plain, rtol=0.02)


def lengths(source: Source) -> list[float]:
    """Distances between bodies and their parents, in units of the longest, sorted."""
    spots = [np.array(body.get("pos").split(), float) for body in source.tree.iter("body")][1:]
    found = np.linalg.norm(spots, axis=1)
    return sorted(found / found.max())
