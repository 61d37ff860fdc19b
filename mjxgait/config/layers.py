"""Merging of the layers of settings."""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from importlib import resources
from pathlib import Path
from typing import Any, Literal

from mjxgait.config.schema import Config, UseConfig
from mjxgait.config.tables import Table, build, merge, read_toml
from mjxgait.errors import UserError, did_you_mean


def data_folder(kind: Literal["envs", "configs"]) -> Path:
    """Return the folder of shipped creatures or configs: in the package or in the checkout."""
    package = Path(str(resources.files("mjxgait")))
    packaged = package / "data" / kind
    return packaged if packaged.is_dir() else package.parent / kind


def shipped_creatures() -> list[str]:
    """Return the names of the shipped creatures."""
    return sorted(path.parent.name for path in data_folder("envs").glob("*/creature.toml"))


def shipped_configs() -> list[str]:
    """Return the names of the shipped configs."""
    return sorted(path.stem for path in data_folder("configs").glob("*.toml"))


def find_creature(name: str) -> Path:
    """Return the folder of a shipped creature, or the folder at a path.

    Raises:
      UserError: lists the known creatures.
    """
    known = shipped_creatures()
    if name in known:
        return data_folder("envs") / name
    folder = Path(name)
    if (folder / "creature.toml").is_file():
        return folder
    if folder.is_dir():
        raise UserError(
            f"{folder}: no creature folder (it has no creature.toml); `mjxgait import` makes one "
            "of a model file"
        )
    if folder.suffix or len(folder.parts) > 1:
        raise UserError(f"{folder}: no such file or folder")
    raise UserError(
        f'unknown creature "{name}"; {did_you_mean(name, known)} '
        "(`mjxgait list` lists all; the path of a folder or of a model file will do too)"
    )


Layer = tuple[str, Table]
"""Name of a source of settings in errors, and its table."""
Meant = Callable[[UseConfig], UseConfig]


def resolve_config(
    creature_table: Table,
    creature_name: str,
    file: Path | None = None,
    use: Mapping[str, str] | None = None,
    config_class: Callable[[UseConfig], type[Config]] = lambda use: Config,
    meant: Meant = lambda use: use,
) -> Config:
    """Resolve the layers: `configs/default.toml`, then the creature's `[train]`, then the file.

    A file may begin with `standalone = true`: then only the built-in defaults lie under it. A file
    or `[train]` may name a `base`, see `over_base`. Tables `[train.task.NAME]` of the creature and
    `[task.NAME]` of the file hold keys for that task. Each lies over the rest of its layer, and
    over the table of the task named by `like`. Tables `[creature.NAME]` of the file hold keys for
    that creature; they lie on top. Keys of default.toml and `[train]` for an unused controller or
    task are dropped.

    Args:
      use: controller and task, over those of the layers. config_class: the class with their
        settings. meant: controller and task under the names that the program uses.

    Raises:
      UserError: names the layer and the key.
    """
    default = data_folder("configs") / "default.toml"
    mine = _FileLayers() if file is None else _file_layers(file, creature_name)
    given: list[Layer] = []
    own = f"{creature_name}/creature.toml: [train]"
    general = over_base(creature_table, own)
    of_tasks = _task_tables(general, own)
    if not mine.standalone:
        given.append((str(default), read_toml(default)))
        given.append((own, general))
    chosen = meant(_chosen([*given, *mine.general, *mine.creature], use or {}))
    if not mine.standalone:
        tables = _layers_of(of_tasks, chosen, meant, f"{creature_name}/creature.toml: [train.task")
        written = {**general.get("use", {}), "task": chosen.task}
        given += [(w, {**table, "use": written}) for w, table in tables]
    cls = config_class(chosen)
    table: Table = {}
    for where, layer in [
        *((w, _without_absent(given_one, chosen, meant)) for w, given_one in given),
        *mine.general,
        *_layers_of(mine.tasks, chosen, meant, mine.where),
        *mine.creature,
    ]:
        table = merge(table, layer)
        try:
            build(cls, table, where)
        except UserError as error:
            raise _explained(error, _absent(layer, chosen, meant)) from None
    table = merge(table, {"use": dataclasses.asdict(chosen)})
    config = build(cls, table, "the settings taken together")
    _check_other_tasks(mine, config, config_class, meant)
    return config


def _task_tables(layer: dict[str, Any], where: str) -> Table:
    """Take the tables by task out of a layer.

    Raises:
      UserError: its key `task` is no table.
    """
    tasks = layer.pop("task", {})
    if not isinstance(tasks, Mapping):
        raise UserError(f"{where}: task = {tasks!r}: give tables such as [task.follow]")
    return tasks


def over_base(table: Table, where: str) -> dict[str, Any]:
    """Merge a table of settings over the shipped config named by its key `base`, if it has one.

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


def _layers_of(tables: Table, use: UseConfig, meant: Meant, where: str) -> list[Layer]:
    """Return the layers of the task in `use`, from each table whose name means this task."""
    names = [n for n in tables if meant(dataclasses.replace(use, task=n)).task == use.task]
    return [layer for name in names for layer in _tables_of(tables, name, where)]


def _check_other_tasks(
    mine: "_FileLayers",
    config: Config,
    config_class: Callable[[UseConfig], type[Config]],
    meant: Meant,
) -> None:
    """Check a file's tables of the unused tasks, so that a mistake shows in every run.

    A user-defined task is known only where it is used.

    Raises:
      UserError: names the table and the key.
    """
    known = dataclasses.asdict(config)
    base = {key: value for key, value in known.items() if key not in ("use", "fitness")}
    for name in mine.tasks:
        use = meant(dataclasses.replace(config.use, task=name))
        if ":" in name or use.task == config.use.task:
            continue
        for place, table in _tables_of(mine.tasks, name, mine.where):
            try:
                cls = config_class(use)
            except UserError as error:
                raise UserError(f"{place}: {error}") from None
            build(cls, merge(base, table), place)


def _tables_of(tables: Table, task: str, where: str) -> list[Layer]:
    """Return the layers of a task: its table, over the table of the task named by `like`.

    where: beginning of each table's name, such as `mine.toml: [task`.

    Raises:
      UserError: there is no such table, it is not a table, or it chooses controller or task.
    """
    place = f"{where}.{task}]"
    if not isinstance(tables[task], Mapping):
        raise UserError(f"{place} = {tables[task]!r}: give a table")
    own = dict(tables[task])
    if "use" in own:
        raise UserError(f"{place}: use: a table of a task chooses neither controller nor task")
    like = own.pop("like", None)
    if like is None:
        return [(place, own)]
    others = {name: table for name, table in tables.items() if name != task}
    if like not in list(others):
        raise UserError(f"{place}: like = {like!r}: {did_you_mean(str(like), list(others))}")
    return [*_tables_of(others, like, where), (place, own)]


def _chosen(layers: Sequence[Layer], use: Mapping[str, str]) -> UseConfig:
    table: Table = {}
    for where, layer in layers:
        given = layer.get("use", {})
        if not isinstance(given, Mapping):
            raise UserError(f"{where}: use = {given!r}: give a table such as [use]")
        table = merge(table, given)
        build(UseConfig, table, f"{where}: [use]")
    return build(UseConfig, merge(table, use), "the options")


def _without_absent(layer: Table, use: UseConfig, meant: Meant) -> dict[str, Any]:
    """Drop a layer's keys for an unused controller or task.

    The layer was written for the controller and task that it names, or else for the default ones.
    """
    absent = _absent(layer, use, meant)
    return {key: value for key, value in layer.items() if key not in absent}


def _absent(layer: Table, use: UseConfig, meant: Meant) -> dict[str, str]:
    """Tables of a layer that were written for another controller or task, and for which."""
    written = meant(build(UseConfig, layer.get("use", {}), "[use]"))
    tables = {
        "controller": ("controller", written.controller, use.controller),
        "fitness": ("task", written.task, use.task),
    }
    return {
        table: f"the {kind} {before}"
        for table, (kind, before, now) in tables.items()
        if before != now and table in layer
    }


def _explained(error: UserError, absent: Mapping[str, str]) -> UserError:
    """The error about a key of a user's file, with the reason if its table is of another kind."""
    for table, kind in absent.items():
        if f'"{table}.' in str(error):
            return UserError(f"{error}; its [{table}] is for {kind}")
    return error


@dataclasses.dataclass(frozen=True)
class _FileLayers:
    """Content of a user's file.

    general: the layer for all creatures. creature: the layer for this run's creature. tasks: the
    tables by task. where: beginning of these tables' names in an error.
    """

    standalone: bool = False
    general: tuple[Layer, ...] = ()
    creature: tuple[Layer, ...] = ()
    tasks: Table = dataclasses.field(default_factory=dict)
    where: str = ""


def _file_layers(file: Path, creature_name: str) -> _FileLayers:
    """Read a user's file.

    The tables of other creatures are checked too, so that a mistake shows in every run.
    """
    path = find_file(file, data_folder("configs"), "config")
    general = over_base(read_toml(path), str(path))
    standalone, creatures = general.pop("standalone", False), general.pop("creature", {})
    tasks = _task_tables(general, str(path))
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
        # `resolve_config` checks this creature's own, with the controller and task in use.
        if name != creature_name and "use" not in {**general, **own}:
            build(Config, own, f"{path}: [creature.{name}]")
    mine = (f"{path}: [creature.{creature_name}]", creatures.get(creature_name, {}))
    return _FileLayers(standalone, ((str(path), general),), (mine,), tasks, f"{path}: [task")


def find_file(file: Path, folder: Path, kind: str) -> Path:
    """Return a file of settings, or the shipped one of that name in a folder.

    kind: what the shipped files are called in the error.

    Raises:
      UserError: there is neither.
    """
    shipped = folder / f"{file}.toml"
    # A folder of that name does not hide the shipped file.
    if file.is_file() or (file.exists() and not shipped.exists()):
        return file
    if shipped.exists():
        return shipped
    known = sorted(path.stem for path in folder.glob("*.toml"))
    raise UserError(
        f"{file}: no such file and no shipped {kind} of that name; {did_you_mean(str(file), known)}"
    )
