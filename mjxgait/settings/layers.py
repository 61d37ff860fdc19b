"""How the layers of settings are laid over each other."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from mjxgait.errors import UserError, did_you_mean
from mjxgait.settings.config import Config
from mjxgait.settings.shipped import data_folder, shipped_creatures
from mjxgait.settings.tables import build, merge, read_toml


def resolve_config(
    creature_table: Mapping[str, Any], creature_name: str, file: Path | None = None
) -> Config:
    """The layers, each over the one before: `configs/default.toml`, the creature's `[train]`, the user's file.

    A file may begin with `standalone = true`: then nothing but the built-in defaults lies under it.
    Its tables `[creature.NAME]` hold keys for the creature of that name, laid over the rest of it.

    Raises:
      UserError: names the layer and the key.
    """
    default = data_folder("configs") / "default.toml"
    standalone, mine = _file_layers(file, creature_name) if file is not None else (False, [])
    layers: list[tuple[str, Mapping[str, Any]]] = []
    if not standalone:
        layers.append((str(default), read_toml(default)))
        layers.append((f"{creature_name}/creature.toml: [train]", creature_table))
    table: dict[str, Any] = {}
    for where, layer in (*layers, *mine):
        table = merge(table, layer)
        build(Config, table, where)
    return build(Config, table, "the settings taken together")


def _file_layers(
    file: Path, creature_name: str
) -> tuple[bool, list[tuple[str, Mapping[str, Any]]]]:
    """Whether a user's file stands alone, and its layers: what it says to all, then to this creature.

    The tables of other creatures are checked too: a mistake shows whoever is trained.
    """
    path = _find_config(file)
    general = read_toml(path)
    standalone, creatures = general.pop("standalone", False), general.pop("creature", {})
    if not isinstance(standalone, bool):
        raise UserError(f"{path}: standalone = {standalone!r}: give true or false")
    if not isinstance(creatures, Mapping):
        raise UserError(f"{path}: creature = {creatures!r}: give tables such as [creature.crab]")
    known = {creature_name, *shipped_creatures()}
    for name, own in creatures.items():
        if name not in known:
            raise UserError(
                f'{path}: creature.{name}: "{name}" is neither the creature at hand nor a shipped'
                f" one; {did_you_mean(name, sorted(known))}"
            )
        if not isinstance(own, Mapping):
            raise UserError(f"{path}: creature.{name} = {own!r}: give a table of config keys")
        build(Config, own, f"{path}: [creature.{name}]")
    mine = creatures.get(creature_name, {})
    return standalone, [(str(path), general), (f"{path}: [creature.{creature_name}]", mine)]


def _find_config(file: Path) -> Path:
    shipped = data_folder("configs") / f"{file}.toml"
    if not file.exists() and shipped.exists():
        return shipped
    if not file.exists():
        known = [path.stem for path in data_folder("configs").glob("*.toml")]
        raise UserError(
            f"{file}: no such file and no shipped config of that name; {did_you_mean(str(file), known)}"
        )
    return file
