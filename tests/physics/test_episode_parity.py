"""The same episodes through the fast step, plain MJX and the examiner: every figure must agree.

The examiner is C MuJoCo in float64 under a controller of its own; what its recording means for the
tally is worked out once more, in plain NumPy (`recorded_tally`). Nothing that changes the motion,
or what is counted of it, on one of the three ways can stay unseen.
"""

import dataclasses
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from certify_made_up import LEGS, TOML, TUNING, XML, make_champion
from helpers import small_config
from recorded_tally import Frames, end, tally_of

from mjxgait.certify import starts as examined
from mjxgait.certify.simulate import Outcome
from mjxgait.certify.simulate import simulate as examine
from mjxgait.champion import Champion
from mjxgait.config import Config
from mjxgait.creature import Creature, load_creature
from mjxgait.experiment import build_experiment
from mjxgait.gait import TUNING as GENES
from mjxgait.gait import Genome
from mjxgait.hyper import traced
from mjxgait.starts import NEVER, Starts
from mjxgait.tally import Reason, Tally

STEP, SECONDS = 0.005, 1.2
STEPS = round(SECONDS / STEP)
SLIM = {"xla_backend_optimization_level": 0}
"""Compiling is what takes the time here."""

BUMPER = (
    '<geom name="bumper" type="sphere" size="0.02" pos="-0.2 0 -0.262" mass="0.1" '
    'contype="4" conaffinity="0"/>'
)
"""Touches the floor in livelier moments. Neither it nor the trunk is carried by the floor: in
evolution nothing but feet is, and the examiner must not see another world."""
BODY = XML.replace(
    'mass="4" contype="0" conaffinity="1"/>', f'mass="4" contype="4" conaffinity="0"/>{BUMPER}'
)
TABLE = TOML.replace("torque_limit = 12.0", "torque_limit = 8.0").replace("[-45, 45]", "[-25, 40]")

GENES_OF_THE_GAIT = {
    "period": 0.4837,  # no pose falls on a step: float32 would decide which
    "steer": 1.0,
    "pitch": 0.3,
    "pitch_rate": 0.05,
    "roll": 0.4,
    "roll_rate": 0.03,
}
SETTINGS: dict[str, dict] = {
    "stable PD": {"controller": {"advance": "clock"}},
    "with constraint forces": {"controller": {"advance": "clock", "constraint_forces": True}},
    "by the pose error, soft, without an end": {
        "controller": {"stiffness": 0.7, "damping": 1.5},
        "rollout": {"terminate": False},
    },
    "plain PD, without the mirror": {
        "controller": {"advance": "clock", "law": "pd", "mirror": False},
    },
}
PUSH_AT = 60


@dataclasses.dataclass(frozen=True)
class Disturbance:
    """What is not nominal about a start. push: m/s forward and left."""

    friction: float = 1.0
    push: tuple[float, float] = (0.0, 0.0)
    joints: float = 0.0
    spin: float = 0.0


DISTURBANCES = {
    "nominal": Disturbance(),
    "half the friction": Disturbance(friction=0.5),
    "pushed forward": Disturbance(push=(0.3, 0.0)),
    "pushed to the left": Disturbance(push=(0.0, 0.25)),
    "joints displaced": Disturbance(joints=0.08),
    "joints moving": Disturbance(spin=0.8),
    "all at once": Disturbance(0.6, (-0.2, -0.2), 0.05, 0.5),
    "knocked over": Disturbance(push=(0.0, 3.0)),
}


@pytest.fixture(scope="module")
def body(tmp_path_factory: pytest.TempPathFactory) -> Creature:
    folder: Path = tmp_path_factory.mktemp("parity")
    (folder / "creature.xml").write_text(BODY)
    (folder / "creature.toml").write_text(TABLE)
    return load_creature(folder)


def poses(creature: Creature) -> np.ndarray:
    """A trot: one diagonal pair swings while the other pushes."""
    column = {name: i for i, name in enumerate(creature.joint_names)}
    found = np.zeros((2, 8))
    for leg in LEGS:
        swings = leg in ("front_left", "hind_right")
        found[:, column[f"{leg}_hip"]] = (-0.5, -0.2) if swings else (0.0, 0.2)
        found[:, column[f"{leg}_knee"]] = (0.75, 0.1) if swings else (0.1, 0.1)
    return found


def disturbed(creature: Creature) -> examined.Starts:
    """The disturbances as the examiner knows them."""
    rng = np.random.default_rng(1)
    plain = examined.nominal_starts(creature, len(DISTURBANCES))
    rows = list(DISTURBANCES.values())
    noise = rng.uniform(-1, 1, (2, 8))
    return dataclasses.replace(
        plain,
        joint_offset=np.array([row.joints * noise[0] for row in rows]),
        joint_velocity=np.array([row.spin * noise[1] for row in rows]),
        friction=np.array([row.friction for row in rows]),
        push=np.array([row.push for row in rows]),
        push_time=np.array([(PUSH_AT + 0.5) * STEP if any(row.push) else np.inf for row in rows]),
    )


def champion_of(creature: Creature, config: Config) -> Champion:
    champion = make_champion(creature, poses(creature), GENES_OF_THE_GAIT)
    return dataclasses.replace(champion, controller=config.controller)


@pytest.fixture(scope="module")
def configs() -> list[Config]:
    return [small_config(**tables) for tables in SETTINGS.values()]


@pytest.fixture(scope="module")
def outcomes(body: Creature, configs: list[Config]) -> list[Outcome]:
    """The examiner's, per settings; a frame more than an episode, for where the cycle goes next."""
    rows = disturbed(body)
    return [
        examine(body, champion_of(body, config), rows, SECONDS + STEP, record=len(rows))
        for config in configs
    ]


def starts_of(creature: Creature, films: list[Outcome]) -> Starts:
    """The same starts for evolution, [B, R]; the examiner lifts bodies with displaced joints."""
    rows, wanted = disturbed(creature), []
    push = np.zeros((len(rows), creature.model.nv))
    push[:, :2] = rows.push
    for outcome in films:
        film = outcome.trajectory
        at = np.where(np.isfinite(rows.push_time), PUSH_AT, NEVER)
        arrays = (film.qpos[:, 0], film.qvel[:, 0], rows.friction, push)
        wanted.append(Starts(*(jnp.asarray(a, jnp.float32) for a in arrays), jnp.int32(at)))
    return jax.tree.map(lambda *leaves: jnp.stack(leaves), *wanted)


@pytest.fixture(scope="module", params=["auto", "mjx"], ids=["the fast step", "plain MJX"])
def tallies(
    request: pytest.FixtureRequest, body: Creature, configs: list[Config], outcomes: list[Outcome]
) -> Tally:
    """Evolution's, leaves [B, 1, R, ...]."""
    rollout = {"seconds": SECONDS, "lanes": 3, "physics": request.param}
    simulator = build_experiment(body, small_config(rollout=rollout)).simulator
    genes = TUNING | GENES_OF_THE_GAIT
    genome = Genome(jnp.float32(poses(body)), jnp.float32([genes[name] for name in GENES]))
    genomes = jax.tree.map(lambda leaf: jnp.stack([leaf[None]] * len(configs)), genome)
    settings = jax.tree.map(lambda *leaves: jnp.stack(leaves), *map(traced, configs))
    arguments = (genomes, starts_of(body, outcomes), settings)
    program = jax.jit(simulator.simulate).lower(*arguments).compile(compiler_options=SLIM)
    return jax.device_get(program(*arguments)).tally


@pytest.fixture(scope="module")
def expected(
    body: Creature, configs: list[Config], outcomes: list[Outcome]
) -> dict[tuple[str, str], dict[str, np.ndarray]]:
    """What the examiner's recordings mean for the tally, by settings and disturbance."""
    found = {}
    for name, config, outcome in zip(SETTINGS, configs, outcomes, strict=True):
        clearance = config.fitness.clearance * body.hip_height
        for row, disturbance in enumerate(DISTURBANCES):
            frames = Frames(body, outcome.trajectory, row)
            steps, reason = end(frames)
            if steps > STEPS or not config.rollout.terminate:
                steps, reason = STEPS, Reason.FINISHED
            tally = tally_of(frames, steps, STEPS // 2, clearance)
            found[name, disturbance] = {**tally, "reason": reason}
    return found


COUNTS = {
    "contact": 2,
    "airborne": 2,
    "touch": 2,
    "stride_steps": 2,
    "saturation": 0.5,
    "limits": 0.5,
}
EXACT = ("steps", "reason", "strides", "swings", "swinging", "foot_down")
TOLERANCE = COUNTS | dict.fromkeys(EXACT, 0)
"""Of what is counted, in steps; all else may differ by 0.1 mm, or rad, or ..., and 0.2 %."""
UNCOMPARED: dict[str, str] = {}
"""Fields of the tally that have no counterpart in `recorded_tally`, with the reason."""
FIELDS = [field.name for field in dataclasses.fields(Tally) if field.name not in UNCOMPARED]
EPISODES = [(settings, disturbance) for settings in SETTINGS for disturbance in DISTURBANCES]


def tolerance(name: str, value: np.ndarray | float) -> float:
    """By which another way may differ from a value."""
    return TOLERANCE.get(name, 1e-4 + 2e-3 * float(np.abs(value).max()))


def test_every_field_of_the_tally_is_compared(expected: dict):
    for name in FIELDS:
        assert all(name in tally for tally in expected.values()), (
            f"Tally.{name} is compared with nothing: work it out in recorded_tally.py, or say in "
            f"UNCOMPARED why not"
        )


@pytest.mark.parametrize("name", FIELDS)
def test_the_tally_is_what_the_examiner_saw(tallies: Tally, expected: dict, name: str):
    rows = dict(zip(EPISODES, np.reshape(getattr(tallies, name), (len(EPISODES), -1)), strict=True))
    for episode, ours in rows.items():
        theirs = np.ravel(np.asarray(expected[episode][name], float))
        most = tolerance(name, theirs)
        np.testing.assert_allclose(ours, theirs, rtol=0, atol=most, err_msg=str(episode))


@pytest.mark.parametrize("name", [name for name in FIELDS if name != "reason"])
def test_every_field_has_something_to_show(expected: dict, name: str):
    """A figure that is next to zero in all episodes would agree with anything."""
    values = [np.asarray(tally[name], float) for tally in expected.values()]
    assert any(np.abs(value).max() > 3 * tolerance(name, value) for value in values)


def apart(one: dict, other: dict) -> float:
    """How many tolerances two episodes differ by in where they lead."""
    places = ("forward", "left", "heading")
    return max(abs(one[name] - other[name]) / tolerance(name, one[name]) for name in places)


@pytest.mark.parametrize("disturbance", list(DISTURBANCES)[1:])
def test_every_disturbance_shows(expected: dict, disturbance: str):
    one, other = (expected["stable PD", name] for name in (disturbance, "nominal"))
    assert apart(one, other) > 5


@pytest.mark.parametrize("settings", list(SETTINGS)[1:])
def test_all_settings_show(expected: dict, settings: str):
    one, other = (expected[name, "pushed to the left"] for name in (settings, "stable PD"))
    assert apart(one, other) > 5


def test_a_fall_ends_the_episode_where_the_examiner_sees_it(
    outcomes: list[Outcome], tallies: Tally
):
    """Why it ended has been compared above; the examiner dates a fall by the end of its step."""
    knocked = list(DISTURBANCES).index("knocked over")
    ends = {name: n for n, name in enumerate(SETTINGS) if "without an end" not in name}
    for name, row in ends.items():
        fell = round(outcomes[row].fell[knocked] / STEP)
        assert PUSH_AT < fell < STEPS, name
        assert tallies.steps[row, 0, knocked] == fell, name
        assert tallies.reason[row, 0, knocked] != Reason.FINISHED
