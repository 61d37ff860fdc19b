"""UNTRIED: no Unreal Engine has run this script; it follows the manual of its Python API (5.4).

Imports a repertoire of mjxgait into Unreal: its clips, a Blend Space by turn and speed, and sync
markers and notifies at footfalls. In the editor, with the plugins Python Editor Script and
Interchange, run in the Output Log (Python):

    from mjxgait.import_repertoire import import_repertoire
    import_repertoire("C:/my_game/repertoire.json")

Unreal turns to the right as the yaw grows and counts in cm, so a clip's place in the Blend Space is
(-turn in deg/s, 100 * speed in cm/s). Assets that exist already are left as they are.
"""

import json
import re
from pathlib import Path
from typing import Any

import unreal  # type: ignore[import-not-found]

SCHEMA = 1
CM = 100.0
TRACK = "footfalls"
"""Name of the notify track."""
SPACE = "BS_repertoire"


def import_repertoire(table: str, into: str = "/Game/mjxgait") -> None:
    """Import the clips of a table, `repertoire.json`, and the GLB beside it.

    into: folder of the project's content. Raises ValueError if the table cannot be used.
    """
    document = read_table(Path(table))
    sequences = imported(Path(table).with_name(document["file"]), into)
    found = [entry for entry in document["transitions"] if entry["found"]]
    for entry in [*document["clips"], *found]:
        animation = entry.get("animation", entry["name"])
        sequence = sequences.get(plain(animation))
        if sequence is None:
            unreal.log_warning(f"{document['file']}: no sequence for {animation}")
            continue
        mark(sequence, entry.get("contacts", []))
        if entry in found:
            sequence.set_editor_property("enable_root_motion", True)
    build_space(document["clips"], sequences, into)


def read_table(path: Path) -> dict[str, Any]:
    """Return a table.

    Raises:
      ValueError: it is none, or of another version.
    """
    document = json.loads(path.read_text(encoding="utf-8"))
    if not isinstance(document, dict) or document.get("schema") != SCHEMA:
        raise ValueError(f"{path}: not a repertoire.json that this script reads")
    return document


def imported(file: Path, into: str) -> dict[str, Any]:
    """Import a GLB; return the animation sequences of the folder by the end of their names."""
    task = unreal.AssetImportTask()
    task.filename, task.destination_path = str(file), into
    task.automated, task.replace_existing, task.save = True, False, True
    unreal.AssetToolsHelpers.get_asset_tools().import_asset_tasks([task])
    paths = unreal.EditorAssetLibrary.list_assets(into, recursive=True)
    assets = [unreal.EditorAssetLibrary.load_asset(path) for path in paths]
    return {
        plain(str(asset.get_name())): asset
        for asset in assets
        if isinstance(asset, unreal.AnimSequence)
    }


def plain(name: str) -> str:
    """Return a name as the importer may write it: without its prefix, in letters of one kind."""
    word = re.sub(r"\W", "_", name).lower()
    return re.sub(r"^.*?(?=walk_\d|idle)", "", word)


def mark(sequence: Any, contacts: list[dict[str, Any]]) -> None:
    """Add a sync marker and a notify with the foot's name at each footfall."""
    library = unreal.AnimationLibrary
    if TRACK in [str(name) for name in library.get_animation_notify_track_names(sequence)]:
        return
    library.add_animation_notify_track(sequence, TRACK)
    for fall in contacts:
        library.add_animation_sync_marker(sequence, fall["foot"], fall["down"], TRACK)
        library.add_animation_notify_event(sequence, TRACK, fall["down"], unreal.AnimNotify)


def build_space(clips: list[dict[str, Any]], sequences: dict[str, Any], into: str) -> None:
    """Make the Blend Space of all clips; log their places if this Unreal does not let a script."""
    places = {
        plain(clip["animation"]): (-clip["turn"], CM * clip["speed"])
        for clip in clips
        if plain(clip["animation"]) in sequences
    }
    if not places or unreal.EditorAssetLibrary.does_asset_exist(f"{into}/{SPACE}"):
        return
    factory = unreal.BlendSpaceFactoryNew()
    first = sequences[next(iter(places))]
    factory.set_editor_property("target_skeleton", first.get_editor_property("skeleton"))
    tools = unreal.AssetToolsHelpers.get_asset_tools()
    space = tools.create_asset(SPACE, into, unreal.BlendSpace, factory)
    try:
        space.set_editor_property("blend_parameters", axes(list(places.values())))
        samples = [_sample(sequences[name], *place) for name, place in places.items()]
        space.set_editor_property("sample_data", samples)
    except Exception as error:  # the kinds of errors of the API are not documented
        by_hand = "; ".join(f"{name} at {x:g}, {y:g}" for name, (x, y) in places.items())
        unreal.log_warning(f"{SPACE}: place the sequences by hand ({error}): {by_hand}")
    unreal.EditorAssetLibrary.save_loaded_asset(space)


def axes(places: list[tuple[float, float]]) -> list[Any]:
    """Return the axes of the Blend Space, as far as the clips reach."""
    made = []
    for number, name in enumerate(("turn", "speed")):
        values = [place[number] for place in places]
        axis = unreal.BlendParameter()
        axis.set_editor_property("display_name", name)
        axis.set_editor_property("min", min(values))
        axis.set_editor_property("max", max(max(values), min(values) + 1.0))
        made.append(axis)
    return made


def _sample(sequence: Any, turn: float, speed: float) -> Any:
    sample = unreal.BlendSample()
    sample.set_editor_property("animation", sequence)
    sample.set_editor_property("sample_value", unreal.Vector(turn, speed, 0.0))
    return sample
