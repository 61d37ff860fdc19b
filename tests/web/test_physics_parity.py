"""A page's physics and controller, in Node, against the examiner's, frame by frame.

Both are MuJoCo in float64. Measured on 27 November 2026 with WebAssembly 3.14 and Python 3.17: the
largest difference of any walk below in 5 s is in `docs/guide/seeing.md`.
"""

import dataclasses
import json
import subprocess
from importlib import resources
from pathlib import Path

import numpy as np
import pytest
from helpers import pose_champion, altered
from rendering.made_up import falling, treading
from web.engine import engine_folder, node

from mjxgait.certification.trials import simulate
from mjxgait.controllers.key_poses.config import DriveConfig, PoseConfig
from mjxgait.creature.anatomy import Stepping
from mjxgait.reference.starts import nominal_starts
from mjxgait.training.folder import open_champion
from mjxgait.web.facts import facts_of

WALK = Path(__file__).parents[2] / "docs" / "data" / "walk"
SECONDS = 5.0
TOLERANCE = 1e-8
"""m or rad, after 5 s."""
DISTURBED = {"mass": 1.1, "friction": 0.7, "slope": (0.03, -0.02)}
PUSH = {"step": 400, "speed": (0.3, 0.2)}


def steps_under_a_fall(stool):
    """A body with weights for steps under a fall, and a champion that uses all of its genes."""
    rng, joints = np.random.default_rng(1), len(stool.joints.names)

    def weights():
        return rng.uniform(-0.3, 0.3, joints)

    legs = tuple(i % len(stool.feet.names) for i in range(joints))
    stepping = Stepping(weights(), weights(), weights(), legs)
    creature = altered(
        stool,
        corrections={
            "stepping": stepping,
            "steer_bend": weights(),
            "steer_stride": weights(),
            "balance_pitch": weights(),
            "balance_roll": weights(),
        },
    )
    genes = {"steer": 1.0, "pitch": 0.5, "pitch_rate": 0.05, "roll": 0.4, "roll_rate": 0.03}
    steps = {"step": 0.5, "step_rate": 0.4, "side": 0.3, "side_rate": 0.2, "hold": 0.4}
    more = {"hold_rate": 0.1, "sway": 0.3, "sway_rate": 0.1, "begin": 0.6, "turn": 0.3}
    poses = stool.joints.stand + rng.uniform(-0.15, 0.15, (2, joints))
    return creature, pose_champion(creature, poses, genes | steps | more | {"threshold": 0.05})


def by_the_clock(stool):
    """Advanced by the clock, turning, under plain PD."""
    plain, genes = treading(stool, degrees=8.0), {"period": 0.437, "steer": 1.2, "roll": 0.5}
    champion = pose_champion(
        stool,
        plain.genome["key_poses"],
        genes,
        PoseConfig(advance="clock", steering=2.0, mirror=False, interpolation=7),
        DriveConfig(law="pd", stiffness=0.8, damping=1.3),
    )
    return stool, dataclasses.replace(champion, wish={"turn": 25.0})


def with_forces(stool):
    """Stable PD with the constraint forces of the step before."""
    plain = treading(stool, degrees=6.0)
    return stool, dataclasses.replace(plain, drive=DriveConfig(constraint_forces=True))


CASES = {
    "evolved": lambda stool: (*open_champion(WALK), None, None),
    "evolved, disturbed": lambda stool: (*open_champion(WALK), DISTURBED, PUSH),
    "steps under a fall": lambda stool: (*steps_under_a_fall(stool), None, PUSH),
    "by the clock": lambda stool: (*by_the_clock(stool), None, None),
    "constraint forces": lambda stool: (*with_forces(stool), None, None),
    "falls": lambda stool: (stool, falling(stool), None, None),
}


def examined(creature, champion, disturbed=None, push=None):
    """The same by the examiner: poses [T, nq], targets [T, J], and s until the fall or infinity."""
    plain = nominal_starts(creature, 1)
    starts = plain
    if disturbed:
        starts = dataclasses.replace(
            starts,
            mass=plain.mass * disturbed["mass"],
            friction=plain.friction * disturbed["friction"],
            slope=np.array([disturbed["slope"]]),
        )
    if push:
        moment = (push["step"] + 0.5) * creature.model.opt.timestep
        starts = dataclasses.replace(
            starts, push_time=np.array([moment]), push=np.array([push["speed"]])
        )
    outcome = simulate(creature, champion, starts, SECONDS, record=1, threads=1)
    film = outcome.trajectory
    return film.qpos[0], film.target[0], outcome.fell[0]


@pytest.fixture(scope="module")
def walked(stool):
    """All cases in one Node process: what the page and the examiner compute."""
    made = {name: make(stool) for name, make in CASES.items()}
    assets = resources.files("mjxgait.web") / "assets"
    cases = [
        {
            "facts": facts_of(creature, champion),
            "steps": round(SECONDS / creature.model.opt.timestep),
            "disturbed": disturbed,
            "push": push,
        }
        for creature, champion, disturbed, push in made.values()
    ]
    order = {"engine": str(engine_folder()), "assets": str(assets), "cases": cases}
    done = subprocess.run(
        [node(), str(Path(__file__).with_name("walk.mjs"))],
        input=json.dumps(order),
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return {
        name: (here, examined(*case))
        for (name, case), here in zip(made.items(), json.loads(done.stdout), strict=True)
    }


@pytest.mark.parametrize("name", CASES)
def test_a_page_simulates_what_the_examiner_simulates(walked, name):
    here, (qpos, target, fell) = walked[name]
    # After a fall contacts pile up, and rounding grows.
    until = len(qpos) if np.isinf(fell) else round(fell / (SECONDS / len(qpos)))
    assert np.abs(np.array(here["qpos"]) - qpos)[:until].max() < TOLERANCE
    assert np.abs(np.array(here["target"]) - target)[:until].max() < TOLERANCE
    assert here["fell"] == (None if np.isinf(fell) else pytest.approx(fell))


def test_the_cases_differ_by_more_than_the_tolerance(walked):
    """The comparison can fail: disturbances, steps and turns change the end of the walk."""
    plain, disturbed = (walked[name][1][0] for name in ("evolved", "evolved, disturbed"))
    early = PUSH["step"]
    assert np.abs(plain - disturbed)[:early].max() > 1000 * TOLERANCE
    assert np.isfinite(walked["falls"][1][2])
    assert all(np.isinf(walked[name][1][2]) for name in ("evolved", "by the clock"))
    bodies = [walked[name][1][0][-1] for name in ("by the clock", "constraint forces")]
    assert np.abs(bodies[0] - bodies[1]).max() > 1000 * TOLERANCE


def test_a_hand_lifts_the_creature_and_lets_it_go(walked):
    pulls = walked["evolved"][0]["pulls"]
    before, held, after = (np.array(pulls[key]) for key in ("before", "held", "after"))
    # The spring gives way by the weight over its stiffness, some 15 cm.
    assert 0.7 < held[2] - before[2] < 1.0
    assert np.abs(held[:2] - before[:2]).max() < 0.3
    assert after[2] < held[2] - 0.3
