"""A character that the creature does not fit, or a damaged one: a sentence, and nothing written."""

import contextlib
import dataclasses
import json
import struct
from pathlib import Path

import numpy as np
import pygltflib as gltf
import pytest
from animation.skinned import parts, treading_loop, whole
from helpers import said_by
from importer.rigs import DOG, glb
from rendering.made_up import treading, write_run

from mjxgait.animation.export import WalkLoop, read_character
from mjxgait.animation.export.onto import build_onto
from mjxgait.creature import Creature
from mjxgait.creature.load import creature_of
from mjxgait.creature.scale import scaled
from mjxgait.errors import UserError
from mjxgait.importer import ImportChoices, import_model


@pytest.fixture(scope="module")
def dog(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, WalkLoop]:
    file = tmp_path_factory.mktemp("dog") / "dog.glb"
    file.write_bytes(glb())
    return file, treading_loop(creature_of(import_model(file, ImportChoices(apart=False)).files))


def refused(loop: WalkLoop, file: Path) -> str:
    with pytest.raises(UserError) as raised:
        build_onto({"walk-loop": loop}, read_character(file))
    assert "\n" not in str(raised.value)
    return str(raised.value)


def test_another_character_is_refused_in_one_sentence(dog: tuple[Path, WalkLoop], tmp_path: Path):
    file, loop = dog
    other = tmp_path / "other.glb"
    hands = ("LeftHand", "RightHand")
    arms = {f"{side}Forearm": DOG[f"{side}Forearm"] for side in ("Left", "Right")}
    ended = {name: (*bone[:2], (bone[1][0], 2, 12)) for name, bone in arms.items()}
    less = {name: bone for name, bone in (DOG | ended).items() if name not in hands}
    other.write_bytes(glb(less))
    said = refused(loop, other)
    assert f'{other}: lacks bones of which dog was made: "LeftHand", "RightHand"' in said
    assert "(dog.glb)" in said
    other.write_bytes(file.read_bytes().replace(b'"RightHand"', b'"LeftHand" '))
    assert 'lacks bones of which dog was made: "RightHand"' in refused(loop, other)
    longer = {**DOG, "Head": ("Neck", (0.0, 90.0, 60.0), (0.0, 88.0, 76.0))}
    other.write_bytes(glb(longer))
    assert '"Head"' in refused(loop, other)
    assert "of the hip height off the parts of dog" in refused(loop, other)
    other.write_bytes(b"solid cube " * 9)
    with pytest.raises(UserError, match="not a GLB file"):
        read_character(other)


def test_bones_of_one_name_are_refused(dog: tuple[Path, WalkLoop], tmp_path: Path):
    file, loop = dog
    description, blob = parts(file.read_bytes())
    next(n for n in description["nodes"] if n["name"] == "ik_target")["name"] = "Tail"
    other = tmp_path / "twice.glb"
    other.write_bytes(whole(description, blob))
    assert 'has several bones called "Tail"' in refused(loop, other)


def test_a_bone_below_an_uneven_scale_is_refused(dog: tuple[Path, WalkLoop], tmp_path: Path):
    file, loop = dog
    description, blob = parts(file.read_bytes())
    for name, wide in (("Armature", [0.01, 0.01, 0.0101]), ("Spine", [1.0, 1.0, 1.001])):
        changed = json.loads(json.dumps(description))
        next(n for n in changed["nodes"] if n["name"] == name)["scale"] = wide
        other = tmp_path / "uneven.glb"
        other.write_bytes(whole(changed, blob))
        assert "apply its scale" in refused(loop, other)


def test_a_body_that_no_file_has_is_refused(dog: tuple[Path, WalkLoop], stool: Creature):
    file, loop = dog
    creature = loop.walk.creature

    def of(other: Creature) -> WalkLoop:
        return dataclasses.replace(loop, walk=dataclasses.replace(loop.walk, creature=other))

    assert "was not made of a character's skeleton" in refused(of(stool), file)
    text = creature.files["creature.toml"]
    rig, after, step, end = (
        text.index(f"[{table}]") for table in ("rig", "steering", "stepping", "termination")
    )
    old = text[:rig] + text[after:step] + text[end:]  # it had none of these tables
    earlier = creature_of({**creature.files, "creature.toml": old})
    assert "import the character again" in refused(of(earlier), file)
    longer = scaled(creature, {"LeftShin": 1.5, "RightShin": 1.5})
    assert "of the hip height off the parts" in refused(of(longer), file)
    wrong = text.replace('"Tail" = "Tail"', '"Tall" = "Tail"')
    with pytest.raises(UserError, match=r'rig\.bones = "Tall" is not in creature\.xml'):
        creature_of({**creature.files, "creature.toml": wrong})


def test_the_command_writes_beside_the_character_and_never_over_it(
    dog: tuple[Path, WalkLoop], tmp_path: Path, capsys: pytest.CaptureFixture
):
    file, loop = dog
    creature, data = loop.walk.creature, file.read_bytes()
    run = write_run(tmp_path / "run", creature, treading(creature, degrees=6.0))
    out = tmp_path / "walk.glb"
    said = said_by(capsys, "export", run, "--onto", file, "--out", out, "--travelling", code=0)
    assert 'animation "walk-loop", 1 stride' in said
    (animation,) = gltf.GLTF2.load_from_bytes(out.read_bytes()).animations
    assert animation.extras["travelling"]
    said = said_by(capsys, "export", run, "--onto", file, "--out", file, code=2)
    assert "is your character" in said
    bvh_too = tmp_path / "walk.bvh"
    assert "end the name with .glb" in said_by(
        capsys, "export", run, "--onto", file, "--out", bvh_too, code=2
    )
    nowhere = tmp_path / "none.glb"
    assert "no such file" in said_by(
        capsys, "export", run, "--onto", nowhere, "--out", tmp_path / "x.glb", code=2
    )
    assert file.read_bytes() == data
    assert not bvh_too.exists()


def test_whatever_happens_to_a_character_on_its_way_there_is_no_traceback(
    dog: tuple[Path, WalkLoop], tmp_path: Path
):
    """Cut off anywhere, or with bytes of its description changed: a sentence, or a file."""
    file, loop = dog
    data, rng, sentences = file.read_bytes(), np.random.default_rng(3), []
    head, other = struct.unpack_from("<I", data, 12)[0], tmp_path / "dog.glb"
    for case in range(100):
        bad = bytearray(data[: rng.integers(1, len(data))] if case % 8 == 3 else data)
        for place in rng.integers(20, 20 + head, 1 + case % 4):
            if place < len(bad):
                bad[place] = rng.choice([*b"0123456789-.e,"]) if case % 2 else rng.integers(32, 127)
        other.write_bytes(bytes(bad))
        with contextlib.suppress(UserError):
            try:
                build_onto({"walk-loop": loop}, read_character(other))
            except UserError as error:
                sentences.append(str(error))
                raise
    assert len(sentences) > 20
    assert not any("\n" in sentence for sentence in sentences)
