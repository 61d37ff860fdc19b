"""MuJoCo model of a robot, and its motion under the champion's brain.

Letters: `J` hinges, `P` parts, `T` control steps.
"""

import dataclasses
import xml.etree.ElementTree as ET

import mujoco
import numpy as np

from mjxgait.controllers.sims_brain.reference import BrainReference
from mjxgait.controllers.sims_brain.reference_body import (
    CONTACT_TIME_CONSTANT,
    DENSITY,
    FRICTION,
    GRAVITY,
    Part,
)
from mjxgait.controllers.sims_brain.reference_files import in_xml
from mjxgait.creature.geometry import quaternion
from mjxgait.hardware.design import PLASTIC, Block, Design, Similarity, hinge_names
from mjxgait.reference.bodies import BLOWN_UP
from mjxgait.reference.state import CONTACT_GAP
from mjxgait.tasks.modular.criteria import highest
from mjxgait.tasks.modular.thresholds import RoamThresholds

IMPEDANCE = (0.9, 0.95, 0.001, 0.5, 2.0)
"""MuJoCo's default `solimp`; its third number is a depth in m."""
SOFT_END = 0.02
"""s; MuJoCo's default time constant of the end of a hinge's range."""
SETTLE = 2.0
"""s of the evolved body that do not count, as in its examination."""
STARTS, TURNED = 8, 0.05
"""Number of perturbed starts, and rad by which hinges are turned in them, as in criterion 4."""


@dataclasses.dataclass(frozen=True, eq=False)
class Body:
    """Body to simulate: what of a model its motion needs.

    drives: of each hinge in the order of `hinge_names`: N·m at rest, rad/s without load, and
    whether the torque ends at the first. ranges: rad. points: corners [n, 3] of each part in its
    own axes. inertials: of each part: mass in kg, centre [3], inertia [3, 3] about it.
    """

    scale: Similarity
    parts: tuple[Part, ...]
    drives: tuple[tuple[float, float, bool], ...]
    ranges: tuple[tuple[float, float], ...]
    points: tuple[np.ndarray, ...]
    inertials: tuple[tuple[float, np.ndarray, np.ndarray], ...]


def as_evolved(design: Design) -> Body:
    """Return the evolved body at the robot's scale: whole blocks and the hinges of evolution."""
    scale, parts = design.scale, design.parts
    own = [scale.hinge(parts[number]) for _, number in hinge_names(parts)]
    swings = [swing for part in parts for swing in part.swing[: len(part.hinges)]]
    boxes = [(part.half * scale.length, part.middle * scale.length) for part in parts]
    signs = np.stack(np.meshgrid(*[[-1, 1]] * 3), axis=-1).reshape(-1, 3)
    masses = [DENSITY * scale.density * 8 * float(half.prod()) for half, _ in boxes]
    return Body(
        scale,
        parts,
        drives=tuple((torque, torque / damping, False) for torque, damping, _ in own),
        ranges=tuple((-float(swing), float(swing)) for swing in swings),
        points=tuple(middle + signs * half for half, middle in boxes),
        inertials=tuple(
            (mass, middle, _of_box(mass, half))
            for mass, (half, middle) in zip(masses, boxes, strict=True)
        ),
    )


def as_built(design: Design) -> Body:
    """Return the robot: cut blocks, true masses, and servos that end at their torque and speed."""
    hinges, blocks = design.hinges, design.blocks
    corners = [one.print.solid.corners() for one in blocks]
    return Body(
        design.scale,
        design.parts,
        drives=tuple((hinge.servo.stall, hinge.servo.fastest, True) for hinge in hinges),
        ranges=tuple(hinge.angles for hinge in hinges),
        points=tuple(each for each in corners if each is not None),
        inertials=tuple(_inertial(design, one) for one in blocks),
    )


def with_servos(design: Design) -> Body:
    """Return the evolved body at the robot's scale, but with the robot's servos."""
    return dataclasses.replace(as_evolved(design), drives=as_built(design).drives)


def _inertial(design: Design, one: Block) -> tuple[float, np.ndarray, np.ndarray]:
    """Return mass, centre and inertia of plastic, servos and ballast; the ballast is a point."""
    pieces: list[tuple[float, np.ndarray, np.ndarray]] = [
        (PLASTIC * float(mesh.volume), mesh.center_mass, PLASTIC * mesh.moment_inertia)
        for mesh in one.print.meshes.values()
    ]
    for hinge in design.hinges:
        if hinge.carrier == one.number:
            place = one.middle if hinge.place is None else hinge.place.middle
            half = hinge.servo.half if hinge.place is None else hinge.place.half
            mass = hinge.servo.kilograms
            pieces.append((mass, place, _of_box(mass, half)))
    pieces.append((one.ballast, one.middle, np.zeros((3, 3))))
    masses = np.array([mass for mass, _, _ in pieces])
    centre = masses @ np.array([place for _, place, _ in pieces]) / masses.sum()
    inertia = np.zeros((3, 3))
    for mass, place, own in pieces:
        arm = place - centre
        inertia += own + mass * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    return float(masses.sum()), centre, inertia


def _of_box(mass: float, half: np.ndarray) -> np.ndarray:
    """Return the inertia [3, 3] of a solid box about its middle."""
    square = half**2
    inertia: np.ndarray = np.diag(mass / 3 * (square.sum() - square))
    return inertia


def model_xml(body: Body, step: float) -> str:
    """Return the MuJoCo model of a body: hinges named as evolved, a motor for each.

    A motor's control is the share of its voltage. step: s of the evolved body's simulation.
    """
    time, size = body.scale.time, body.scale.length
    root = ET.Element("mujoco", model="robot")
    ET.SubElement(root, "compiler", angle="radian", balanceinertia="false")
    option = {"timestep": f"{step * time:.9g}", "gravity": in_xml((0, 0, -GRAVITY))}
    exact = {"iterations": "100", "ls_iterations": "50", "tolerance": "1e-8"}
    inner = ET.SubElement(root, "option", {**option, **exact})
    ET.SubElement(inner, "flag", eulerdamp="disable", autoreset="disable")
    solid = (*IMPEDANCE[:2], IMPEDANCE[2] * size, *IMPEDANCE[3:])
    hard = {"solref": in_xml((CONTACT_TIME_CONSTANT * step * time, 1.0)), "solimp": in_xml(solid)}
    touch = {"friction": in_xml((FRICTION, 0.005, 0.0001)), **hard}
    assets, world = ET.SubElement(root, "asset"), ET.SubElement(root, "worldbody")
    plane = {"type": "plane", "size": "0 0 1", "contype": "0", "conaffinity": "1"}
    ET.SubElement(world, "geom", {"name": "floor", **plane, **touch})
    motors = ET.SubElement(root, "actuator")
    bodies: list[ET.Element] = []
    names = [name for name, _ in hinge_names(body.parts)]
    for number, part in enumerate(body.parts):
        name = f"part{number}"
        inside = world if part.parent < 0 else bodies[part.parent]
        own = ET.SubElement(inside, "body", name=name, pos=in_xml(part.place * size))
        if part.parent < 0:
            ET.SubElement(own, "freejoint", name="root")
        else:
            own.set("quat", in_xml(quaternion(part.axes)))
        for hinge, axis in enumerate(part.hinges):
            _with_hinge(own, motors, body, names.index(f"{name}_{hinge}"), axis, f"{name}_{hinge}")
        mass, centre, inertia = body.inertials[number]
        full = in_xml(inertia[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]])
        given = {"pos": in_xml(centre), "mass": f"{mass:.9g}", "fullinertia": full}
        ET.SubElement(own, "inertial", given)
        ET.SubElement(assets, "mesh", name=name, vertex=in_xml(body.points[number].ravel()))
        shape = {"type": "mesh", "mesh": name, "contype": "1", "conaffinity": "1", "mass": "0"}
        ET.SubElement(own, "geom", {"name": f"block{number}", **shape, **touch})
        bodies.append(own)
    ET.indent(root)
    return ET.tostring(root, encoding="unicode")


def _with_hinge(
    own: ET.Element, motors: ET.Element, body: Body, place: int, axis: int, name: str
) -> None:
    """Add a hinge and its motor. place: of the hinge among all."""
    number = hinge_names(body.parts)[place][1]
    _, _, armature = body.scale.hinge(body.parts[number])
    stall, fastest, ends = body.drives[place]
    joint = {"name": name, "axis": in_xml(np.eye(3)[axis]), "limited": "true"}
    end = in_xml((SOFT_END * body.scale.time, 1.0))
    joint |= {"range": in_xml(body.ranges[place]), "solreflimit": end}
    ET.SubElement(own, "joint", {**joint, "armature": f"{armature:.9g}", "damping": "0"})
    motor = {"name": name, "joint": name, "ctrllimited": "true", "ctrlrange": "-1 1"}
    motor |= {"gainprm": f"{stall:.9g}", "biastype": "affine"}
    motor["biasprm"] = in_xml((0, 0, -stall / fastest))
    if ends:
        motor |= {"forcelimited": "true", "forcerange": in_xml((-stall, stall))}
    ET.SubElement(motors, "general", motor)


@dataclasses.dataclass(frozen=True)
class Trial:
    """What a body did in the reference simulator, after it settled.

    speed: m/s along a straight line, of the centre of mass. distance: m, in all of that time.
    seconds: of that time. upright: least product of the world's up axis with the direction of the
    root that was up when it had settled. height: m, mean leap of the lowest part. short: share of
    all torques for which a motor's voltage did not suffice.
    """

    speed: float
    distance: float
    seconds: float
    upright: float
    height: float
    short: float

    @property
    def fell(self) -> bool:
        """Whether it tipped over, by the criterion of walking bodies; a body that blew up did."""
        return not self.upright >= RoamThresholds().min_up


def tried(design: Design, body: Body, seconds: float, angles: np.ndarray | None = None) -> Trial:
    """Simulate a body under the champion's brain, from rest on its lowest corner.

    The brain runs on the evolved body's time, so its waves are as much faster as the robot moves.
    seconds: of the evolved body; the robot's time is shorter by `Similarity.time`. angles: [J] rad
    at the start; 0 by default.
    """
    step = float(design.walk.creature.model.opt.timestep)
    model = mujoco.MjModel.from_xml_string(model_xml(body, step))
    data, heights = mujoco.MjData(model), _Heights(model, body)
    # MuJoCo orders hinges along the branches, not by the numbers of their parts.
    hinges = [model.joint(name) for name, _ in hinge_names(body.parts)]
    at = np.array([int(hinge.qposadr[0]) for hinge in hinges])
    turning = np.array([int(hinge.dofadr[0]) for hinge in hinges])
    data.qpos[at] = 0.0 if angles is None else angles
    mujoco.mj_kinematics(model, data)
    data.qpos[2] -= heights.of(data).min()
    brain, drives = _brain(design, step), _Drives(body)
    memory, root = brain.init(1), model.body("part0").id
    steps = round(seconds / step)
    middle, up, low = np.full((steps, 3), np.nan), np.full((steps, 3), np.nan), np.zeros(steps)
    short = 0.0
    for k in range(steps):
        mujoco.mj_forward(model, data)
        if not np.abs(data.qvel).max() < BLOWN_UP:
            break
        height = heights.of(data)
        middle[k], up[k], low[k] = data.subtree_com[root], data.xmat[root, 6:], height.min()
        if k % brain.every == 0:
            contact = (height < CONTACT_GAP * body.scale.length).astype(float)
            senses = {"joint_pos": data.qpos[None, at], "contact": contact[None]}
            torque, memory = brain.act(memory, senses)
        duty = drives.duty(torque[0], data.qvel[turning])
        short += float((np.abs(duty) > 1 + 1e-6).mean())
        data.ctrl[:] = np.clip(duty, -1, 1)
        mujoco.mj_step(model, data)
    first = round(SETTLE / step)
    way = float(np.linalg.norm(middle[-1, :2] - middle[first, :2]))
    passed = (steps - 1 - first) * step * body.scale.time
    return Trial(
        speed=way / passed,
        distance=way,
        seconds=passed,
        upright=float((up[first:] @ up[first]).min()),
        height=float(highest(low[first:], step).mean()),
        short=short / steps,
    )


def perturbed(design: Design, body: Body, seconds: float) -> list[Trial]:
    """Simulate a body from `STARTS` starts with its hinges turned by up to `TURNED`."""
    rng = np.random.default_rng(0)
    starts = rng.uniform(-TURNED, TURNED, (STARTS, len(body.drives)))
    return [tried(design, body, seconds, start) for start in starts]


class _Drives:
    """Motors that imitate the evolved hinges."""

    def __init__(self, body: Body) -> None:
        hinges = [body.scale.hinge(body.parts[number]) for _, number in hinge_names(body.parts)]
        self.factor = body.scale.torque
        self.damping = np.array([damping for _, damping, _ in hinges])
        self.stall = np.array([stall for stall, _, _ in body.drives])
        self.fastest = np.array([fastest for _, fastest, _ in body.drives])

    def duty(self, torque: np.ndarray, speed: np.ndarray) -> np.ndarray:
        """Return the share [J] of its voltage that each motor needs; beyond ±1 it falls short.

        torque: [J] N·m, of the brain for the evolved body. speed: [J] rad/s, of the robot.
        """
        wanted = torque * self.factor - self.damping * speed
        share: np.ndarray = wanted / self.stall + speed / self.fastest
        return share


class _Heights:
    """Height of each part's lowest corner."""

    def __init__(self, model: mujoco.MjModel, body: Body) -> None:
        self.points = np.concatenate(body.points)
        counts = [len(points) for points in body.points]
        self.first = np.concatenate([[0], np.cumsum(counts)[:-1]])
        ids = np.array([model.body(f"part{number}").id for number in range(len(counts))])
        self.owner = np.repeat(ids, counts)

    def of(self, data: mujoco.MjData) -> np.ndarray:
        """Return the heights [P] in m."""
        all_of_them = (self.points * data.xmat[self.owner, 6:]).sum(1) + data.xpos[self.owner, 2]
        lowest: np.ndarray = np.minimum.reduceat(all_of_them, self.first)
        return lowest


def _brain(design: Design, step: float) -> BrainReference:
    """Return the champion's brain, its hinges in the order of `hinge_names`."""
    champion = design.walk.champion
    hinges = [(part, int(name.rpartition("_")[2])) for name, part in hinge_names(design.parts)]
    settings = champion.settings
    return BrainReference(
        champion.genome,
        design.parts,
        hinges,
        step,
        every=settings.every,
        skill=settings.skill,
        children=settings.children,
    )
