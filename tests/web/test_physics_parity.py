"""A page's physics and controller, in Node, against the examiner's, frame by frame.

Both are MuJoCo in float64. Measured on 30 November 2026, WebAssembly 3.14 against Python 3.17, in
5 s: at most 1e-13 m or rad for key poses and expressions, disturbed or not, and 5e-11 for a brain
in water. Bodies of blocks are chaotic: see `CHAOTIC`.
"""

import dataclasses
import json
import subprocess
from importlib import resources
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from helpers import altered, pose_champion
from rendering.made_up import falling, treading
from web.brains import examined, that_feels_its_blocks, with_a_brain
from web.engine import engine_folder, node

from mjxgait.champion import serializer_of
from mjxgait.config.layers import data_folder
from mjxgait.controllers.config import DriveConfig
from mjxgait.controllers.expressions.written import written_champion
from mjxgait.controllers.key_poses.config import PoseConfig
from mjxgait.controllers.network.config import NetworkConfig
from mjxgait.creature import load_creature
from mjxgait.creature.anatomy import Stepping
from mjxgait.creature.geometry import posed
from mjxgait.creature.ground.spec import parse_ground
from mjxgait.plugins import resolve_config
from mjxgait.plugins.registry import build_config
from mjxgait.reference.layout import LowestPoint, colliding_geoms
from mjxgait.reference.terrain import terrain_of
from mjxgait.training.folder import open_champion
from mjxgait.web.facts import facts_of

WALK = Path(__file__).parents[2] / "docs" / "data" / "walk"
TOLERANCE = 1e-10
"""m or rad; torques relative to the largest."""
CHAOTIC = {"a brain in water": 1e-8, "a brain on land": 1e-7, "two brains at a cube": 1e-4}
"""Tolerance in 5 s where rounding errors grow, because joints bend to their ends and blocks
collide. A brain in water differs by 1e-12 after 3.4 s and 5e-11 (torques: 2e-10) after 5 s; a brain
on land by 1e-12 after 2.5 s, 1e-10 after 4.9 s and 6e-10 after 5 s; two brains at a cube by 1e-12
after 0.9 s, 1e-10 after 1.9 s, 1e-8 after 2.5 s and 2e-7 (torques: 2e-6) after 5 s.
"""
CALM = 0.8
"""s in which all motions agree within `TOLERANCE`."""
ROUGH_TOLERANCE = 1e-5
"""m or rad in 5 s on rough ground, with heights in float32 of another scale. Measured:
4e-7 for an evolved walk on round feet. Blocks cannot be compared: contacts of a box with a height
field jump, such that heights that differ by 1e-9 m move a body of blocks by 1 cm after 0.3 s, also
in the examiner alone.
"""
DISTURBED = {"mass": 1.1, "friction": 0.7, "slope": (0.03, -0.02)}
PUSH = {"step": 150, "speed": (0.3, 0.2)}


def leaning(stool, steps=False):
    """The stool with weights for all corrections."""
    rng, joints = np.random.default_rng(1), len(stool.joints.names)

    def weights():
        return rng.uniform(-0.3, 0.3, joints)

    legs = tuple(i % len(stool.feet.names) for i in range(joints))
    names = ("steer_bend", "steer_stride", "balance_pitch", "balance_roll")
    stepping = Stepping(weights(), weights(), weights(), legs) if steps else None
    return altered(stool, corrections={n: weights() for n in names} | {"stepping": stepping})


def steps_under_a_fall(stool):
    """A champion that uses all genes of a body that steps."""
    creature = leaning(stool, steps=True)
    genes = {"steer": 1.0, "pitch": 0.5, "pitch_rate": 0.05, "roll": 0.4, "roll_rate": 0.03}
    steps = {"step": 0.5, "step_rate": 0.4, "side": 0.3, "side_rate": 0.2, "hold": 0.4}
    more = {"hold_rate": 0.1, "sway": 0.3, "sway_rate": 0.1, "begin": 0.6, "turn": 0.3}
    poses = treading(stool, degrees=8.0).genome["key_poses"]
    return creature, pose_champion(creature, poses, genes | steps | more | {"threshold": 0.05})


def by_the_clock(stool):
    """Advanced by the clock, turning, under plain PD."""
    creature, genes = leaning(stool), {"period": 0.437, "steer": 1.2, "roll": 0.5}
    champion = pose_champion(
        creature,
        treading(stool, degrees=8.0).genome["key_poses"],
        genes,
        PoseConfig(advance="clock", steering=2.0, mirror=False, interpolation=7),
        DriveConfig(law="pd", stiffness=0.8, damping=1.3),
    )
    return creature, dataclasses.replace(champion, wish={"turn": 25.0})


def with_forces(stool):
    """Stable PD with the constraint forces of the step before."""
    plain = treading(stool, degrees=6.0)
    return stool, dataclasses.replace(plain, drive=DriveConfig(constraint_forces=True))


PROGRAM = """(list
    (* 0.2 (- (ifltz a0 (* 2 pz) (min a2 w0)) (/ a1 (+ t 0.5))))
    (+ (* 0.3 (- s0 vx)) (* 0.1 (+ c0 pitch)))
    (* 0.3 (max (sin (* 9 beat)) (- (cos (* 3 px)) (abs vz)))))"""


def with_expressions():
    """The lamp under a program with most functions and observations, held for four steps."""
    luxo = load_creature(data_folder("envs") / "luxo")
    usual = dataclasses.asdict(resolve_config(luxo.settings.train, "luxo"))
    with TemporaryDirectory() as folder:
        file = Path(folder) / "program.txt"
        file.write_text(PROGRAM)
        champion = written_champion(luxo, build_config(usual, "luxo"), file)
    assert champion.settings.every == 4
    return luxo, champion


def with_a_network(stool):
    """The stool, which treads as a network says that observes all of its inputs."""
    settings, rng = NetworkConfig(hidden=(5,), period=0.6), np.random.default_rng(6)
    shapes = serializer_of("network").shapes(settings, stool)
    genome = {name: rng.normal(0.0, 0.1, shape) for name, shape in shapes.items()}
    plain = treading(stool)
    return stool, dataclasses.replace(plain, controller="network", genome=genome, settings=settings)


def two_brains():
    """A contest of a body with its like."""
    champion = with_a_brain("follow-on-land")[1]
    theirs = {f"opponent.{name}": array for name, array in champion.genome.items()}
    contest = dataclasses.replace(champion, task="compete", genome=champion.genome | theirs)
    return contest.embodied(load_creature(data_folder("envs") / "blocks")), contest


CASES = {
    # name: creature and champion, s, disturbances, push
    "evolved": lambda stool: (*open_champion(WALK), 5.0, None, None),
    "evolved, disturbed": lambda stool: (*open_champion(WALK), 5.0, DISTURBED, PUSH),
    "steps under a fall": lambda stool: (*steps_under_a_fall(stool), 5.0, None, PUSH),
    "by the clock": lambda stool: (*by_the_clock(stool), 5.0, None, None),
    "constraint forces": lambda stool: (*with_forces(stool), 5.0, None, None),
    "falls": lambda stool: (stool, falling(stool), 5.0, None, None),
    "expressions": lambda stool: (*with_expressions(), 5.0, None, None),
    "a network": lambda stool: (*with_a_network(stool), 5.0, None, PUSH),
    "a brain on land": lambda stool: (*with_a_brain("follow-on-land"), 5.0, DISTURBED, None),
    "two brains at a cube": lambda stool: (*two_brains(), 5.0, DISTURBED, None),
    "a brain in water": lambda stool: (*with_a_brain("follow"), 5.0, None, PUSH),
    "a brain that feels its blocks": lambda stool: (*that_feels_its_blocks(), 5.0, None, None),
}


def case(creature, champion, seconds, disturbed=None, push=None, rough=()):
    """A case for `walk.mjs`."""
    return {
        "facts": facts_of(creature, champion),
        "steps": round(seconds / creature.model.opt.timestep),
        "disturbed": disturbed,
        "push": push,
        "rough": list(rough),
    }


def in_node(cases):
    """What the page's scripts compute, of all cases in one Node process."""
    assets = resources.files("mjxgait.web") / "assets"
    order = {"engine": str(engine_folder()), "assets": str(assets), "cases": cases}
    done = subprocess.run(
        [node(), str(Path(__file__).with_name("walk.mjs"))],
        input=json.dumps(order),
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@pytest.fixture(scope="module")
def walked(stool):
    """All cases: what the page and the examiner compute."""
    made = {name: make(stool) for name, make in CASES.items()}
    found = in_node([case(*given) for given in made.values()])
    return {
        name: (here, examined(*given))
        for (name, given), here in zip(made.items(), found, strict=True)
    }


@pytest.mark.parametrize("name", CASES)
def test_a_page_simulates_what_the_examiner_simulates(walked, name):
    here, (qpos, target, fell) = walked[name]
    scale = np.abs(target).max() if "brain" in name else 1.0
    off = np.maximum(
        np.abs(np.array(here["qpos"]) - qpos).max(1),
        np.abs(np.array(here["target"]) - target).max(1) / scale,
    )
    assert off[: round(CALM / 5.0 * len(off))].max() < TOLERANCE
    assert off.max() < CHAOTIC.get(name, TOLERANCE)
    assert here["fell"] == (None if np.isinf(fell) else pytest.approx(fell))


def test_the_comparison_can_fail(stool, walked):
    """Each setting and disturbance changes the motion by far more than the tolerance."""
    plain, disturbed = (walked[name][1][0] for name in ("evolved", "evolved, disturbed"))
    before = PUSH["step"]
    assert np.abs(plain[:before] - disturbed[:before]).max() > 1e5 * TOLERANCE
    assert np.isfinite(walked["falls"][1][2])
    assert np.isinf(walked["evolved"][1][2])
    for name in ("expressions", "a network"):
        assert np.ptp(walked[name][1][1], axis=0).min() > 0.01
    for name in ("a brain on land", "two brains at a cube", "a brain in water"):
        assert np.abs(walked[name][1][1]).max() > 0.01, "N·m"
    for name, change in {
        "by the clock": {"wish": {}},
        "steps under a fall": {"drive": DriveConfig(law="pd")},
        "constraint forces": {"drive": DriveConfig()},
    }.items():
        creature, champion, seconds, disturbed, push = CASES[name](stool)
        other = dataclasses.replace(champion, **change)
        changed, _, _ = examined(creature, other, seconds, disturbed, push)
        assert np.abs(changed - walked[name][1][0]).max() > 1e5 * TOLERANCE, name


def test_a_hand_lifts_the_creature_and_lets_it_go(walked):
    pulls = walked["evolved"][0]["pulls"]
    before, rising, held, after = (
        np.array(pulls[key]) for key in ("before", "rising", "held", "after")
    )
    # The spring gives way by the weight over its stiffness, some 15 cm.
    assert 0.7 < held[2] - before[2] < 1.0
    assert np.abs(held - rising).max() < 0.02
    assert np.abs(held[:2] - before[:2]).max() < 0.3
    assert after[2] < held[2] - 0.3


def rough_at(step, size):
    return {"step": step, "size": size}


CHANGES = [rough_at(500, 0.15), rough_at(700, 0.0), rough_at(800, 0.1)]


@pytest.fixture(scope="module")
def roughed():
    """The evolved walk on rough ground, and on a floor that changes in between."""
    walks = [[rough_at(0, 0.05)], CHANGES]
    return in_node([case(*open_champion(WALK), 5.0, rough=rough) for rough in walks])


def test_the_rough_floor_is_that_of_the_examiner(roughed):
    """The walk leads out of the first patch, which ends after 4 m."""
    creature, champion = open_champion(WALK)
    uneven = dataclasses.replace(creature, terrain=parse_ground("rough:0.05"))
    qpos, _, fell = examined(uneven, champion, 5.0, None, None)
    assert np.abs(np.array(roughed[0]["qpos"]) - qpos).max() < ROUGH_TOLERANCE
    assert roughed[0]["fell"] is None
    assert np.isinf(fell)
    assert np.abs(qpos[-1, :2] - qpos[0, :2]).max() > 4.5
    plain, _, _ = examined(creature, champion, 5.0, None, None)
    assert np.abs(plain - qpos).max() > 1e3 * ROUGH_TOLERANCE


def test_heights_are_above_the_rough_floor(roughed):
    creature, _ = open_champion(WALK)
    uneven = dataclasses.replace(creature, terrain=parse_ground("rough:0.05"))
    data = posed(creature.model, np.array(roughed[0]["last"]))
    lowest = LowestPoint(creature.model, colliding_geoms(creature.model), terrain_of(uneven))
    there = lowest.heights(data.geom_xpos[None], data.geom_xmat.reshape(1, -1, 9))[0]
    np.testing.assert_allclose(roughed[0]["heights"], there, rtol=0, atol=1e-9)


def test_a_creature_is_lifted_out_of_a_floor_that_rises(roughed):
    creature, _ = open_champion(WALK)
    height = np.array(roughed[1]["qpos"])[:, creature.root_qpos + 2]
    steps = [one["step"] for one in CHANGES]
    # Feet of a walk are up to 5 mm in the floor.
    assert min(roughed[1]["lowest"]) > -0.006
    assert max(height[steps] - height[np.subtract(steps, 1)]) > 0.01
    assert height.max() < 2 * height[0]
