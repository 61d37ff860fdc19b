"""Runs of modular bodies are made of the same parts as all others."""

import dataclasses
from pathlib import Path
from typing import Any

import pytest

from mjxgait.api import load_creature, train
from mjxgait.cli.train import train_command
from mjxgait.config.schema import Config
from mjxgait.controllers.sims_brain.config import BrainConfig
from mjxgait.controllers.sims_brain.controller import Brains
from mjxgait.controllers.sims_brain.reference_body import DRAG, GRAVITY
from mjxgait.creature import Creature
from mjxgait.creature.scale import at_step
from mjxgait.errors import UserError
from mjxgait.kinds import controller_kind, register
from mjxgait.physics.batched_trees.tree import Surroundings
from mjxgait.plugins.registry import build_config, find, resolve_config
from mjxgait.simulation.rollout import Simulator
from mjxgait.tasks.modular.config import RoamConfig
from mjxgait.training.folder import create_run
from mjxgait.training.spec import make_spec


class Smelling(Brains):
    """A brain that reads an unknown observation."""

    def __init__(self, *told: Any) -> None:
        super().__init__(*told)
        self.reads = (*self.reads, "contcat")


def simulator(controller: str, task: str = "swim") -> Simulator:
    use = {"controller": controller, "task": task}
    return make_spec(load_creature("blocks"), build_config({"use": use}, "test")).simulator()


def test_a_brain_reads_only_available_observations():
    register(dataclasses.replace(controller_kind("brain"), name="smelling", controller=Smelling))
    assert simulator("brain").controller.reads == ("joint_pos", "contact")
    assert simulator("brain", "follow").controller.reads == ("joint_pos", "contact", "light")
    with pytest.raises(UserError, match='there is no observation "contcat"'):
        simulator("smelling")


def test_swimming_has_water_but_no_ground_or_gravity():
    plant: Any = simulator("brain").plant
    assert plant.around == Surroundings(step=0.01, floor=False, gravity=0.0, drag=DRAG)


def test_roaming_has_ground_and_gravity():
    plant: Any = simulator("brain", "roam").plant
    assert plant.around == Surroundings(
        step=0.01, contact=0.02, floor=True, gravity=GRAVITY, drag=0.0
    )


def test_a_shorter_step_makes_harder_ground():
    """Half the step also halves the contact time."""
    seed = at_step(load_creature("blocks"), 0.005)
    use = {"controller": "brain", "task": "jump"}
    config = build_config({"use": use, "rollout": {"step": 0.005}}, "test")
    plant: Any = make_spec(seed, config).simulator().plant
    assert (plant.around.step, plant.around.contact) == (0.005, 0.01)
    assert at_step(seed, 0.0) is seed


@pytest.mark.parametrize(("task", "step"), [("jump", 0.005), ("walk", 0.01)])
def test_a_run_has_the_step_of_its_task(task: str, step: float, monkeypatch: pytest.MonkeyPatch):
    """From the command line and from Python."""
    seen = []

    def only_look(folder: Path | None, creature: Creature, config: Config) -> Path:
        seen.append(float(creature.model.opt.timestep))
        raise UserError("that is enough")

    monkeypatch.setattr("mjxgait.api.make.check_run", only_look)
    with pytest.raises(UserError, match="enough"):
        train_command(["--env", "blocks", "--use.task", task])
    with pytest.raises(UserError, match="enough"):
        train("blocks", task=task)
    assert seen == [step, step]


def test_walk_means_roam_for_modular_bodies():
    """The environment decides which task `walk` stands for."""
    for env, task in (("blocks", "roam"), ("tall_quadruped", "walk")):
        creature = load_creature(env)
        requested = resolve_config(creature.settings.train, env, use={"task": "walk"})
        assert requested.use.task == task
        assert find("task", task).Settings is type(requested.fitness)
    written = build_config({"use": {"controller": "brain", "task": "walk"}}, "test")
    assert (written.use.task, type(written.fitness)) == ("roam", RoamConfig)


def test_the_sims_settings_have_his_population():
    """300 individuals, of which a fifth survive; four in ten children have one parent."""
    creature = load_creature("blocks")
    config = resolve_config(creature.settings.train, "blocks", Path("sims"), {"task": "walk"})
    evolution, controller = config.evolution, config.controller
    assert evolution.proportional
    assert (evolution.population + evolution.offspring, evolution.population) == (300, 60)
    assert evolution.initial_choice * evolution.population == 300
    assert isinstance(controller, BrainConfig)
    assert (controller.crossover, controller.grafting) == (0.3, 0.3)


def test_creature_settings_can_be_for_one_task_only():
    creature = load_creature("blocks")
    starts = [
        resolve_config(creature.settings.train, "blocks", use={"task": task}).rollout.starts
        for task in ("swim", "follow")
    ]
    assert starts == [2, 4]


@pytest.mark.parametrize(
    ("env", "given", "said"),
    [
        ("tall_quadruped", {"use": {"controller": "brain"}}, "its body is there already"),
        ("tall_quadruped", {"use": {"task": "swim"}}, "only bodies that grow"),
        ("blocks", {"use": {"task": "swim"}}, "poses has nothing to move"),
        ("tall_quadruped", {"use": {"task": "roam"}}, "only bodies that grow roam"),
        (
            "blocks",
            {"use": {"controller": "brain", "task": "hop"}},
            "cannot hop, only swim, roam, jump",
        ),
        (
            "blocks",
            {"use": {"controller": "brain", "task": "swim"}, "rollout": {"ground": "bumps:0.05"}},
            "rollout.ground is for a body that is there",
        ),
        (
            "blocks",
            {"use": {"controller": "brain", "task": "swim"}, "rollout": {"seconds": 1.5}},
            "fitness.settle = 2 s do not count",
        ),
        (
            "blocks",
            {"use": {"controller": "brain", "task": "swim"}, "evolution": {"pose_span": 60.0}},
            "evolution.pose_span is for a body that is there",
        ),
        (
            "tall_quadruped",
            {"evolution": {"family": 0.5, "islands": {"count": 2}}},
            "evolution.family is for one population",
        ),
        ("tall_quadruped", {"rollout": {"step": 0.002}}, "rollout.step is for bodies that grow"),
        ("tall_quadruped", {"rollout": {"moves": 2.0}}, "rollout.moves moves the lights of foll"),
        (
            "blocks",
            {"use": {"controller": "brain", "task": "jump"}, "rollout": {"step": 0.002}},
            "rollout.step = 0.002, but its creature.xml has 0.01 s",
        ),
    ],
)
def test_incompatible_settings_are_refused_in_one_sentence(
    env: str, given: dict[str, Any], said: str, tmp_path: Path
):
    creature, config = load_creature(env), build_config(given, "test")
    for requested in (
        lambda: make_spec(creature, config),
        lambda: create_run(tmp_path, creature, config),
    ):
        with pytest.raises(UserError, match=f"{env}: .*{said}"):
            requested()
    assert not list(tmp_path.iterdir()), "before anything is written"
