"""How the layers of settings are laid over each other."""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from mjxgait.errors import UserError, did_you_mean
from mjxgait.settings.config import Config, UseConfig
from mjxgait.settings.shipped import data_folder, shipped_configs, shipped_creatures
from mjxgait.settings.tables import build, merge, read_toml


def resolve_config(
    creature_table: Mapping[str, Any],
    creature_name: str,
    file: Path | None = None,
    use: Mapping[str, str] | None = None,
    config_class: Callable[[UseConfig], type[Config]] = lambda use: Config,
    meant: Callable[[UseConfig], UseConfig] = lambda use: use,
) -> Config:
    """The layers, each over the one before: `configs/default.toml`, the creature's `[train]`, the user's file.

    A file may begin with `standalone = true`: then nothing but the built-in defaults lies under it.
    A file or `[train]` may name a `base`, see `over_base`.
    Its tables `[creature.NAME]` hold keys for the creature of that name, laid over the rest of it.
    What the first two say to a controller or a task that takes no part is left out. The creature's
    tables `[train.task.NAME]` hold keys for the task of that name, laid over the rest of it, and
    over the table of the task that `like` names.

    Args:
      use: who takes part, over what the layers say. config_class: the settings of those.
      meant: who takes part, by other names than those given.

    Raises:
      UserError: names the layer and the key.
    """
    default = data_folder("configs") / "default.toml"
    standalone, mine = _file_layers(file, creature_name) if file is not None else (False, [])
    given: list[tuple[str, Mapping[str, Any]]] = []
    own = f"{creature_name}/creature.toml: [train]"
    general, of_tasks = over_base(creature_table, own), creature_table.get("task", {})
    general.pop("task", None)
    if not standalone:
        given.append((str(default), read_toml(default)))
        given.append((own, general))
    chosen = meant(_chosen([*given, *mine], use or {}))
    if not standalone and chosen.task in of_tasks:
        tables = _tables_of(of_tasks, chosen.task, f"{creature_name}/creature.toml")
        given += [(w, {**table, "use": dataclasses.asdict(chosen)}) for w, table in tables]
    cls = config_class(chosen)
    table: dict[str, Any] = {}
    for where, layer in [
        *((w, _without_absent(given_one, chosen, meant)) for w, given_one in given),
        *mine,
    ]:
        table = merge(table, layer)
        build(cls, table, where)
    table = merge(table, {"use": dataclasses.asdict(chosen)})
    return build(cls, table, "the settings taken together")


def over_base(table: Mapping[str, Any], where: str) -> dict[str, Any]:
    """A table of settings laid over the shipped config that its key `base` names, if it has one.

    Raises:
      UserError: there is no such config.
    """
    rest = dict(table)
    base = rest.pop("base", None)
    if base is None:
        return rest
    known = shipped_configs()
    if base not in known:
        raise UserError(f"{where}: base = {base!r}: {did_you_mean(str(base), known)}")
    under = data_folder("configs") / f"{base}.toml"
    return merge(over_base(read_toml(under), str(under)), rest)


def _tables_of(
    tables: Mapping[str, Any], task: str, where: str
) -> list[tuple[str, dict[str, Any]]]:
    """The layers of a task: its table, over that of the one which its key `like` names, if any.

    Raises:
      UserError: there is no such table, or it is none.
    """
    place = f"{where}: [train.task.{task}]"
    if not isinstance(tables[task], Mapping):
        raise UserError(f"{place} = {tables[task]!r}: give a table")
    own = dict(tables[task])
    like = own.pop("like", None)
    if like is None:
        return [(place, own)]
    others = {name: table for name, table in tables.items() if name != task}
    if like not in list(others):
        raise UserError(f"{place}: like = {like!r}: {did_you_mean(str(like), list(others))}")
    return [*_tables_of(others, like, where), (place, own)]


def _chosen(layers: Sequence[tuple[str, Mapping[str, Any]]], use: Mapping[str, str]) -> UseConfig:
    table: dict[str, Any] = {}
    for where, layer in layers:
        given = layer.get("use", {})
        if not isinstance(given, Mapping):
            raise UserError(f"{where}: use = {given!r}: give a table such as [use]")
        table = merge(table, given)
        build(UseConfig, table, f"{where}: [use]")
    return build(UseConfig, merge(table, use), "the options")


def _without_absent(
    layer: Mapping[str, Any], use: UseConfig, meant: Callable[[UseConfig], UseConfig]
) -> dict[str, Any]:
    """A layer without what it says to a controller or a task that takes no part.

    It was written for those that it names itself, and else for those of the default.
    """
    written = meant(build(UseConfig, layer.get("use", {}), "[use]"))
    absent = {
        "controller": use.controller != written.controller,
        "fitness": use.task != written.task,
    }
    return {key: value for key, value in layer.items() if not absent.get(key)}


def _file_layers(
    file: Path, creature_name: str
) -> tuple[bool, list[tuple[str, Mapping[str, Any]]]]:
    """Whether a user's file stands alone, and its layers: what it says to all, then to this creature.

    The tables of other creatures are checked too: a mistake shows whoever is trained.
    """
    path = _find_config(file)
    general = over_base(read_toml(path), str(path))
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
        # That of the creature at hand is read below, for whoever takes part.
        if name != creature_name and "use" not in {**general, **own}:
            build(Config, own, f"{path}: [creature.{name}]")
    mine = creatures.get(creature_name, {})
    return standalone, [(str(path), general), (f"{path}: [creature.{creature_name}]", mine)]


def _find_config(file: Path) -> Path:
    shipped = data_folder("configs") / f"{file}.toml"
    if not file.exists() and shipped.exists():
        return shipped
    if not file.exists():
        raise UserError(
            f"{file}: no such file and no shipped config of that name; "
            f"{did_you_mean(str(file), shipped_configs())}"
        )
    return file
