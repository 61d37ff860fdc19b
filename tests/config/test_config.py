"""Settings: strict keys, checked ranges, layers; a mistake is one sentence that names the place."""

import dataclasses
import inspect
import re
import typing
from pathlib import Path

import pytest

from mjxgait.config.layers import data_folder, find_creature, over_base
from mjxgait.config.schema import Config, UseConfig
from mjxgait.config.tables import build, dump_toml, read_toml
from mjxgait.errors import UserError
from mjxgait.kinds import controllers, tasks
from mjxgait.plugins import resolve_config
from mjxgait.plugins.registry import build_config, config_class


@pytest.mark.parametrize(
    "path", sorted(data_folder("configs").glob("*.toml")), ids=lambda path: path.stem
)
def test_every_shipped_config_loads(path: Path):
    table = over_base(read_toml(path), str(path))
    own = {
        key: table.pop(key, default)
        for key, default in (("standalone", False), ("creature", {}), ("task", {}))
    }
    for name, part in (("", table), *own["creature"].items()):
        assert isinstance(build_config(part, f"{path}: {name}"), Config)
    for task, part in own["task"].items():
        part.pop("like", None)
        use = {**table.get("use", {}), "task": task}
        assert isinstance(build_config({**part, "use": use}, f"{path}: [task.{task}]"), Config)


def test_a_config_survives_its_own_file(tmp_path: Path):
    config = build(Config, {"seed": 7, "controller": {"tuning": {"threshold": [0.1, 0.2]}}}, "test")
    (tmp_path / "config.toml").write_text(dump_toml(config))
    assert build(Config, read_toml(tmp_path / "config.toml"), "file") == config


@pytest.mark.parametrize(
    ("table", "words"),
    [
        (
            {"evolution": {"populaton": 3}},
            'unknown key "evolution.populaton"; did you mean "population"?',
        ),
        ({"evolution": {"population": 1}}, "population must be at least 2"),
        ({"evolution": {"growth": 1.0}}, "growth = 1.0 leaves no room for offspring"),
        ({"evolution": {"elite": 0.1}}, 'elite is for survival = "children"'),
        ({"evolution": {"remember": True}}, "remember is for an elite"),
        ({"rollout": {"slope": 5.0, "ground": "rough:0.1"}}, "slope and rough are for a flat one"),
        ({"evolution": {"elite": 1.0, "survival": "children"}}, "leaves no room for children"),
        ({"rollout": {"variety": 2}}, "rollout.variety = 2: individuals evaluated on other starts"),
        ({"rollout": {"physics": "warp"}}, "rollout.physics = 'warp'"),
        ({"rollout": {"seconds": float("nan")}}, "rollout.seconds"),
        ({"controller": {"tuning": {"threshold": [0.2, 0.1]}}}, "the first must not be the larger"),
        ({"seed": "x"}, "seed = 'x'"),
        ({"controller": 3}, "controller = 3: input should be a table"),
    ],
)
def test_a_mistake_is_named_with_its_place(table: dict, words: str):
    with pytest.raises(UserError) as error:
        build(Config, table, "mine.toml")
    assert str(error.value).startswith("mine.toml: ")
    assert words in str(error.value)
    assert "\n" not in str(error.value)


def test_a_file_overrides_the_creature_which_overrides_the_defaults(tmp_path: Path):
    file = tmp_path / "mine.toml"
    file.write_text("[rollout]\nstarts = 9\n")
    assert resolve_config({"rollout": {"starts": 7, "seconds": 3.0}}, "x").rollout.starts == 7
    both = resolve_config({"rollout": {"starts": 7, "seconds": 3.0}}, "x", file)
    assert (both.rollout.starts, both.rollout.seconds) == (9, 3.0)


def test_a_table_overrides_its_base(tmp_path: Path):
    shipped = resolve_config({}, "x", Path("other_starts"))
    over = resolve_config({"base": "other_starts", "rollout": {"starts": 7}}, "x")
    assert (over.rollout.starts, shipped.rollout.starts) == (7, 3)
    assert over.evolution == shipped.evolution != Config().evolution
    file = tmp_path / "mine.toml"
    file.write_text('base = "other_starts"\n[evolution]\nsigma = 0.5\n')
    own = resolve_config({"evolution": {"sigma": 0.4}, "rollout": {"starts": 7}}, "x", file)
    assert (own.evolution.sigma, own.rollout) == (0.5, over.rollout)


def test_a_base_may_have_a_base(tmp_path: Path):
    file = tmp_path / "mine.toml"
    file.write_text('base = "anywhere"\n')
    assert resolve_config({}, "x", file) == resolve_config({}, "x", Path("anywhere"))


@pytest.mark.parametrize("base", ['"other_start"', "3", '"styles/calm"', "[1]"])
def test_an_invalid_base_is_named_with_the_valid_ones(tmp_path: Path, base: str):
    file = tmp_path / "mine.toml"
    file.write_text(f"base = {base}\n")
    with pytest.raises(UserError, match=r"mine\.toml: base = .*other_starts"):
        resolve_config({}, "x", file)


def test_the_table_of_a_task_overrides_the_one_it_is_like():
    swim = {"rollout": {"starts": 4, "seconds": 20.0}, "evolution": {"rivals": 3}}
    tables = {"swim": swim, "jump": {"like": "swim", "rollout": {"starts": 2}}}
    creature = {"use": {"controller": "brain"}, "task": tables}
    config = resolve_config(creature, "x", use={"task": "jump"})
    assert (config.rollout.starts, config.rollout.seconds) == (2, 20.0)
    assert config.evolution.rivals == 3


@pytest.mark.parametrize("like", ["swin", "jump", 3, [1]])
def test_an_invalid_like_is_named(like: object):
    """A task may not be like itself, in any number of steps."""
    tables = {"swim": {"like": "jump"}, "jump": {"like": like}}
    creature = {"use": {"controller": "brain"}, "task": tables}
    for task in ("jump", "swim"):
        with pytest.raises(UserError, match=r"\[train\.task\.jump\]: like = "):
            resolve_config(creature, "x", use={"task": task})


def test_a_mistake_in_the_table_of_a_task_is_named_with_its_place():
    for tables, where in (
        ({"swim": 3, "jump": {"like": "swim"}}, r"\[train\.task\.swim\] = 3: give a table"),
        ({"swim": {"evolution": {"rival": 3}}, "jump": {"like": "swim"}}, r"swim\]: .*rivals"),
    ):
        with pytest.raises(UserError, match=where):
            resolve_config(
                {"use": {"controller": "brain"}, "task": tables}, "x", use={"task": "jump"}
            )


MINE = """
[rollout]
starts = 9

[creature.crab.rollout]
starts = 5
termination = { min_up = -1.0 }
"""


def test_a_file_may_have_settings_for_one_creature(tmp_path: Path):
    file = tmp_path / "mine.toml"
    file.write_text(MINE)
    train = {"rollout": {"starts": 7, "seconds": 3.0}}
    crab, other = (resolve_config(train, name, file).rollout for name in ("crab", "my dog"))
    assert (crab.starts, crab.seconds, crab.termination.min_up) == (5, 3.0, -1.0)
    assert (other.starts, other.seconds, other.termination.min_up) == (9, 3.0, None)


OF_TASKS = """
[rollout]
starts = 9
seconds = 4.0

[task.hop.rollout]
starts = 5

[task.limbo]
like = "hop"

[task.limbo.rollout]
seconds = 6.0

[creature.luxo.rollout]
seconds = 7.0
"""


def test_a_file_may_have_settings_for_one_task(tmp_path: Path):
    """They override the rest of the file; those for one creature override them."""
    file = tmp_path / "mine.toml"
    file.write_text(OF_TASKS)
    rollouts = [
        resolve_config({}, name, file, {"task": task, "controller": "program"}).rollout
        for name, task in (("x", "walk"), ("x", "hop"), ("x", "limbo"), ("luxo", "limbo"))
    ]
    assert [(r.starts, r.seconds) for r in rollouts] == [(9, 4.0), (5, 4.0), (5, 6.0), (5, 7.0)]


def test_the_table_of_walk_applies_to_modular_bodies(tmp_path: Path):
    """A modular body walks by the task `roam`."""
    file = tmp_path / "mine.toml"
    file.write_text("standalone = true\n[task.walk.rollout]\nseconds = 4.5\n")
    use = {"controller": "brain", "task": "walk"}
    assert resolve_config({}, "blocks", file, use).rollout.seconds == 4.5


def test_a_table_of_another_task_may_depend_on_the_rest_of_the_file(tmp_path: Path):
    file = tmp_path / "mine.toml"
    file.write_text('[evolution]\nsurvival = "children"\n[task.hop.evolution]\nelite = 0.25\n')
    assert resolve_config({}, "x", file).evolution.elite == resolve_config({}, "x").evolution.elite


def test_a_base_includes_its_tables_of_tasks(tmp_path: Path):
    file = tmp_path / "mine.toml"
    file.write_text('base = "sims"\n[task.jump.rollout]\nstarts = 3\n')
    found = [
        resolve_config({}, "blocks", file, {"task": task}).rollout.starts
        for task in ("swim", "follow", "jump")
    ]
    assert found == [1, 4, 3]


SIMS = ("swim", "walk", "jump", "follow", "follow-on-land")


@pytest.mark.parametrize("task", SIMS)
def test_the_settings_of_the_sims_paper_are_the_same_for_every_task(task: str):
    """The creature's own [train] does not apply; only the lights differ."""
    train = read_toml(find_creature("blocks") / "creature.toml")["train"]
    config = resolve_config(train, "blocks", Path("sims"), {"task": task})
    swims = resolve_config(train, "blocks", Path("sims"))
    assert (swims.use.task, swims.use.controller) == ("swim", "brain")
    assert config == resolve_config({}, "blocks", Path("sims"), {"task": task})
    assert config.evolution == swims.evolution
    assert config.controller == swims.controller
    assert config.rollout == dataclasses.replace(
        swims.rollout, starts=4 if task.startswith("follow") else 1
    )
    assert config.rollout.worst == 0.0
    assert config.examination == swims.examination


def test_a_standalone_file_has_no_layers_below(tmp_path: Path):
    file = tmp_path / "mine.toml"
    file.write_text("standalone = true\n[rollout]\nstarts = 9\n")
    found = resolve_config({"rollout": {"seconds": 3.0}, "seed": 4}, "x", file)
    assert found == build(Config, {"rollout": {"starts": 9}}, "test")


@pytest.mark.parametrize("name", ["tall_quadruped", "short_quadruped", "crab", "mine"])
def test_the_default_search_has_the_operators_of_the_thesis(name: str):
    train = {} if name == "mine" else read_toml(find_creature(name) / "creature.toml")
    evolution = resolve_config(train.get("train", {}), name).evolution
    assert evolution.crossing == evolution.mutation == "mixed"
    assert evolution.crossover * evolution.permuted > 0.1
    assert evolution.mutation_rate * evolution.redrawn > 0.1
    assert evolution.remove_duplicates
    assert evolution.forced.enabled
    assert resolve_config(train.get("train", {}), name).controller.advance == "error"
    assert resolve_config(train.get("train", {}), name).controller.around == ()


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[creature.crb.rollout]\nstarts = 2", 'creature.crb: "crb" is neither'),
        ("[creature.crb.rollout]\nstarts = 2", 'did you mean "crab"?'),
        ("[creature.crab.rollout]\nstart = 2", "[creature.crab]: unknown key"),
        ("[creature]\ncrab = 3", "creature.crab = 3: give a table"),
        ("creature = 3", "creature = 3: give tables"),
        ("task = 3", "task = 3: give tables such as [task.follow]"),
        ("[task]\nhop = 3", "[task.hop] = 3: give a table"),
        ("[task.hopp.rollout]\nstarts = 2", '[task.hopp]: there is no task "hopp"'),
        ("[task.hop.rollout]\nstart = 2", '[task.hop]: unknown key "rollout.start"'),
        ("[task.hop.fitness.weights]\nslip = 2", '[task.hop]: unknown key "fitness.weights.slip"'),
        ("[task.walk.rollout]\nstart = 2", '[task.walk]: unknown key "rollout.start"'),
        ('[task.hop]\nuse = { task = "walk" }', "[task.hop]: use: a table of a task chooses"),
        ('[task.hop]\nlike = "lim"', "[task.hop]: like = 'lim'"),
        ('standalone = "yes"', "standalone = 'yes': give true or false"),
        ("[rollout.termination]\nheight = [2.0, 1.0]", "the first must be the smaller"),
    ],
)
def test_a_mistake_in_a_table_of_any_creature_is_named(tmp_path: Path, text: str, words: str):
    file = tmp_path / "mine.toml"
    file.write_text(text)
    with pytest.raises(UserError) as error:
        resolve_config({}, "duck", file)
    assert words in str(error.value)
    assert str(file) in str(error.value)


def wilson(creature: str) -> Config:
    folder = find_creature(creature)
    train = read_toml(folder / "creature.toml").get("train", {})
    return resolve_config(train, creature, Path("wilson"))


def test_the_thesis_settings_differ_only_where_the_thesis_does():
    quadruped, crab, duck, alien = map(wilson, ("tall_quadruped", "crab", "duck", "alien"))
    assert wilson("short_quadruped") == quadruped
    assert alien == duck
    assert quadruped.fitness.weights.foot_height > 0 == duck.fitness.weights.foot_height
    assert crab.rollout.termination.min_up == -1.0
    assert duck.rollout.termination.min_up < 0
    for config in (quadruped, crab, duck, alien):
        rewarded = {name: w for name, w in vars(config.fitness.weights).items() if w}
        assert rewarded.keys() <= {"distance", "fall", "foot_height"}
        assert config.rollout.termination.touch is False
        assert 5 <= config.rollout.seconds <= 8
        assert 2 <= config.controller.key_poses <= 4
        assert 30 <= config.evolution.population <= 50


def test_the_lamp_has_the_settings_of_its_papers():
    train = read_toml(find_creature("luxo") / "creature.toml")["train"]
    config = resolve_config(train, "luxo", Path("gritz_hahn"))
    assert (config.use.task, config.use.controller) == ("hop", "program")
    evolution = config.evolution
    assert (evolution.population, evolution.generations, evolution.offspring) == (250, 50, 250)
    assert (evolution.crossover, evolution.mutation_rate) == (0.9, 0.0)
    assert (evolution.forced.enabled, evolution.survival) == (False, "children")
    assert set(config.controller.functions) == {"+", "-", "*", "/", "ifltz"}
    assert config.rollout.starts == 1


def test_a_broken_file_is_named(tmp_path: Path):
    file = tmp_path / "broken.toml"
    file.write_text("[rollout\n")
    with pytest.raises(UserError, match=r"broken.toml: not valid TOML"):
        resolve_config({}, "x", file)


def test_a_file_for_another_task_is_explained(tmp_path: Path):
    with pytest.raises(UserError, match=r"its \[fitness\] is for the task walk"):
        resolve_config({}, "luxo", Path("wilson"), use={"task": "hop"})
    file = tmp_path / "mine.toml"
    file.write_text("[fitness.weights]\nslip = 2.0\n[rollout]\nstart = 2\n")
    with pytest.raises(UserError, match=r'unknown key "rollout.start"; did you mean "starts"\?$'):
        resolve_config({}, "luxo", file, use={"task": "hop"})


def test_an_unknown_creature_lists_the_known_ones():
    with pytest.raises(UserError, match="short_quadruped, tall_quadruped"):
        find_creature("dragon")


def test_an_unknown_config_names_the_nearest():
    with pytest.raises(UserError, match='did you mean "wilson"'):
        resolve_config({}, "x", Path("wilsn"))


def test_configs_are_immutable():
    with pytest.raises(dataclasses.FrozenInstanceError):
        Config().seed = 3  # type: ignore[misc]


def tables_of(cls: type) -> list[type]:
    """A dataclass of settings and all nested ones."""
    hints = typing.get_type_hints(cls)
    inner = [t for t in hints.values() if dataclasses.is_dataclass(t)]
    return [cls, *(found for t in inner for found in tables_of(t))]


@pytest.mark.parametrize("controller", list(controllers()))
@pytest.mark.parametrize("task", list(tasks()))
def test_every_key_is_explained_under_its_own_name(controller: str, task: str):
    """`train --help` uses these texts; a base class explains the inherited keys."""
    for cls in tables_of(config_class(UseConfig(controller, task))):
        words = "\n".join(inspect.cleandoc(base.__doc__ or "") for base in cls.__mro__)
        told = set(re.findall(r"^  (\w+): \S", words, re.MULTILINE))
        assert told == {field.name for field in dataclasses.fields(cls)}, cls
