"""A damaged file of a run folder gives one sentence, whatever invalid value a field has."""

import copy
import dataclasses
import errno
import json
import tomllib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import tomli_w
from helpers import said_by
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from rendering.made_up import metrics_line, treading, write_run

from mjxgait.api import examining
from mjxgait.certification import CertificateConfig, read_certificate, read_stress
from mjxgait.champion import read_champion, write_champion
from mjxgait.config.schema import Config
from mjxgait.config.tables import added_in
from mjxgait.creature import Creature, load_creature
from mjxgait.errors import UserError
from mjxgait.inspect.sections import island_facts
from mjxgait.rendering.walk import record_walk
from mjxgait.training.exams import Exams
from mjxgait.training.folder import CERTIFICATE, CHAMPION, CONFIG, METRICS, open_run
from mjxgait.training.logs import columns, read_metrics
from mjxgait.training.stored import FOLDER, stored_generations
from mjxgait.web.certificate import certificate_table
from mjxgait.web.live import Watcher

DEEP: Any = []
for _ in range(200):
    DEEP = [DEEP]
GONE = object()
HOSTILE = [
    *(GONE, None, True, 0, -1, 1.5, 3 * 10**7, 10**400, float("inf"), float("nan"), "", "x"),
    *("\x1b[2J", "\ud800", "../../x", [], {}, [1, 2], [[1.0], [1.0, 2.0]], {"a": 1}, DEEP),
]
EXAMPLES = settings(
    max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)


def places(value: Any, path: tuple = ()) -> Iterator[tuple]:
    """All paths in a document, the empty one included."""
    yield path
    inner = dict(enumerate(value)) if isinstance(value, list) else value
    for key, one in inner.items() if isinstance(inner, dict) else ():
        yield from places(one, (*path, key))


def changed(document: Any, path: tuple, value: Any) -> Any:
    """A copy with another value at a path, or without that field."""
    if not path:
        return value if value is not GONE else {}
    found = copy.deepcopy(document)
    inner = found
    for key in path[:-1]:
        inner = inner[key]
    if value is GONE:
        del inner[path[-1]]
    else:
        inner[path[-1]] = value
    return found


def is_one_sentence(read: Callable[[], object], named: str) -> bool:
    """Whether reading succeeds, or fails with one sentence that names the file."""
    try:
        read()
    except UserError as error:
        return named in str(error) and "\n" not in str(error)
    return True


CRITERION = {
    "number": 1,
    "name": "upright",
    "passed": True,
    "margin": 0.5,
    "measures": [
        {
            "name": "tilt",
            "value": 0.1,
            "sense": "<=",
            "threshold": 1.0,
            "passed": True,
            "margin": 0.9,
        }
    ],
}


def certificate_of(champion: Any) -> dict[str, Any]:

    from mjxgait.certification.certificate import schema_of

    report = {"speed": 0.5, "gait": "trot", "summary": "It walks.", "duty_factor": {"a": 0.5}}
    return {
        "schema": schema_of("walk"),
        "champion": champion.fingerprint,
        "passed": True,
        "margin": 0.5,
        "criteria": [CRITERION],
        "task": champion.task,
        "config": dataclasses.asdict(CertificateConfig()),
        "report": report | {"likeness": {"stride": 1.0, "duty_factor": 1.0, "patter": 0.1}},
    }


@EXAMPLES
@given(data=st.data())
def test_a_damaged_champion_gives_one_sentence(
    data: st.DataObject, stool: Creature, tmp_path: Path
):
    path = tmp_path / CHAMPION
    write_champion(treading(stool), stool, path)
    document = json.loads(path.read_text())
    place = data.draw(st.sampled_from(list(places(document))))
    path.write_text(json.dumps(changed(document, place, data.draw(st.sampled_from(HOSTILE)))))

    def read() -> None:
        champion = read_champion(path, stool)
        try:
            record_walk(champion.embodied(stool), champion, 0.02)
        except UserError as error:
            raise UserError(f"{path}: {error}") from None
        assert champion.fingerprint
        f"{champion.fitness:.2f}, {champion.origin.get('versions', {}).items()}"

    assert is_one_sentence(read, CHAMPION)


@EXAMPLES
@given(data=st.data())
def test_a_damaged_certificate_gives_one_sentence(
    data: st.DataObject, stool: Creature, tmp_path: Path
):
    champion, path = treading(stool), tmp_path / CERTIFICATE
    document = certificate_of(champion)
    place = data.draw(st.sampled_from(list(places(document))))
    path.write_text(json.dumps(changed(document, place, data.draw(st.sampled_from(HOSTILE)))))

    def read() -> None:
        if found := read_certificate(path):
            assert certificate_table(tmp_path, stool, champion)
            f"{found['margin'] or 0.0:.2f}"

    assert is_one_sentence(read, CERTIFICATE)


@pytest.mark.parametrize("value", ["half", None, True, -0.1, 1e9, [0.5]])
def test_a_damaged_stress_result_gives_one_sentence(value: Any, stool: Creature, tmp_path: Path):
    path, champion = tmp_path / "stress.json", treading(stool)
    trials = [{"name": "bumps", "share": value, "passed": False}]
    told = {"schema": 1, "champion": champion.fingerprint, "passed": False, "trials": trials}
    path.write_text(json.dumps(told))
    with pytest.raises(UserError, match=r"stress\.json: .*share.*writes it anew"):
        read_stress(path, champion)


@EXAMPLES
@given(data=st.data())
def test_a_damaged_log_gives_one_sentence(data: st.DataObject, tmp_path: Path):
    line = metrics_line(1) | {"mothers": [0, 1]}
    place = data.draw(st.sampled_from(list(places(line))))
    spoilt = changed(line, place, data.draw(st.sampled_from(HOSTILE)))
    lines = [metrics_line(0), spoilt, metrics_line(2)]
    (tmp_path / METRICS).write_text("".join(json.dumps(one) + "\n" for one in lines))
    assert is_one_sentence(lambda: columns(read_metrics(tmp_path / METRICS)), f"{METRICS}, line 2")


@pytest.mark.parametrize(
    "text", ["5", "[1, 2]", "{}", '{"generation": "1"}', "\x00", '{"passed": 1}']
)
def test_other_damaged_logs_give_one_sentence(text: str, tmp_path: Path):
    exams = tmp_path / "exams.jsonl"
    exams.write_text(f"{text}\n")
    with pytest.raises(UserError, match=r"exams\.jsonl, line 1: .*take the line out"):
        Exams(exams).taken(3)
    (tmp_path / "islands" / "²").mkdir(parents=True)
    (tmp_path / "migrations.jsonl").write_text(f"{text}\n")
    with pytest.raises(UserError, match=r"migrations\.jsonl, line 1: "):
        island_facts(tmp_path, 3)


def test_only_folders_named_by_a_number_are_checkpoints(tmp_path: Path):
    for name in ("3", "²", "٣", "4.tmp"):
        (tmp_path / FOLDER / name).mkdir(parents=True)
    assert stored_generations(tmp_path) == [3]


def test_stored_settings_are_whole_or_refused(stool: Creature, tmp_path: Path):
    """A default in place of a lost table would be another run."""
    run = write_run(tmp_path / "run", stool)
    table = tomllib.loads((run / CONFIG).read_text())
    assert open_run(run)[1] == Config()
    keys = [p for p in places(table) if p and isinstance(p[-1], str)]
    for place in (p for p in keys if ".".join(p) not in added_in(Config)):
        (run / CONFIG).write_text(tomli_w.dumps(changed(table, place, GONE)))
        with pytest.raises(UserError, match=r"config\.toml: .*"):
            open_run(run)


def test_stored_settings_of_earlier_checkouts_lack_keys_that_were_added(
    stool: Creature, tmp_path: Path
):
    """Also keys within a table that was added."""
    run = write_run(tmp_path / "run", stool)
    table = tomllib.loads((run / CONFIG).read_text())
    added = [p for p in places(table) if ".".join(map(str, p)) in added_in(Config)]
    assert ("evolution", "ancestors", "starts") in added
    assert ("evolution", "ancestors") in added
    for place in added:
        (run / CONFIG).write_text(tomli_w.dumps(changed(table, place, GONE)))
        assert open_run(run)[1] == Config()


def test_a_full_disk_keeps_the_old_certificate(
    stool: Creature, tmp_path: Path, capsys, monkeypatch: pytest.MonkeyPatch
):
    run = write_run(tmp_path / "run", stool, treading(stool))
    (run / CERTIFICATE).write_text("old")

    class Examined:
        def to_json(self) -> str:
            return "new"

    def full(self: Path, data: bytes) -> int:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(examining, "examine", lambda run, config: Examined())
    monkeypatch.setattr(Path, "write_bytes", full)
    said = said_by(capsys, "certify", run, code=2)
    assert "certificate.json: cannot be written: No space left on device" in said
    assert (run / CERTIFICATE).read_text() == "old"


def test_the_page_shows_the_error_of_a_damaged_log(stool: Creature, tmp_path: Path):
    run = write_run(tmp_path / "run", stool, generations=2)
    watcher = Watcher(run)
    (run / METRICS).write_text("5\n")
    state = watcher.state()
    assert state["history"] == []
    assert f"{METRICS}, line 1" in state["what"]


def test_run_names_are_not_read_as_markup(tmp_path: Path, capsys):
    run = tmp_path / "[red]run"
    run.mkdir()
    (run / CONFIG).write_text("damaged")
    assert "[red]run " in said_by(capsys, "inspect", tmp_path, code=0)


@pytest.mark.parametrize("name", ["", "../x", "a/b", "-x", ".x", "x" * 101, "a:b", "x "])
def test_a_creature_name_must_be_a_valid_file_name(name: str, stool: Creature, tmp_path: Path):
    for file, text in stool.files.items():
        (tmp_path / file).write_text(text.replace('"stool"', json.dumps(name), 1))
    with pytest.raises(UserError, match=r"creature\.toml: .*name"):
        load_creature(tmp_path)
