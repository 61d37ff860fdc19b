"""`export` finds the character of a run: the file that was imported, by its place and its bytes."""

from pathlib import Path

import pygltflib as gltf
import pytest
from animation.skinned import parts, whole
from helpers import said_by
from importer.rigs import DOG, bvh, glb
from rendering.made_up import treading, write_run

import mjxgait
from mjxgait.creature import Creature, load_creature
from mjxgait.creature.load import creature_of
from mjxgait.creature.scale import scaled
from mjxgait.importer import ImportChoices, import_model

CAPSULES = "shows the body of capsules"


@pytest.fixture(scope="module")
def first(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, str]]:
    """A project folder, and the files of the creature imported from the character in it."""
    folder = tmp_path_factory.mktemp("project")
    file = folder / "dog.glb"
    file.write_bytes(glb())
    return folder, import_model(file, ImportChoices(apart=False)).files


@pytest.fixture
def project(
    first: tuple[Path, dict[str, str]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Path:
    """A project with its character, and the run `runs/dog` of a creature imported from there."""
    folder, files = first
    file = tmp_path / "dog.glb"
    file.write_bytes(glb())
    files = {name: text.replace(str(folder), str(tmp_path)) for name, text in files.items()}
    write_walk(tmp_path / "runs" / "dog", creature_of(files))
    (tmp_path / "empty").mkdir()
    monkeypatch.chdir(tmp_path / "empty")
    return tmp_path


def write_walk(folder: Path, creature: Creature) -> Path:
    folder.parent.mkdir(parents=True, exist_ok=True)
    return write_run(folder, creature, treading(creature, degrees=6.0))


def exported(folder: Path, onto: str | None = None) -> tuple[gltf.GLTF2, list[str]]:
    told: list[str] = []
    out = folder / "walk.glb"
    mjxgait.export(folder / "runs" / "dog", out, onto=onto, tell=told.append)
    return gltf.GLTF2.load_from_bytes(out.read_bytes()), told


def is_character(document: gltf.GLTF2) -> bool:
    return "ik_target" in {node.name for node in document.nodes}


def test_the_walk_is_put_onto_the_file_that_was_imported(
    project: Path, capsys: pytest.CaptureFixture
):
    run, out, same = project / "runs" / "dog", project / "a.glb", project / "b.glb"
    said = said_by(capsys, "export", run, "--out", out, code=0)
    assert f"{out}: on your character {project / 'dog.glb'}; --onto none writes the body" in said
    assert 'animation "walk-loop", 1 stride' in said
    said_by(capsys, "export", run, "--out", same, "--onto", project / "dog.glb", code=0)
    assert out.read_bytes() == same.read_bytes()
    said = said_by(capsys, "export", run, "--out", out, "--onto", "none", code=0)
    assert "character" not in said
    assert not is_character(gltf.GLTF2.load_from_bytes(out.read_bytes()))
    assert (project / "dog.glb").read_bytes() == glb()


def test_the_character_is_never_written_over(project: Path, capsys: pytest.CaptureFixture):
    run, file = project / "runs" / "dog", project / "dog.glb"
    for more in ((), ("--onto", "none")):
        said = said_by(capsys, "export", run, "--out", file, *more, code=2)
        assert "is your character, which stays; name another file with --out" in said
    assert file.read_bytes() == glb()


def test_a_project_that_moved_has_its_character_still(project: Path):
    """In a folder that holds the run."""
    moved = project.rename(project.with_name(f"{project.name}-moved"))
    document, told = exported(moved)
    assert is_character(document)
    assert str(moved / "dog.glb") in told[1]
    (moved / "dog.glb").write_bytes(glb(soles=True))  # another file of that name is not it
    document, told = exported(moved)
    assert not is_character(document)
    assert f"because {project / 'dog.glb'}, from which dog was imported, is not there" in told[1]


def test_without_the_file_it_is_the_body_of_capsules_and_a_sentence(project: Path):
    (project / "dog.glb").unlink()
    document, told = exported(project)
    assert not is_character(document)
    assert told[1] == (
        f"{project / 'walk.glb'}: {CAPSULES}, because {project / 'dog.glb'}, from which dog was "
        "imported, is not there; name the file with --onto"
    )


def test_a_character_that_was_repainted_is_taken_as_it_is_now(project: Path):
    description, blob = parts(glb())
    description["materials"] = [{"name": "new fur"}]
    (project / "dog.glb").write_bytes(whole(description, blob))
    document, told = exported(project)
    assert [material.name for material in document.materials] == ["new fur"]
    assert told[2] == f"{project / 'dog.glb'} is not as it was when dog was imported from it"


def test_a_character_with_other_bones_is_left_and_named(project: Path):
    longer = {**DOG, "Head": ("Neck", (0.0, 90.0, 60.0), (0.0, 88.0, 76.0))}
    (project / "dog.glb").write_bytes(glb(longer))
    document, told = exported(project)
    assert not is_character(document)
    assert told[1].startswith(f"{project / 'walk.glb'}: {CAPSULES}, because {project / 'dog.glb'}")
    assert "of the hip height off the parts of dog" in told[1]
    (project / "dog.glb").write_bytes(b"glTF is no more")
    _, told = exported(project)
    assert "not a GLB file" in told[1]


def test_a_scaled_creature_is_no_longer_its_character(project: Path):
    creature = load_creature(project / "runs" / "dog" / "creature")
    write_walk(project / "other" / "runs" / "dog", scaled(creature, {"*Shin": 1.3}))
    document, told = exported(project / "other")
    assert not is_character(document)
    assert "of the hip height off the parts" in told[1]


def test_a_run_of_an_earlier_version_loads_and_names_the_option(project: Path):
    (project / "runs" / "dog" / "creature" / "character.toml").unlink()
    document, told = exported(project)
    assert not is_character(document)
    assert told[1].endswith(f"{CAPSULES}; --onto dog.glb puts the walk onto your character")


@pytest.mark.parametrize("text", ["path = 3", "path = [", 'path = "\\u0000"\nsha256 = ""', "x = 1"])
def test_a_damaged_note_of_the_file_is_one_sentence(project: Path, text: str):
    (project / "runs" / "dog" / "creature" / "character.toml").write_text(text)
    with pytest.raises(mjxgait.UserError, match=r"character\.toml") as raised:
        exported(project)
    assert "\n" not in str(raised.value)


def test_where_the_file_lies_changes_no_creature(
    first: tuple[Path, dict[str, str]], tmp_path: Path
):
    """So runs of one character can go on from each other, on any machine."""
    _, files = first
    other = tmp_path / "dog.glb"
    other.write_bytes(glb())
    again = import_model(other, ImportChoices(apart=False)).files
    assert again["character.toml"] != files["character.toml"]
    assert creature_of(again).digest == creature_of(files).digest
    plain = {name: text for name, text in files.items() if name != "character.toml"}
    assert creature_of(plain).digest == creature_of(files).digest
    skeleton = tmp_path / "dog.bvh"
    skeleton.write_text(bvh())
    assert "character.toml" not in import_model(skeleton, ImportChoices(apart=False)).files
