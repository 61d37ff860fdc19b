"""An import never loses a mass in silence, and never a file that somebody may miss."""

from pathlib import Path

import pytest
from importer.models import BIPED, QUADRUPED

from mjxgait.cli import main
from mjxgait.errors import UserError
from mjxgait.importer import ImportChoices, import_model

TRUNK = '<freejoint/><geom type="box" size=".2 .1 .04" mass="1.5"/>{shape}'
LEG = (
    '<body pos="{x} {y} 0"><joint axis="0 1 0" range="-60 60"/>'
    '<geom type="capsule" fromto="0 0 0 0 0 -.2" size=".02" mass=".2"/></body>'
)
LEGS = "".join(LEG.format(x=x, y=y) for x in (-0.18, 0.18) for y in (-0.1, 0.1))
SHELL = '<geom name="shell" type="mesh" mesh="hull" {mass}/>'


def table(trunk: str, beside: str = "", head: str = "") -> str:
    """A table on four hinged legs."""
    return (
        f'<mujoco>{head}<asset><mesh name="hull" file="hull.stl"/></asset><worldbody>'
        f'<body name="trunk" pos="0 0 .3">{trunk}{LEGS}</body>{beside}</worldbody></mujoco>'
    )


def bring(folder: Path, text: str) -> str:
    """What the import tells."""
    file = folder / "model.xml"
    file.write_text(text, encoding="utf-8")
    return import_model(file, ImportChoices(apart=False)).notes.text()


@pytest.mark.parametrize(
    ("shape", "head", "told"),
    [
        (
            'mass="4"',
            "",
            '"shell" of body "trunk" has 4 kg, and its mesh "hull.stl" cannot be read',
        ),
        ("", "", "a mass that only its mesh states"),
        ('group="3"', '<compiler inertiagrouprange="3 4"/>', "a mass that only its mesh states"),
    ],
)
def test_a_mass_in_a_mesh_that_is_missing_is_no_mass_to_lose(tmp_path, shape, head, told):
    with pytest.raises(UserError, match="--search") as raised:
        bring(tmp_path, table(TRUNK.format(shape=SHELL.format(mass=shape)), head=head))
    assert told in str(raised.value)


@pytest.mark.parametrize(
    ("shape", "head"),
    [
        ('mass="0"', ""),
        ('class="seen"', '<default><default class="seen"><geom density="0"/></default></default>'),
        ('group="3"', '<compiler inertiagrouprange="0 2"/>'),
    ],
)
def test_what_weighs_nothing_may_be_missing(tmp_path, shape, head):
    told = bring(tmp_path, table(TRUNK.format(shape=SHELL.format(mass=shape)), head=head))
    assert 'mesh "hull.stl" dropped' in told


def test_a_stated_mass_needs_no_mesh(tmp_path):
    stated = '<inertial pos="0 0 0" mass="5" diaginertia=".1 .1 .1"/>'
    trunk = TRUNK.format(shape=stated + SHELL.format(mass='mass="4"'))
    assert 'mesh "hull.stl" dropped' in bring(tmp_path, table(trunk))


def test_a_link_that_only_its_mesh_gives_a_mass_is_refused(tmp_path):
    file = tmp_path / "robot.urdf"
    file.write_text(
        '<robot name="r"><link name="base"><collision><geometry><mesh filename="hull.stl"/>'
        "</geometry></collision></link></robot>"
    )
    with pytest.raises(UserError, match='body "base" has a mass that only its mesh states'):
        import_model(file, ImportChoices(apart=False))


def test_a_link_of_a_urdf_that_states_no_mass_may_miss_its_mesh(tmp_path):
    mesh = '<collision><geometry><mesh filename="hull.stl"/></geometry></collision>'
    weightless = f'<inertial><mass value="0"/></inertial>{mesh}'
    file = tmp_path / "robot.urdf"
    file.write_text(
        BIPED.replace(
            "</robot>",
            f'<link name="nail">{weightless}</link><joint name="n" type="fixed">'
            '<parent link="left_thigh"/><child link="nail"/></joint></robot>',
        )
    )
    import_model(file, ImportChoices(apart=False))


def test_who_else_is_in_the_file_is_told_with_its_weight(tmp_path):
    crate = '<body name="crate" pos="2 0 .1"><freejoint/><geom size=".1" mass="2"/></body>'
    pup = crate.replace("crate", "pup").replace("<freejoint/>", "<freejoint/>" + LEGS)
    trunk = TRUNK.format(shape="")
    told = bring(tmp_path, table(trunk, crate + pup.replace("pos=", 'euler="0 0 1" pos=')))
    assert 'body "crate" (2 kg)' in told
    assert "a creature of its own" in told


def test_who_lies_on_the_floor_has_no_legs(tmp_path):
    part = '<geom type="capsule" fromto="0 0 0 -.15 0 0" size=".03" mass=".3"/>'
    link = f'<body pos="-.16 0 0"><joint axis="0 0 1" range="-60 60"/>{part}'
    snake = f'<body name="head" pos="0 0 .05"><freejoint/>{part}{link * 6}{"</body>" * 7}'
    with pytest.raises(UserError, match='"head" lies on the floor'):
        bring(tmp_path, f"<mujoco><worldbody>{snake}</worldbody></mujoco>")


@pytest.fixture
def made(tmp_path: Path) -> Path:
    """A model in one folder, and the creature that was imported from it in another."""
    (tmp_path / "home").mkdir()
    (tmp_path / "home" / "model.xml").write_text(QUADRUPED, encoding="utf-8")
    assert brought(tmp_path, "mine") == 0
    return tmp_path


def brought(folder: Path, out: str, *more: str, model: str = "model.xml") -> int:
    """The exit code of an import into a folder."""
    model, out = str(folder / "home" / model), str(folder / out)
    with pytest.raises(SystemExit) as ended:
        main(["import", model, "--out", out, *more])
    return int(ended.value.code)


def test_an_import_writes_over_nothing_that_somebody_may_miss(made: Path, capsys):
    home, mine, notes = (made / name for name in ("home", "mine", "notes"))
    (home / "creature.xml").write_text(QUADRUPED, encoding="utf-8")
    notes.mkdir()
    (notes / "README.md").write_text("my own notes")
    (mine / "creature.toml").write_text("# edited by hand")
    before = {file: file.read_bytes() for file in made.rglob("*") if file.is_file()}
    for arguments, told in (
        (("mine",), "--force"),
        (("notes",), "holds something else"),
        (("notes", "--force"), "holds something else"),
        (("home",), "reads from this folder"),
        (("home", "--force"), "reads from this folder"),
        (("notes", "--force", "--search", str(notes)), "reads from this folder"),
        (("home/model.xml", "--force"), "holds something else"),
    ):
        assert brought(made, *arguments, model="creature.xml") == 2
        assert told in capsys.readouterr().err
    assert before == {file: file.read_bytes() for file in made.rglob("*") if file.is_file()}
    assert brought(made, "mine", "--force") == 0
    assert "edited by hand" not in (mine / "creature.toml").read_text()
