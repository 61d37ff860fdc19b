"""What an import may take is bounded: bytes, elements, seconds and memory."""

import dataclasses
import signal
import subprocess
from pathlib import Path

import pytest
from helpers import STOOL

from mjxgait.errors import UserError
from mjxgait.importer import ImportChoices, import_model
from mjxgait.importer.source import MOST_ATTRIBUTES, MOST_ELEMENTS, MOST_XML

MODEL = STOOL / "creature.xml"
ATTRIBUTES = " ".join(f"a{i}='1'" for i in range(100_000))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("<mujoco>" + "<geom/>" * MOST_ELEMENTS + "</mujoco>", "elements"),
        (f"<mujoco {ATTRIBUTES}/>", f"more than {MOST_ATTRIBUTES}"),
        ("<mujoco>" + " " * MOST_XML + "</mujoco>", "larger than 4 MB"),
    ],
    ids=["elements", "attributes", "bytes"],
)
def test_a_file_is_bounded(text: str, words: str, tmp_path: Path):
    path = tmp_path / "model.xml"
    path.write_text(text)
    with pytest.raises(UserError, match=words):
        import_model(path)


def test_memory_is_bounded():
    """What a compilation takes beyond the memory of the process that it begins in."""
    with pytest.raises(UserError, match=r"creature\.xml: .*memory.*--gigabytes"):
        import_model(MODEL, ImportChoices(gigabytes=1e-6))


@pytest.mark.skipif(not hasattr(signal, "SIGXCPU"), reason="this system bounds no processor time")
def test_processor_time_is_bounded(monkeypatch: pytest.MonkeyPatch):
    """The system ends a process that has had its time."""
    given = {}

    def run(command, input, **options):
        given.update(options)
        return subprocess.CompletedProcess(command, -signal.SIGXCPU, b"", b"")

    monkeypatch.setattr("mjxgait.importer.worker.subprocess.run", run)
    with pytest.raises(UserError, match=r"within 10 s; .*--seconds"):
        import_model(MODEL)
    assert given["timeout"] > 10
    with pytest.raises(UserError, match="within 30 s"):
        import_model(MODEL, dataclasses.replace(ImportChoices(), seconds=30.0))
