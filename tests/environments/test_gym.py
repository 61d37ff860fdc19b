"""Gymnasium environments: its own checks, and what an episode returns.

`test_functional` compares them with the functional environment.
"""

import shutil
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest
from helpers import STOOL

from mjxgait.errors import UserError
from mjxgait.extras import install_command
from mjxgait.reference.bodies import Bodies

gymnasium = pytest.importorskip("gymnasium")

from gymnasium.utils.env_checker import check_env  # noqa: E402

from mjxgait.gym_envs import env_ids, make_env  # noqa: E402

LEFT_OUT = pytest.mark.thorough("its task has passed with another body")
ALWAYS = ("mjxgait/TallQuadruped-v0", "mjxgait/Luxo-v0")
"""One body for each default task."""


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=() if name in ALWAYS else LEFT_OUT) for name in sorted(env_ids())],
)
def test_each_shipped_environment_passes_gymnasiums_checks(name: str):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.filterwarnings("ignore", message=".*Box observation space.*infinity.*")
        check_env(gymnasium.make(name).unwrapped)


def test_ids_are_the_names_of_creatures_with_a_body():
    assert env_ids()["mjxgait/TallQuadruped-v0"] == "tall_quadruped"
    assert "mjxgait/Blocks-v0" not in env_ids()


@pytest.fixture(scope="module")
def stool_env():
    settings = {"rollout": {"seconds": 0.4, "push": 0.5, "latency": 2, "masses": 0.2}}
    return make_env(str(STOOL), settings=settings)


def episode(env, seed: int, action: np.ndarray) -> list[tuple]:
    env.reset(seed=seed)
    steps = []
    while not steps or not (steps[-1][2] or steps[-1][3]):
        steps.append(env.step(action))
    return steps


def test_an_episode_returns_its_fitness_and_is_cut_at_its_time(stool_env):
    steps = episode(stool_env, 1, np.zeros(4))
    *_, (_, _, terminated, truncated, info) = steps
    assert (len(steps), terminated, truncated, info["reason"]) == (80, False, True, 0)
    assert np.isclose(sum(reward for _, reward, *_ in steps), info["fitness"], atol=1e-4)
    assert info["outcome_seconds"] == pytest.approx(0.4)
    assert not steps[0][4]


def test_seeds_draw_different_trials(stool_env):
    """A push in the middle of the episode included."""
    first, _ = stool_env.reset(seed=1)
    other, _ = stool_env.reset(seed=2)
    assert not np.array_equal(first, other)
    assert np.array_equal(stool_env.reset(seed=1)[0], first)


def test_bodies_that_blow_up_end_the_episode(stool_env, monkeypatch):
    stool_env.reset(seed=0)
    monkeypatch.setattr(Bodies, "sane", lambda bodies, rows: np.zeros(len(rows), bool))
    observation, reward, terminated, _, info = stool_env.step(np.zeros(4))
    assert (terminated, info["reason"]) == (True, -1)
    assert np.isfinite(observation).all()
    assert np.isfinite(reward)


def test_an_edited_body_is_another_environment(tmp_path: Path, monkeypatch):
    """In one process, under the name of the same folder."""
    monkeypatch.setattr("mjxgait.environments.gym.compiled", lambda problem: problem)
    monkeypatch.setattr("mjxgait.environments.gym.CreatureEnv", lambda problem: problem)
    shutil.copytree(STOOL, tmp_path / "stool")
    model = tmp_path / "stool" / "creature.xml"
    first, again = (make_env(str(tmp_path / "stool")) for _ in range(2))
    assert again is first
    model.write_text(model.read_text().replace("<mujoco", "<!-- edited -->\n<mujoco", 1))
    assert make_env(str(tmp_path / "stool")) is not first


def test_ground_that_is_not_flat_is_refused():
    with pytest.raises(UserError, match="stool: its Gymnasium environment has a flat floor"):
        make_env(str(STOOL), settings={"rollout": {"ground": "slope:0.1"}})


def test_without_gymnasium_it_is_one_sentence(monkeypatch):
    monkeypatch.delitem(sys.modules, "mjxgait.gym_envs")
    monkeypatch.setitem(sys.modules, "gymnasium", None)
    with pytest.raises(UserError, match="Gymnasium environments need an extra") as said:
        import mjxgait.gym_envs  # noqa: F401
    assert install_command("gym") in str(said.value)
