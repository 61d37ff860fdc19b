"""Bodies with several skills: every trial is a trial of one skill, and every skill is examined."""

import dataclasses
import json
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from controllers.sims_brain.made_up import moment
from helpers import SHORT, said_by

from mjxgait import api
from mjxgait.api import load_creature
from mjxgait.certification import (
    Certificate,
    CertificateConfig,
    Criterion,
    certify,
    nominal_check,
    trial_run,
    verdict_of,
)
from mjxgait.certification.acceptance import acceptance_of, promising
from mjxgait.certification.criteria import at_least, at_most
from mjxgait.champion import TRIALS, Champion, by_skill, write_champion
from mjxgait.config.schema import Config, RolloutConfig
from mjxgait.controllers.sims_brain.reference_body import LIGHT, grow
from mjxgait.errors import UserError
from mjxgait.evolution.chance import key_of
from mjxgait.experiments.ablation import measures
from mjxgait.experiments.ablation.measures import walked
from mjxgait.kinds import skills_of, tasks
from mjxgait.plugins.fit import check_fit
from mjxgait.plugins.registry import build_config
from mjxgait.simulation.evaluator import LocalEvaluator
from mjxgait.simulation.rollout import Episodes
from mjxgait.tasks.modular.jump import LYING
from mjxgait.tasks.modular.skills import AllTrades, Amphibian, Skills, SkillsStats
from mjxgait.tasks.starts import NEVER, Starts
from mjxgait.training.experiment import Experiment, build_experiment, one_row, row_of
from mjxgait.training.folder import CERTIFICATE, CHAMPION, create_run, open_champion, open_run
from mjxgait.types import Evaluation

TABLE: dict[str, Any] = {
    "use": {"controller": "brain", "task": "amphibian"},
    "controller": {
        "nodes": 3,
        "parts": 3,
        "links": 3,
        "local": 2,
        "central": 1,
        "skills": 2,
    },
    "evolution": {"population": 60},
    "seed": 1,
    "rollout": {"seconds": 1.6, "starts": 4, "promote": 1.0, "lanes": 24, "joint_noise": 0.1},
    "fitness": {
        "swim": {"settle": 0.1},
        "roam": {"settle": 0.1},
        "required": {"swim": 0.01, "roam": 0.1},
    },
}


def config_of(**changed: Any) -> Config:
    """The settings with other tables."""
    return build_config({**TABLE, **changed}, "test")


@pytest.fixture(scope="module")
def experiment() -> Experiment:
    return build_experiment(load_creature("blocks"), config_of())


class Simulated:
    """Evaluator with one compiled simulation, which also tells its statistics."""

    def __init__(self, experiment: Experiment) -> None:
        self._simulate = jax.jit(experiment.simulator.simulate)
        self._verdict = jax.jit(jax.vmap(LocalEvaluator(experiment.simulator).evaluation_of))

    def simulate(self, *rows: Any) -> Episodes:
        """Genomes, trials and settings, each of one row; as NumPy arrays, for the same program."""
        found: Episodes = self._simulate(*jax.device_get(rows))
        return found

    def evaluate(
        self, genomes: Any, trials: Starts, settings: Config, requested: None = None
    ) -> Evaluation:
        """See `Evaluator`; the settings are of one row, which all steps belong to."""
        episodes = self.simulate(genomes, trials, settings)
        each = dataclasses.replace(episodes, computed_steps=episodes.computed_steps[None])
        found: Evaluation = jax.device_get(self._verdict(*jax.device_get((settings, each))))
        return found


@pytest.fixture(scope="module")
def evaluator(experiment: Experiment) -> Simulated:
    return Simulated(experiment)


@pytest.fixture(scope="module")
def champion(experiment: Experiment) -> Champion:
    """The first individual of a first population that has hinges, as if it had been evaluated."""
    state = jax.tree.map(np.asarray, dataclasses.replace(experiment.init(), key=jnp.zeros(())))
    outcome = np.tile([0.5, 0.0, 1.6, 0.1], (len(state.fitness), 4, 1))
    outcome[:, 1, 0] = 0.8
    terms = np.zeros((len(state.fitness), 4, 2))
    known = dataclasses.replace(state, outcome=outcome, terms=terms)
    everyone = (experiment.champion(known, {}, rank) for rank in range(len(state.fitness)))
    return next(one for one in everyone if _hinges(one) > 1)


def _hinges(champion: Champion) -> int:
    parts = grow(champion.genome, champion.settings.parts, champion.settings.links)
    return sum(len(part.hinges) for part in parts)


def test_every_skill_is_a_task_of_its_own():
    skilled = {name: kind.skills for name, kind in tasks().items() if kind.skills}
    assert set(skilled) == {"amphibian", "all-trades"}
    for name, skills in skilled.items():
        kind = tasks()[name]
        assert tuple(kind.part("task").tasks) == skills
        assert [type(one) for one in acceptance_of(name).each] == [
            type(acceptance_of(skill)) for skill in skills
        ]
        assert kind.water == tasks()[skills[0]].water, "what is shown is the first skill"
        assert {table for skill in skills for table in tasks()[skill].tables} == set(kind.tables)


def drawn(task: Skills, settings: RolloutConfig) -> Starts:
    """Starts of all trials, drawn by one program."""
    creature = load_creature("blocks")
    return jax.device_get(jax.jit(lambda key: task.trials(key, creature, settings))(key_of(0)))


def test_trials_command_the_skills_in_turn():
    task = AllTrades(load_creature("blocks"), 0.01, 100, None)
    settings = RolloutConfig(starts=8, joint_noise=0.3)
    starts = drawn(task, settings)
    np.testing.assert_array_equal(starts.goal.skill, [0, 1, 2, 3, 0, 1, 2, 3])
    np.testing.assert_array_equal(starts.ground.wet, [1, 0, 0, 1, 1, 0, 0, 1])
    bent = np.abs(starts.qpos[:, 7:]).max(1) > 0
    np.testing.assert_array_equal(bent, [False] * 4 + [True] * 4)
    lights = np.zeros((8, 3))
    lights[3], lights[7] = [LIGHT, 0, 0], [-LIGHT, 0, 0]
    np.testing.assert_allclose(starts.goal.light.place, lights, atol=1e-5)


def test_every_round_has_the_skills_in_turn():
    """With `variety` the first trial of a skill stays undisturbed, and lights cancel out."""
    task, rounds, others = AllTrades(load_creature("blocks"), 0.01, 100, None), 5, 15
    settings = RolloutConfig(starts=1 + rounds * others, variety=rounds, joint_noise=0.3)
    starts = drawn(task, settings)
    for number in range(rounds):
        places = np.append(0, 1 + number * others + np.arange(others))
        own = jax.tree.map(lambda leaf, at=places: np.asarray(leaf)[at], starts)
        np.testing.assert_array_equal(own.goal.skill, np.arange(16) % 4)
        bent = np.abs(own.qpos[:, 7:]).max(1) > 0
        np.testing.assert_array_equal(bent, np.arange(16) >= 4)
        np.testing.assert_allclose(own.goal.light.place.sum(0), 0.0, atol=1e-4)
    assert len(np.unique(np.asarray(starts.qpos)[:, 7])) == 1 + 3 * 4 * rounds


def test_the_skills_get_better_together(experiment: Experiment, evaluator: Simulated):
    step, state, mean = experiment.compile(evaluator), experiment.place(experiment.init()), []
    for _ in range(3):
        state, metrics = step(state)
        mean.append(float(metrics.mean))
    assert 0 < mean[0] < mean[1] < mean[2]


@pytest.fixture(scope="module")
def simulated(experiment: Experiment, evaluator: Simulated) -> tuple[Any, SkillsStats]:
    """The first population, and its statistics in all trials."""
    genomes = experiment.init().genomes
    rows = one_row((genomes, experiment.starts, experiment.row.settings))
    return genomes, row_of(evaluator.simulate(*rows).stats)


@pytest.mark.parametrize(("number", "task"), [(0, "swim"), (1, "roam")])
def test_a_trial_goes_as_in_the_task_of_its_skill(
    simulated: tuple[Any, SkillsStats], experiment: Experiment, number: int, task: str
):
    """The undisturbed trial: motion, statistics and score."""
    genomes, together = simulated
    brain = TABLE["controller"] | {"skill": number}
    rollout = TABLE["rollout"] | {"starts": 1}
    weights = {"weights": {"vibration": 1.0}} if task == "roam" else {}
    alone = build_experiment(
        load_creature("blocks"),
        config_of(
            use={"controller": "brain", "task": task},
            controller=brain,
            rollout=rollout,
            fitness={"settle": 0.1} | weights,
        ),
    )
    stats, each = jax.jit(alone.simulate)(genomes).stats, together.each[number]
    own = np.asarray(stats.place)[:, 0] - np.asarray(stats.settled)[:, 0]
    here = np.asarray(each.place)[:, number] - np.asarray(each.settled)[:, number]
    assert np.mean(np.abs(own).max(1) > 1e-3) > 0.1
    # Motion with contacts is chaotic: of one in sixty rounding decides.
    assert np.mean(np.abs(here - own).max(1) > 1e-4) < 0.05
    found = jax.vmap(jax.vmap(lambda s: experiment.simulator.task.evaluate(s, FITNESS)))(together)
    terms = jax.vmap(jax.vmap(lambda s: alone.simulator.task.evaluate(s, alone.config.fitness)))
    weighed = alone.simulator.task.weights(alone.config.fitness, jnp.int32(100))
    earned = sum(weighed[name] * np.asarray(value)[:, 0] for name, value in terms(stats).items())
    least, score = FITNESS.least, np.asarray(found[task])[:, number]
    expected = 1 - np.log(
        np.clip(earned / getattr(FITNESS.required, task), least, FITNESS.most)
    ) / np.log(least)
    assert np.sum(expected > 0.1) > 2, "others score nothing"
    assert np.mean(np.abs(score - expected) > 1e-4) < 0.05
    np.testing.assert_array_equal(np.asarray(found[task])[:, 1 - number], 0.0)


FITNESS, SETTLED = config_of().fitness, config_of(fitness={}).fitness


def test_a_score_of_one_is_what_the_certificate_requires():
    thresholds, required = CertificateConfig(), SETTLED.required
    assert (required.swim, required.roam) == (thresholds.swim.speed, thresholds.roam.speed)
    assert required.jump == thresholds.jump.height
    assert required.follow == thresholds.follow.speed


def test_much_of_one_skill_does_not_make_up_for_another():
    task = Amphibian(load_creature("blocks"), 0.01, 100, None)
    stats = task.init()
    swum = dataclasses.replace(
        stats.each[0], place=jnp.array([40.0, 0, 0]), settled=jnp.zeros(3), steps=jnp.int32(100)
    )
    fast = dataclasses.replace(stats, each=(swum, stats.each[1]), steps=jnp.int32(100))
    terms = task.evaluate(fast, FITNESS)
    assert float(terms["swim"]) == pytest.approx(1 - np.log(1.5) / np.log(0.02))
    assert float(terms["roam"]) == 0.0


def test_a_share_of_what_is_required_scores_by_its_logarithm():
    task = Amphibian(load_creature("blocks"), 0.01, 1000, None)

    def scored(speed: float) -> float:
        stats = task.init()
        place = jnp.array([8.0 * speed, 0, 0])
        swum = dataclasses.replace(stats.each[0], place=place, steps=jnp.int32(1000))
        done = dataclasses.replace(stats, each=(swum, stats.each[1]), steps=jnp.int32(1000))
        return float(task.evaluate(done, SETTLED)["swim"])

    assert scored(0.0) == 0.0
    assert scored(0.004) == pytest.approx(0.0, abs=1e-6)
    assert scored(0.2) == pytest.approx(1.0, abs=1e-5)
    half, quarter = scored(0.1), scored(0.05)
    assert 1.0 - half == pytest.approx(half - quarter, abs=1e-4)


def test_lying_still_ends_only_a_trial_of_jumping():
    task = AllTrades(load_creature("blocks"), 0.01, 1200, None)
    settings = config_of(
        use={"controller": "brain", "task": "all-trades"},
        controller=TABLE["controller"] | {"skills": 4},
        fitness={},
    ).fitness
    params, sensed = task.params(settings), moment()
    starts = drawn(task, RolloutConfig(starts=8))
    sensed = dataclasses.replace(
        sensed,
        joint_vel=jnp.zeros(len(task.creature.joints.names)),
        body=dataclasses.replace(sensed.body, geom_rot=jnp.tile(jnp.eye(3), (4, 1, 1))),
    )

    def ended(trial: int) -> int:
        goal = task.goal(jax.tree.map(lambda leaf: leaf[trial], starts))
        stats = task.init()
        jumped = dataclasses.replace(stats.each[2], steps=jnp.int32(700))
        stats = dataclasses.replace(
            stats, each=(*stats.each[:2], jumped, stats.each[3]), steps=jnp.int32(700)
        )
        return int(task.update(stats, sensed, sensed.joint_vel, params, goal).reason)

    assert [ended(trial) for trial in range(4)] == [0, 0, LYING, 0]


def test_only_a_follower_sees_the_light():
    task = AllTrades(load_creature("blocks"), 0.01, 1200, None)
    starts = drawn(task, RolloutConfig(starts=8))
    sensed = moment({"geom_rot": jnp.tile(jnp.eye(3), (4, 1, 1))})
    for trial, skill in enumerate(np.asarray(starts.goal.skill)):
        goal = task.goal(jax.tree.map(lambda leaf, at=trial: leaf[at], starts))
        seen = task.observations(goal, sensed)
        assert int(seen["skill"]) == skill
        assert np.isfinite(seen["light"]).all()
        assert (np.abs(seen["light"]).max() > 0) == (skill == 3)
    assert (np.asarray(starts.goal.light.steps) == NEVER).all()
    dark = Amphibian(load_creature("blocks"), 0.01, 100, None)
    assert drawn(dark, RolloutConfig(starts=4)).goal.light is None


def test_each_skill_is_a_champion_of_its_own_task(champion: Champion):
    each = by_skill(champion)
    assert list(each) == ["swim", "roam"]
    assert [one.settings.skill for one in each.values()] == [0, 1]
    assert each["roam"].terms["speed"] == pytest.approx(0.8 / 1.5)
    assert each["swim"].origin["nominal"]["way"] == champion.origin[TRIALS]["swim"]["way"] == 0.5
    creature = load_creature("blocks")
    gravity = [abs(one.embodied(creature).model.opt.gravity[2]) for one in each.values()]
    assert gravity == [0.0, pytest.approx(9.81)]
    assert each["swim"].fingerprint == champion.fingerprint != each["roam"].fingerprint
    assert by_skill(each["roam"]) == {}


def test_a_certificate_holds_every_skill(champion: Champion, monkeypatch: pytest.MonkeyPatch):
    """Its criteria and its margin are those of all skills; made up, with walking the worse."""
    speeds = {"swim": 0.3, "roam": 0.15}

    def examined(body: Any, one: Champion, config: Any = None, *given: Any) -> Certificate:
        crossed = Criterion(2, "goes", (at_least("speed (m/s)", speeds[one.task], 0.2),))
        report = {"summary": f"{speeds[one.task]} m/s", "parts": 3}
        criteria = (crossed, Criterion(9, "parts", (at_most("overlap", 0.0, 0.05),)))
        return Certificate("", "", one.task, "", criteria, report, CertificateConfig(), 1.0)

    monkeypatch.setattr("mjxgait.certification.certificate.certify", examined)
    found = certify(champion.embodied(load_creature("blocks")), champion)
    assert found.margin == pytest.approx(-0.25)
    assert not found.passed
    assert [(c.number, c.name) for c in found.criteria] == [
        (2, "swim: goes"),
        (9, "swim: parts"),
        (2, "walk: goes"),
        (9, "walk: parts"),
    ]
    assert found.report["summary"] == "swim: 0.3 m/s; walk: 0.15 m/s"
    stored = verdict_of(json.loads(found.to_json()))
    assert not stored.contradiction
    assert stored.labels == ["walk 2"]
    document = json.loads(found.to_json())
    document["criteria"][2]["passed"] = True
    assert "walk 2" in verdict_of(document).contradiction


def test_a_study_measures_the_worst_skill(champion: Champion, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(measures, "STARTS", 2)
    monkeypatch.setattr(measures, "SECONDS", 3.0)
    creature = load_creature("blocks")
    each = [walked(one.embodied(creature), one) for one in by_skill(champion).values()]
    worst = tuple(map(min, zip(*each, strict=True)))
    assert walked(champion.embodied(creature), champion) == worst


def test_every_skill_is_checked_by_itself(champion: Champion):
    creature = load_creature("blocks")
    config = dataclasses.replace(CertificateConfig(), seconds=3.0, warmup=0.5)
    seen = nominal_check(champion.embodied(creature), champion, config)
    each = [
        nominal_check(one.embodied(creature), one, config) for one in by_skill(champion).values()
    ]
    assert [c.measures for c in seen.criteria] == [c.measures for s in each for c in s.criteria]
    assert {c.name.partition(":")[0] for c in seen.criteria} == {"swim", "walk"}


@pytest.mark.parametrize(("wanted", "taken"), [(-9.0, ["swim", "roam"]), (0.2, ["swim"])])
def test_the_worst_skill_decides_the_trial_run(
    champion: Champion, monkeypatch: pytest.MonkeyPatch, wanted: float, taken: list[str]
):
    """Once a skill is not as good as wanted the others need not run."""
    margins, asked = {"swim": 0.1, "roam": 0.4}, []

    def made_up(body: Any, one: Champion, *given: Any) -> float:
        asked.append(one.task)
        return margins[one.task]

    monkeypatch.setattr("mjxgait.certification.trials.trial_run", made_up)
    body = champion.embodied(load_creature("blocks"))
    assert trial_run(body, champion, 2, wanted=wanted) == 0.1
    assert asked == taken


def test_an_individual_is_worth_validating_only_if_every_skill_is():
    acceptance, creature = acceptance_of("amphibian"), load_creature("blocks")
    enough = {"way": np.full(4, 2.1), "height": np.zeros(4), "seconds": np.full(4, 10.0)}
    assert promising(acceptance, enough, 10.0, creature)
    for trial in range(4):
        way = enough["way"].copy()
        way[trial] = 1.9
        assert not promising(acceptance, enough | {"way": way}, 10.0, creature)
    all_trades, enough = (
        acceptance_of("all-trades"),
        {"way": np.full(16, 3.0), "height": np.full(16, 0.2), "seconds": np.full(16, 12.0)},
    )
    assert promising(all_trades, enough, 12.0, creature)
    height = np.where(np.arange(16) % 4 == 2, 0.0, 0.2)
    assert not promising(all_trades, enough | {"height": height}, 12.0, creature)
    way = enough["way"].copy()
    way[3] = 0.0  # one of its four lights
    assert promising(all_trades, enough | {"way": way}, 12.0, creature)


@pytest.mark.parametrize(
    ("changed", "sentence"),
    [
        ({"rollout": {"starts": 3, "promote": 1.0}}, "take a multiple of 2 from 2 on"),
        ({"controller": {"skills": 3}}, "take --controller.skills 2"),
        ({"examination": {"tryout": 8}}, "take --examination.tryout 0"),
        ({"rollout": {"starts": 4, "promote": 0.5}}, "take --rollout.promote 1 for amphibian"),
        ({"controller": {"skills": 2, "skill": 1}}, "commands its skills; leave it out"),
        (
            {"rollout": {"starts": 4, "promote": 1.0, "seconds": 1.5}, "fitness": {}},
            "fitness.swim.settle shorter",
        ),
    ],
)
def test_settings_that_do_not_suit_the_skills_are_refused(changed: dict[str, Any], sentence: str):
    config = config_of(**changed)
    with pytest.raises(UserError, match=sentence):
        check_fit(load_creature("blocks"), config)


def test_a_following_skill_needs_a_second_trial():
    config = config_of(
        use={"controller": "brain", "task": "all-trades"},
        controller={"skills": 4},
        rollout={"starts": 4, "promote": 1.0},
        fitness={},
    )
    with pytest.raises(UserError, match="take a multiple of 4 from 8 on"):
        check_fit(load_creature("blocks"), config)


def test_part_of_a_skills_table_leaves_its_other_defaults():
    fitness = config_of(fitness={"roam": {"tilt": 30.0, "weights": {"balance": 2.0}}}).fitness
    assert (fitness.roam.tilt, fitness.roam.weights.vibration) == (30.0, 1.0)


def test_a_single_task_has_no_skills():
    assert skills_of("swim") == ()
    assert skills_of("nothing") == ()


@pytest.fixture
def concluded(champion: Champion, tmp_path: Path) -> Path:
    """A run folder with a champion and its certificate by short examinations."""
    creature = load_creature("blocks")
    folder = create_run(tmp_path / "run", creature, config_of())
    write_champion(champion, creature, folder / CHAMPION)
    short = tmp_path / "short.toml"
    short.write_text(SHORT)
    (folder / "skills" / "walk").mkdir(parents=True)
    (folder / "skills" / "walk" / "mine.txt").write_text("of the user")
    assert api.certify(folder, short).skills
    return folder


def test_every_skill_can_be_shown_and_examined_alone(concluded: Path):
    """Its folder holds champion, body, settings and its part of the certificate."""
    whole = json.loads((concluded / CERTIFICATE).read_text())
    for name, task in (("swim", "swim"), ("walk", "roam")):
        folder = concluded / "skills" / name
        creature, one = open_champion(folder)
        assert (one.task, open_run(folder)[1].rollout.seconds) == (task, 1.6)
        document = json.loads((folder / CERTIFICATE).read_text())
        assert document["champion"] == one.fingerprint
        own = [c for c in whole["criteria"] if c["name"].startswith(f"{name}: ")]
        assert [c["measures"] for c in own] == [c["measures"] for c in document["criteria"]]
        assert "NaN" not in (folder / CHAMPION).read_text()
        assert (abs(creature.model.opt.gravity[2]) > 0) == (name == "walk")
    assert (concluded / "skills" / "walk" / "mine.txt").read_text() == "of the user"


def test_what_shows_a_skill_is_not_trained(concluded: Path, capsys: pytest.CaptureFixture):
    walk = concluded / "skills" / "walk"
    for words in (("train", "--resume", walk), ("inspect", walk), ("plot", walk)):
        assert "it shows one skill of" in said_by(capsys, *words, code=2)
