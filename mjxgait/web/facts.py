"""Numbers that a page needs to simulate a champion itself, as one JSON document.

The scripts in `assets/` read it. Names are those of
docs/reference/controller.md; angles in rad, lengths in m.
"""

import math
from collections.abc import Callable, Mapping, Sequence

import mujoco
import numpy as np

from mjxgait.certification import CertificateConfig
from mjxgait.certification.acceptance import task_rules
from mjxgait.champion import Champion, serializer_of
from mjxgait.controllers.key_poses.config import gene_names
from mjxgait.controllers.sims_brain.reference import (
    TICKS,
    BrainReference,
    brain_reference,
    opponent_reference,
)
from mjxgait.creature import Creature
from mjxgait.creature.geometry import support_extents
from mjxgait.creature.ground.spec import GroundSpec
from mjxgait.errors import UserError
from mjxgait.reference.bodies import Water
from mjxgait.reference.contest import contest_of
from mjxgait.reference.controllers import reference_of
from mjxgait.reference.layout import FLOOR, colliding_geoms, start_frame
from mjxgait.reference.own_contact import OwnContact
from mjxgait.reference.starts import nominal_starts
from mjxgait.reference.state import FOOT_SENSES, OWN_CONTACT
from mjxgait.reference.stepping import examined_model
from mjxgait.reference.terrain import BEHIND, CELLS, Terrain

Facts = dict[str, object]
ROUGHEST = 0.15
"""Largest height of rough ground above level that a visitor can choose, in hip heights."""
REACH, LEAST_REACH, CELLS_ASIDE = 4.0, 2.0, 120
"""Half the side of the simulated patch in body lengths, wanted and least, and its most cells."""
OPTIONS = ("iterations", "ls_iterations", "tolerance", "disableflags")
"""Settings of the examiner's solver that differ from the creature's file."""


def facts_of(creature: Creature, champion: Champion) -> Facts:
    """Return everything but MuJoCo that decides how a champion moves in a page.

    Raises:
      UserError: a page cannot simulate this controller, ground, or body.
    """
    _check(creature, champion)
    model, frame, start = examined_model(creature), creature.frame, start_frame(creature)
    task = task_rules(champion.task, champion.wish)
    fall = task.fall(CertificateConfig())
    aims = task.aimed(nominal_starts(creature, 1), CertificateConfig())
    reference = reference_of(creature, champion, float(model.opt.timestep))
    headings = task.commanded_heading(2, 1.0)
    watched, light = len(creature.feet.foot_of), aims.light[0]
    return {
        "xml": creature.files["creature.xml"],
        "options": {name: getattr(model.opt, name) for name in OPTIONS},
        "step": float(model.opt.timestep),
        "stand_qpos": creature.stand_qpos.tolist(),
        "stand_height": float(frame.stand_height),
        "trunk": creature.trunk,
        "root_dof": creature.root_dof,
        "axes": _lists(forward=frame.forward, left=frame.left, up=frame.up),
        "start": _lists(place=start.place, forward=start.forward, left=start.left),
        "joints": {"qpos": list(creature.joints.qpos), "dofs": list(creature.joints.dofs)},
        "drive": _drive(creature, champion) | {"command": reference.command},
        "water": _water(model, task.drag) if task.drag else None,
        "light": light.tolist() if light.any() else None,
        "turn": None if headings is None else float(headings[1]),
        "floor": float(model.geom(FLOOR).pos[2]),
        "roots": _roots(model, creature),
        "ground": None if task.drag else _ground(creature, model),
        "solid": [] if task.drag else _parts(model, colliding_geoms(model).tolist()),
        "goal": float(aims.goal[0]),
        "bar": _bounded(aims.bar[0, 0]),
        "feet": _feet(creature, seen=any(name in FOOT_SENSES for name in reference.reads)),
        "own_pairs": _own_pairs(model, np.array(creature.feet.stepping), reference.reads),
        "forbidden": _parts(model, creature.feet.watched_ids[watched:]),
        "fall": {
            "min_up": fall.min_up,
            "height": _bounded(np.array(fall.height)),
            "touch": fall.touch,
        },
        "kind": champion.controller,
        "controller": CONTROLLERS[champion.controller](creature, champion),
        "opponent": _opponent(creature, champion),
        "every": reference.every,
    }


def _check(creature: Creature, champion: Champion) -> None:
    name = creature.name
    if champion.controller not in CONTROLLERS:
        raise UserError(
            f"{name}: a page with physics runs key poses, expressions, networks and brains, not "
            f'the controller "{champion.controller}"; leave --physics out, and the page plays the '
            "recorded walk"
        )
    if task_rules(champion.task).next_goal(np.ones(1), np.ones(1), np.ones(1))[0] > 1:
        raise UserError(
            f'{name}: a page with physics has one goal, and those of "{champion.task}" move on; '
            "leave --physics out"
        )
    if not creature.terrain.flat:
        raise UserError(
            f"{name}: a page with physics has a plane floor, and this champion walks on "
            f'"{creature.terrain.kind}"; leave --physics out'
        )
    root = creature.model.body_jntadr[creature.trunk]
    if creature.model.jnt_type[root] != mujoco.mjtJoint.mjJNT_FREE:
        raise UserError(
            f"{name}: a page with physics needs a trunk that moves freely; leave --physics out"
        )
    champion.check_finite(creature)


def _lists(**arrays: np.ndarray) -> dict[str, list[float]]:
    return {name: np.asarray(array, float).tolist() for name, array in arrays.items()}


def _bounded(values: np.ndarray) -> list[float] | float:
    """JSON has no infinity; a number that no angle and no way reaches stands for it."""
    bounded: list[float] | float = np.nan_to_num(values, posinf=1e9, neginf=-1e9).tolist()
    return bounded


def _drive(creature: Creature, champion: Champion) -> Facts:
    gains, drive = creature.gains, champion.drive
    return {
        **_lists(
            kp=drive.stiffness * gains.kp, kd=drive.damping * gains.kd, limit=gains.torque_limit
        ),
        "law": drive.law,
        "constraint_forces": drive.constraint_forces,
    }


def _roots(model: mujoco.MjModel, creature: Creature) -> list[int]:
    """Addresses in qpos of all bodies that move freely, the creature's own first."""
    free = model.jnt_qposadr[model.jnt_type == mujoco.mjtJoint.mjJNT_FREE].tolist()
    return sorted(free, key=lambda address: (address != creature.root_qpos, address))


def _ground(creature: Creature, model: mujoco.MjModel) -> Facts:
    """Rough ground of one hip height, and the patch of it that is simulated about the creature.

    Cells are the examiner's, or larger for a long and low body. waves: [W, 4]; see `Terrain.waves`.
    """
    frame = creature.frame
    waves = Terrain(
        GroundSpec("rough", 1.0), start_frame(creature), frame.hip_height, frame.body_length
    ).waves
    length = frame.body_length
    cell = max(CELLS["rough"][0] * frame.hip_height, LEAST_REACH * length / CELLS_ASIDE)
    return {
        **_lists(waves=waves.T),
        "geom": int(model.geom(FLOOR).id),
        "name": FLOOR,
        "hip": float(frame.hip_height),
        "level": float(length),
        "cell": float(cell),
        "half": min(math.ceil(REACH * length / cell), CELLS_ASIDE),
        "origin": float(-BEHIND * length % cell),
        "most": ROUGHEST,
    }


def _parts(model: mujoco.MjModel, geoms: Sequence[int]) -> list[Facts]:
    """Geoms with the parameters of their support functions; see `support_extents`."""
    extents = [support_extents(int(model.geom_type[g]), model.geom_size[g]) for g in geoms]
    return [
        {"geom": int(g), "radius": float(radius), **_lists(box=box, ellipsoid=ellipsoid)}
        for g, (radius, box, ellipsoid) in zip(geoms, extents, strict=True)
    ]


def _feet(creature: Creature, seen: bool) -> Facts:
    """Geoms by foot. seen: whether the controller observes the feet."""
    parts = _parts(creature.model, creature.feet.stepping)
    return {
        "seen": seen,
        "parts": [
            [
                part
                for part, of in zip(parts, creature.feet.foot_of_geoms, strict=True)
                if of == foot
            ]
            for foot in range(len(creature.feet.names))
        ],
    }


def _own_pairs(
    model: mujoco.MjModel, blocks: np.ndarray, reads: Sequence[str]
) -> list[tuple[int, int]]:
    """Pairs of blocks that feel each other; none if the controller does not observe it."""
    return OwnContact(model, blocks).pairs if OWN_CONTACT in reads else []


def _mirror(creature: Creature) -> Facts:
    mirror = creature.mirror
    return {"sign": mirror.sign.tolist(), "partner": list(mirror.partners)}


def _poses(creature: Creature, champion: Champion) -> Facts:
    joints, weights, settings = creature.joints, creature.corrections, champion.settings
    names, tuning = gene_names(weights.steps), champion.genome["tuning"]
    stepping = weights.stepping
    return {
        "poses": np.asarray(champion.genome["key_poses"], float).tolist(),
        "mirror": _mirror(creature) if creature.mirror.symmetric and settings.mirror else None,
        "tuning": dict(zip(names, map(float, tuning), strict=True)),
        "interpolation": settings.interpolation,
        "advance": settings.advance,
        "steering": settings.steering,
        "step": float(creature.model.opt.timestep),
        "body_length": float(creature.frame.body_length),
        "hip_height": float(creature.frame.hip_height),
        "foot_places": creature.feet.places.tolist(),
        "joints": {
            "stand": joints.stand.tolist(),
            "low": _bounded(joints.low),
            "high": _bounded(joints.high),
        },
        "weights": {
            **_lists(
                steer_bend=weights.steer_bend,
                steer_stride=weights.steer_stride,
                balance_pitch=weights.balance_pitch,
                balance_roll=weights.balance_roll,
            ),
            "stepping": None
            if stepping is None
            else {
                **_lists(ahead=stepping.ahead, aside=stepping.aside, turn=stepping.turn),
                "legs": list(stepping.legs),
            },
        },
    }


def _program(creature: Creature, champion: Champion) -> Facts:
    settings = champion.settings
    texts = serializer_of("program").document(champion.genome, settings, creature)["expressions"]
    return {
        "expressions": [texts[joint] for joint in creature.joints.names],
        "low": _bounded(creature.joints.pose_low),
        "high": _bounded(creature.joints.pose_high),
    }


def _layers(creature: Creature, champion: Champion) -> Facts:
    joints, mirror, genome = creature.joints, creature.mirror, champion.genome
    return {
        "layers": [
            _lists(weight=genome[f"weight_{i}"], bias=genome[f"bias_{i}"])
            for i in range(len(genome) // 2)
        ],
        "period": float(champion.settings.period),
        "mirror": _mirror(creature) if mirror.symmetric else None,
        **_lists(stand=joints.stand, low=joints.pose_low, high=joints.pose_high),
    }


def _brain(creature: Creature, champion: Champion) -> Facts:
    return _network(brain_reference(creature, champion, float(creature.model.opt.timestep)))


def _opponent(creature: Creature, champion: Champion) -> Facts | None:
    """The opponent of a contest: its brain, hinges and blocks, and the cube; None without one."""
    contest, model = contest_of(creature), creature.model
    if contest is None:
        return None
    theirs = opponent_reference(creature, champion, float(model.opt.timestep))
    return {
        "controller": _network(theirs),
        "joints": {
            "qpos": model.jnt_qposadr[contest.joints].tolist(),
            "dofs": model.jnt_dofadr[contest.joints].tolist(),
        },
        "parts": _parts(model, contest.geoms[1].tolist()),
        "own_pairs": _own_pairs(model, contest.geoms[1], theirs.reads),
        "cube": contest.cube,
    }


def _network(brain: BrainReference) -> Facts:
    kinds = [""] * len(brain.place)
    for kind, neurons in brain.alike.items():
        for neuron in neurons:
            kinds[neuron] = kind
    return {
        "kinds": kinds,
        "tick": brain.pause / TICKS,
        "column": brain.column.tolist(),
        "driver": brain.driver.tolist(),
        "lit": brain.lit.tolist(),
        "steer": None if brain.steer is None else brain.steer.tolist(),
        **_lists(weight=brain.weight, gain=brain.gain, strength=brain.strength),
    }


def _water(model: mujoco.MjModel, drag: float) -> Facts:
    """Blocks with what decides the water's drag on them, N·s/m³."""
    water = Water(model, drag)
    return {
        "drag": drag,
        "blocks": [
            {"geom": int(geom), "body": int(body), "half": model.geom_size[geom].tolist()}
            for geom, body in zip(water.blocks, water.bodies, strict=True)
        ],
    }


CONTROLLERS: Mapping[str, Callable[[Creature, Champion], Facts]] = {
    "poses": _poses,
    "program": _program,
    "brain": _brain,
    "network": _layers,
}
"""Facts of each kind of controller that a page can run."""
