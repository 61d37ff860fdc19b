"""Robots by name and xacro templates: fakes stand for the packages, the network and git."""

import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType, SimpleNamespace

import pytest
from importer.models import QUADRUPED

from mjxgait.api import load_creature
from mjxgait.errors import UserError
from mjxgait.extras import install_command
from mjxgait.importer import ImportChoices, import_model
from mjxgait.importer.robots import find_robot, robot_name
from mjxgait.importer.xacro import expanded

OFFLINE = """
class GitCommandError(Exception):
    stderr = "\\n  stderr: 'fatal: unable to access 'x': Could not resolve host'"

raise GitCommandError("git clone failed")
"""
"""A description without a network, as GitPython fails."""


def about(maker: str, mjcf: bool = False, urdf: bool = False) -> SimpleNamespace:
    return SimpleNamespace(maker=maker, has_mjcf=mjcf, has_urdf=urdf)


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A package with four robots; go2's files are in the returned folder, spot's are not here."""
    (tmp_path / "go2.xml").write_text(QUADRUPED)
    (tmp_path / "go2.urdf").write_text("<robot/>")
    folders = f"PACKAGE_PATH = REPOSITORY_PATH = {str(tmp_path)!r}\n"
    code = tmp_path / "robot_descriptions"
    code.mkdir()
    known = {
        "go2_mj_description": about("Unitree", mjcf=True),
        "go2_description": about("Unitree", urdf=True),
        "spot_description": about("Boston Dynamics", urdf=True),
        "h1_srdf_description": about("Unitree"),
    }
    for name, file, key in (("go2_mj", "go2.xml", "MJCF"), ("go2", "go2.urdf", "URDF")):
        text = f"{folders}{key}_PATH = {str(tmp_path / file)!r}\n"
        (code / f"{name}_description.py").write_text(text)
    (code / "spot_description.py").write_text(OFFLINE)
    made = ModuleType("robot_descriptions")
    made.DESCRIPTIONS, made.__path__ = known, [str(code)]
    for name in [n for n in sys.modules if n.startswith("robot_descriptions")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "robot_descriptions", made)
    yield tmp_path
    for name in [n for n in sys.modules if n.startswith("robot_descriptions.")]:
        del sys.modules[name]


def test_only_words_after_robot_are_names():
    assert robot_name("robot:go2") == robot_name(Path("robot:go2")) == "go2"
    assert robot_name("robot.urdf") is None


def test_mjcf_is_preferred_and_urdf_taken_where_it_is_named(package: Path):
    assert find_robot("go2").file == find_robot("GO2").file == package / "go2.xml"
    assert find_robot("go2-description").file == package / "go2.urdf"
    assert find_robot("go2").search == (package, package)


def test_a_robot_is_imported_under_its_name(package: Path):
    imported = import_model(Path("robot:go2"), ImportChoices(apart=False))
    assert imported.name == "go2"
    assert "feet" in imported.files["creature.toml"]


def test_unknown_names_list_those_near_them(package: Path):
    with pytest.raises(UserError, match=r"robot:go3: no robot has this name; near it: go2;"):
        find_robot("go3")
    with pytest.raises(UserError, match="near it: spot"):
        find_robot("boston")
    # Neither MJCF nor URDF.
    with pytest.raises(UserError, match="no robot has this name"):
        find_robot("h1_srdf")


def test_without_a_network_one_sentence_says_so(package: Path):
    with pytest.raises(UserError) as said:
        load_creature("robot:spot")
    assert str(said.value) == (
        "robot:spot: its model cannot be downloaded (fatal: unable to access 'x': Could not "
        "resolve host); that takes git and a network the first time; or give the path of a model "
        "file"
    )


def test_without_the_package_one_sentence_names_the_extra(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setitem(sys.modules, "robot_descriptions", None)
    with pytest.raises(UserError) as said:
        find_robot("go2")
    assert str(said.value) == f"robot:go2 needs an extra: {install_command('robots')}"


TEMPLATE = """<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">
<xacro:include filename="{included}"/>
<xacro:property name="side" value="left"/>
<link name="${{side}}_leg"/>
<link name="b"><visual><geometry><mesh filename="package://r/b.stl"/></geometry></visual></link>
</robot>"""
INCLUDED = '<robot><link name="trunk"/></robot>'


def test_a_template_is_expanded_from_its_own_folder(tmp_path: Path):
    pytest.importorskip("xacrodoc")
    (tmp_path / "parts.xacro").write_text(INCLUDED)
    file = tmp_path / "r.urdf.xacro"
    file.write_text(TEMPLATE.format(included="parts.xacro"))
    urdf = expanded(file, [tmp_path]).decode()
    assert all(name in urdf for name in ('"trunk"', '"left_leg"', '"package://r/b.stl"'))
    assert "xacro" not in urdf


def test_a_template_that_fails_is_one_sentence(tmp_path: Path):
    pytest.importorskip("xacrodoc")
    file = tmp_path / "r.xacro"
    file.write_text(TEMPLATE.format(included="missing.xacro"))
    with pytest.raises(UserError, match=r"r\.xacro: .*missing\.xacro") as said:
        import_model(file)
    assert "\n" not in str(said.value)


def fake_xacrodoc(urdf: str, folders: list[object]) -> SimpleNamespace:
    document = SimpleNamespace(to_urdf_string=lambda: urdf)
    packages = SimpleNamespace(walk_up_from=folders.append, look_in=folders.extend)
    read = SimpleNamespace(from_string=lambda text, **choices: document)
    return SimpleNamespace(XacroDoc=read, packages=packages)


def test_what_a_template_becomes_is_read_as_any_untrusted_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    file, folders = tmp_path / "r.xacro", []
    file.write_text("<robot/>")
    bomb = '<!DOCTYPE robot [<!ENTITY a "b">]><robot/>'
    monkeypatch.setitem(sys.modules, "xacrodoc", fake_xacrodoc(bomb, folders))
    with pytest.raises(UserError, match="document type"):
        import_model(file, ImportChoices(search=(tmp_path,)))
    assert folders == [file.resolve(), str(tmp_path.resolve())]


def test_a_template_without_the_extra_is_one_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    file = tmp_path / "r.xacro"
    file.write_text("<robot/>")
    monkeypatch.setitem(sys.modules, "xacrodoc", None)
    with pytest.raises(UserError, match="a xacro template needs an extra") as said:
        import_model(file)
    assert install_command("robots") in str(said.value)
