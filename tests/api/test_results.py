"""What Python makes of a run is what the command line makes: files, pages, pictures."""

import logging
from pathlib import Path

import pytest
from helpers import SHORT, STOOL
from rendering.made_up import treading, write_run

import mjxgait
from mjxgait.api import repertoires, studies
from mjxgait.cli import ablate, main, repertoire
from mjxgait.creature import Creature
from mjxgait.output import LOG, Output


@pytest.fixture
def run(stool: Creature, tmp_path: Path) -> mjxgait.Run:
    """A run with a champion that treads on the spot."""
    return mjxgait.open(write_run(tmp_path / "run", stool, treading(stool)))


@pytest.mark.parametrize("kind", ["glb", "csv"])
def test_export_writes_the_file_of_its_ending(kind: str, run: mjxgait.Run, tmp_path: Path):
    told: list[str] = []
    file = mjxgait.export(run, tmp_path / f"walk.{kind}", tell=told.append)
    assert file.stat().st_size > 100
    assert told[0].startswith(f"{file} (")


def test_films_and_plots_are_written(run: mjxgait.Run, tmp_path: Path):
    film = mjxgait.render(
        run, tmp_path / "walk.webp", seconds=0.2, size=(64, 64), renderer="painter"
    )
    race = mjxgait.render([run, run.folder], str(tmp_path / "race.png"), size=(96, 64), seconds=0.2)
    assert film.read_bytes()[8:12] == b"WEBP"
    assert race.read_bytes()[1:4] == b"PNG"
    with pytest.raises(mjxgait.UserError, match="--fps 0: must lie between"):
        mjxgait.render(run, tmp_path / "x.webp", fps=0)


def test_certify_writes_the_certificate(run: mjxgait.Run, tmp_path: Path):
    (tmp_path / "short.toml").write_text(SHORT)
    assert run.certificate is None
    found = mjxgait.certify(run, tmp_path / "short.toml")
    assert run.certificate == found.document()


def test_an_imported_model_is_a_creature_folder(tmp_path: Path):
    notes: list[str] = []
    creature = mjxgait.import_model(STOOL / "creature.xml", tmp_path / "mine", tell=notes.append)
    assert mjxgait.load_creature(tmp_path / "mine").digest == creature.digest
    assert notes
    with pytest.raises(mjxgait.UserError, match="write over it with --force"):
        mjxgait.import_model(STOOL / "creature.xml", tmp_path / "mine")


def test_a_notebook_shows_the_walk(run: mjxgait.Run, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("mjxgait.rendering.notebook.SECONDS", 0.2)
    shown = run._repr_html_()
    assert "stool, not certified" in shown
    assert 'src="data:image/webp;base64,UklGR' in shown
    (run.folder / "champion.json").unlink()
    assert "no champion yet" in run._repr_html_()


def test_python_and_the_command_line_ask_for_the_same_repertoire(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    asked: list[repertoires.RepertoireRequest] = []

    def evolve_repertoire(
        request: repertoires.RepertoireRequest, output: Output
    ) -> tuple[Path, bool]:
        asked.append(request)
        return tmp_path, True

    monkeypatch.setattr(repertoires, "evolve_repertoire", evolve_repertoire)
    monkeypatch.setattr(repertoire, "evolve_repertoire", evolve_repertoire)
    chosen = {"speeds": ("0.2", "0.4"), "turns": (5.0,), "gait": "trot", "seed": 3}
    assert mjxgait.repertoire("duck", out="set", blends=False, quiet=True, **chosen) == tmp_path
    words = "repertoire duck --out set --speeds 0.2 0.4 --turns 5 --gait trot --seed 3 --no-blends"
    with pytest.raises(SystemExit):
        main(words.split())
    assert asked[0] == asked[1]


def test_python_and_the_command_line_ask_for_the_same_study(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    asked: list[studies.AblateRequest] = []

    def evolve_study(planned: object, request: studies.AblateRequest, output: Output) -> Path:
        asked.append(request)
        return tmp_path / "report.md"

    for place in (studies, ablate):
        monkeypatch.setattr(place, "evolve_study", evolve_study)
    found = mjxgait.ablate("null", out="x", env=str(STOOL), seeds=2, generations=1, quiet=True)
    assert found == tmp_path / "report.md"
    with pytest.raises(SystemExit):
        main(f"ablate null --out x --env {STOOL} --seeds 2 --generations 1".split())
    assert asked[0] == asked[1]
    monkeypatch.setattr(studies, "evolve_study", lambda *_: None)
    with pytest.raises(KeyboardInterrupt):
        mjxgait.ablate("null", env=str(STOOL), seeds=2, generations=1, quiet=True)


def test_quiet_output_is_logged_and_results_are_shown(
    caplog: pytest.LogCaptureFixture, capsys: pytest.CaptureFixture
):
    caplog.set_level(logging.INFO, LOG.name)
    output = Output(quiet=True)
    output.say("compiling 100%")
    output.console.print("the result")
    Output().say("loud")
    assert [record.getMessage() for record in caplog.records] == ["compiling 100%", "loud"]
    assert capsys.readouterr().out == "the result\nloud\n"


def test_the_package_is_typed():
    assert (Path(mjxgait.__file__).parent / "py.typed").is_file()
