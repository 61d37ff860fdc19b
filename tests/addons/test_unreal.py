"""The script for Unreal with a stand-in for its API: names, places and times, not Unreal itself."""

import importlib.util
import json
import sys
from pathlib import Path
from types import ModuleType
from unittest.mock import MagicMock

import pytest

SCRIPT = Path(__file__).parents[2] / "addons" / "unreal" / "mjxgait" / "import_repertoire.py"
FALLS = [
    {"foot": "fore_left", "down": 0.0, "up": 0.3},
    {"foot": "fore_right", "down": 0.25, "up": 0.6},
]
WALK = {
    "name": "walk_050_left15",
    "animation": "walk_050_left15-loop",
    "speed": 0.512,
    "turn": 15.0,
}
TABLE = {
    "schema": 1,
    "file": "repertoire.glb",
    "clips": [
        {"name": "idle", "animation": "idle", "speed": 0.0, "turn": 0.0},
        WALK | {"contacts": FALLS},
    ],
    "transitions": [
        {"name": "walk_050_straight_start", "found": True, "contacts": FALLS[:1]},
        {"name": "walk_050_straight_stop", "found": False},
    ],
}


class Sequence(MagicMock):
    """An animation sequence, of which the test sees what is set."""


@pytest.fixture
def unreal(monkeypatch: pytest.MonkeyPatch) -> MagicMock:
    """The API, in which the GLB has been imported under names with a prefix."""
    api, names = (
        MagicMock(),
        ("Anim_idle", "Anim_walk_050_left15_loop", "Anim_walk_050_straight_start"),
    )
    assets = {name: Sequence() for name in names}
    for name, asset in assets.items():
        asset.get_name.return_value = name
    api.AnimSequence = Sequence
    api.EditorAssetLibrary.list_assets.return_value = [*assets]
    api.EditorAssetLibrary.load_asset.side_effect = assets.__getitem__
    api.EditorAssetLibrary.does_asset_exist.return_value = False
    api.AnimationLibrary.get_animation_notify_track_names.return_value = []
    api.assets = assets
    monkeypatch.setitem(sys.modules, "unreal", api)
    return api


@pytest.fixture
def script(unreal: MagicMock) -> ModuleType:
    spec = importlib.util.spec_from_file_location("import_repertoire", SCRIPT)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_footfalls_become_sync_markers_and_clips_get_places(
    script: ModuleType, unreal: MagicMock, tmp_path: Path
):
    table = tmp_path / "repertoire.json"
    table.write_text(json.dumps(TABLE))
    script.import_repertoire(str(table))
    _, walk, start = unreal.assets.values()
    marks = [call.args for call in unreal.AnimationLibrary.add_animation_sync_marker.call_args_list]
    assert marks == [
        (walk, "fore_left", 0.0, "footfalls"),
        (walk, "fore_right", 0.25, "footfalls"),
        (start, "fore_left", 0.0, "footfalls"),
    ]
    start.set_editor_property.assert_called_once_with("enable_root_motion", True)
    walk.set_editor_property.assert_not_called()
    assert [call.args for call in unreal.Vector.call_args_list] == [
        (0.0, 0.0, 0.0),
        (-15.0, 51.2, 0.0),
    ]
    unreal.log_warning.assert_not_called()


def test_another_table_is_refused(script: ModuleType, tmp_path: Path):
    (tmp_path / "other.json").write_text("{}")
    with pytest.raises(ValueError, match=r"other\.json: not a repertoire"):
        script.import_repertoire(str(tmp_path / "other.json"))
