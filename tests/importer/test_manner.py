"""How a body of its class is to be evolved, by what an import knows of it."""

import dataclasses
from typing import Any

import pytest

from mjxgait.certification import CertificateConfig
from mjxgait.config.layers import over_base
from mjxgait.config.schema import Config
from mjxgait.config.tables import build
from mjxgait.importer.notes import Notes
from mjxgait.importer.train_table import Traits, train_table
from mjxgait.tasks.walk.gaits import transition

STEP = 0.005
BIPED = Traits(
    steps=True,
    legs=2,
    hinges=12,
    symmetric=True,
    hip=0.8,
    length=0.8,
    mass=30.0,
    time_step=STEP,
    rotor=0.01,
    skeleton=False,
)


def told(**facts: Any) -> tuple[Config, Notes]:
    """Settings of `BIPED` with other traits, and the notes on them."""
    notes = Notes()
    table = train_table(dataclasses.replace(BIPED, **facts), notes)
    return build(Config, over_base(table, "the table"), "the table"), notes


def shortest_cycle(config: Config) -> float:
    """Seconds in which the target can pass through all poses and their images."""
    return 2 * config.controller.key_poses * config.controller.interpolation * STEP


def test_a_robot_on_four_feet_is_evolved_as_the_shipped_duck_is():
    """Late torques, falls and leaps that cost, many first individuals; feet may not whip, short
    walks are judged leniently, and cycles are no hastier than an animal's. All else is as usual,
    and all of it in an ant with motors heavier than itself: with them its feet flickered more. A
    character has its usual cycles.
    """
    robot, usual = told(steps=False)[0], Config()
    character, ant = (told(steps=False, **own)[0] for own in ({"skeleton": True}, {"rotor": 30.0}))
    weights, plain = robot.fitness.weights, usual.fitness.weights
    assert weights.foot_speed > plain.foot_speed == 0
    assert (weights.fall, weights.airborne) == (1.0, 3 * plain.airborne)
    own = {"foot_speed": weights.foot_speed, "fall": weights.fall, "airborne": weights.airborne}
    assert weights == dataclasses.replace(plain, **own)
    assert robot.fitness == dataclasses.replace(usual.fitness, weights=weights, leniency=1.0)
    assert character.fitness.leniency == ant.fitness.leniency == usual.fitness.leniency == 0
    assert (robot.rollout.latency, robot.evolution.initial_choice) == (1, 4)
    assert (ant.rollout.latency, ant.evolution.initial_choice) == (0, 1)
    assert (character.rollout, character.evolution) == (robot.rollout, robot.evolution)
    assert character.controller == ant.controller == usual.controller
    calm = dataclasses.replace(usual.controller, interpolation=robot.controller.interpolation)
    assert robot.controller == calm
    assert shortest_cycle(robot) >= 0.99 / transition(BIPED.mass) > shortest_cycle(usual)
    assert robot.evolution.generations == usual.evolution.generations
    for key in ("starts", "promote", "push", "joint_noise"):
        assert getattr(robot.rollout, key) == getattr(usual.rollout, key)


def test_a_body_of_many_hinges_is_first_of_all_to_stay_up():
    """A dog of 39: hardly one of the first genomes walks, and who falls ahead gets farther than who
    stays up.
    """
    many, few = (told(steps=False, legs=4, hinges=hinges)[0] for hinges in (25, 24))
    assert many.fitness.weights.alive > 0 == few.fitness.weights.alive
    assert many.evolution.sigma < few.evolution.sigma
    assert many.rollout == few.rollout
    assert many.fitness.speed == few.fitness.speed
    assert told(hinges=12)[0] == told(hinges=13)[0]
    bouncing, _ = told(steps=False, legs=4, hinges=25, rotor=30.0)
    plain = dataclasses.replace(many.fitness.weights, fall=0.0, airborne=3.0)
    own = {"contact": 0.0, "leniency": 0.0, "weights": plain}
    assert bouncing.fitness == dataclasses.replace(many.fitness, **own)


def test_a_character_walks_at_leisure_and_pays_for_feet_that_flicker():
    """On two feet none was seen to flicker, and slower it would stand on one."""
    robot, character = (told(steps=False, skeleton=skeleton)[0] for skeleton in (False, True))
    assert character.fitness.weights.patter > robot.fitness.weights.patter == 0.0
    assert character.fitness.weights.overlap == 3 * robot.fitness.weights.overlap
    assert character.fitness.weights.slip == 2 * robot.fitness.weights.slip
    least = CertificateConfig().progress.speed
    assert 1.2 * least < character.fitness.speed < robot.fitness.speed
    standing, character = (told(skeleton=skeleton)[0].fitness for skeleton in (False, True))
    assert character.weights.overlap > standing.weights.overlap
    assert character.weights.distance < standing.weights.distance
    apart = {name: getattr(standing.weights, name) for name in ("overlap", "distance")}
    apart = dataclasses.replace(character.weights, **apart)
    assert dataclasses.replace(character, weights=apart) == standing


def test_a_body_on_two_feet_walks_longer_and_begins_with_a_choice():
    """In 8 s a dinosaur and a humanoid get faster and do not yet fall; they fell after 9 to 16 s. A
    hopper on one leg was not certified so.
    """
    two, one, usual = told()[0], told(legs=1)[0], Config()
    assert two.rollout.seconds >= 1.5 * usual.rollout.seconds == 1.5 * one.rollout.seconds
    assert two.evolution.initial_choice > 1 == one.evolution.initial_choice


def test_a_foot_of_one_that_bounces_is_down_where_it_bears_weight():
    """As both ants do, whose motors are heavier to turn than all of them."""
    calm, bouncing = (told(steps=False, rotor=rotor)[0] for rotor in (0.1, 30.0))
    assert bouncing.fitness.contact == 0.0 < calm.fitness.contact
    assert told(steps=True, rotor=30.0)[0].fitness.contact == calm.fitness.contact


@pytest.mark.parametrize("steps", [True, False])
def test_it_meets_other_starts_in_each_generation_and_parents_die(steps: bool):
    config, notes = told(steps=steps)
    assert config.rollout.variety == config.evolution.generations
    assert (config.evolution.survival, config.evolution.remember) == ("children", True)
    assert config.evolution.elites > 1
    assert not config.evolution.forced.enabled
    assert [guess.what for guess in notes.guesses] == ["train"]


def test_its_children_differ_little():
    """Two joints drawn anew, as others have it, fell nearly every child of one that stays up."""
    few, four = (told(steps=steps)[0].evolution for steps in (True, False))
    assert few.mutation == four.mutation == "gaussian"
    assert few.sigma < four.sigma < Config().evolution.sigma


@pytest.mark.parametrize("steps", [True, False])
def test_it_is_chosen_on_as_many_starts_as_it_is_examined_on(steps: bool):
    """Who bears the few that it was chosen on may have no room for those that it never saw."""
    config, _ = told(steps=steps)
    assert config.examination.draws == CertificateConfig().starts.count


@pytest.mark.parametrize(
    ("hip", "kind"),
    [(0.6, {}), (0.8, {}), (1.6, {}), (0.8, {"steps": False, "legs": 4, "hinges": 40})],
)
def test_its_cycle_leads_through_no_strides_that_the_certificate_calls_too_short(
    hip: float, kind: dict[str, Any]
):
    """At the speed that is wanted of it, however fast its poses follow each other."""
    config, _ = told(hip=hip, length=0.8, mass=1.0, **kind)
    stride = config.fitness.speed * 0.8 * shortest_cycle(config)
    assert CertificateConfig().gait.stride_length == 0.5
    assert stride == pytest.approx(0.5 * hip, rel=0.05)


@pytest.mark.parametrize("mass", [100.0, 700.0, 4000.0])
def test_the_cycle_of_a_heavy_body_is_no_shorter_than_an_animals(mass: float):
    """Heavy figures on two feet run at the shortest cycle that they may."""
    frequency = 1 / shortest_cycle(told(mass=mass)[0]) / transition(mass)
    assert frequency == pytest.approx(1.0, rel=0.05)
    assert frequency < CertificateConfig().gait.frequency


def test_a_low_one_may_hurry_as_much_as_the_others():
    config, _ = told(hip=0.05, mass=0.1)
    assert config.controller.interpolation == Config().controller.interpolation


@pytest.mark.parametrize("steps", [True, False])
def test_without_a_left_and_a_right_the_whole_cycle_is_evolved(steps: bool):
    config, _ = told(steps=steps, symmetric=False)
    assert config.controller.key_poses == 2 * Config().controller.key_poses
    # Two poses and their images, or four: a cycle takes as long.
    assert told(steps=steps)[0].controller.interpolation == config.controller.interpolation


def test_who_has_one_leg_hops():
    """It is in the air between its hops, which lead far enough only if it is to be fast; and it
    meets disturbances little by little.
    """
    one, two = (told(legs=legs)[0].fitness for legs in (1, 2))
    assert one.weights.airborne == 0 < two.weights.airborne
    assert one.speed > two.speed
    assert one.hardening > 0
    assert one.weights == dataclasses.replace(two.weights, airborne=0.0)
