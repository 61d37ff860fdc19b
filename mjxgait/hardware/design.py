"""Design of a robot from a recorded motion of a body that grew: scale, parts, servos, masses.

A body of another size moves alike if all its masses, torques and times are multiplied as in
`Similarity` (equal Froude numbers). Letters: `T` frames.
"""

import dataclasses
import itertools
from collections.abc import Mapping, Sequence

import numpy as np

from mjxgait.controllers.sims_brain.reference_body import DAMPING, DENSITY, ROTOR, Part, grow
from mjxgait.hardware.servos import Catalogue, Motion, Servo, lightest
from mjxgait.hardware.shells import Packed, Print, Solid, block, packed, printed
from mjxgait.rendering.walk import Walk

PLASTIC = 1240.0
"""kg/m³ of PLA: specific gravity 1.24 (NatureWorks, Ingeo 4043D, technical data sheet)."""
LEAST_KEPT = 0.35
"""Least share of a block that a cut may leave; below, the block is printed whole and reported."""
GAP = 0.0005
"""m between two printed parts at a hinge."""
MARGIN = 0.035
"""rad (2°) that a hinge may turn beyond the angles of the recorded motion."""
SAMPLES = 7
"""Angles of each hinge at which a block must be clear of its parent."""
LENGTHS = (0.08, 0.10, 0.12, 0.15, 0.20, 0.25, 0.30, 0.40)
"""m; lengths that are tried where a servo is too weak or does not fit."""
ROUNDS = 20
"""Most rounds of choosing servos: heavier ones need a denser robot, and that stronger servos."""


@dataclasses.dataclass(frozen=True)
class Similarity:
    """Factors from the evolved body to the robot. length: of lengths. density: of densities."""

    length: float
    density: float = 1.0

    @property
    def time(self) -> float:
        """Factor of times."""
        return self.length**0.5

    @property
    def speed(self) -> float:
        """Factor of the speeds of hinges, in rad/s."""
        return 1 / self.time

    @property
    def mass(self) -> float:
        """Factor of masses."""
        return self.density * self.length**3

    @property
    def torque(self) -> float:
        """Factor of torques."""
        return self.density * self.length**4

    def hinge(self, part: Part) -> tuple[float, float, float]:
        """Return strength in N·m, damping in N·m·s and armature in kg·m² of a part's hinges."""
        strength = part.strength * self.torque
        damping = DAMPING * strength * self.time
        return strength, damping, ROTOR * damping * self.time


@dataclasses.dataclass(frozen=True, eq=False)
class Hinge:
    """Hinge of the robot.

    motion: of the evolved walk, in the robot's units. servo: the chosen one. load: see
    `servos.load`; above 1 the servo is too weak. angles: rad, least and largest that the robot can
    reach. carrier: number of the part that holds the servo. place: of the servo; None if it fits
    into neither part.
    """

    name: str
    motion: Motion
    servo: Servo
    load: float
    angles: tuple[float, float]
    carrier: int
    place: Packed | None


@dataclasses.dataclass(frozen=True, eq=False)
class Block:
    """Block of the robot, in its own axes, its joint at the origin; m, kg.

    kept: share of the evolved block that is left after the cut. print: its printed parts.
    similar: mass that similarity requires. plastic, servos, ballast: masses of what it is made of.
    middle: [3] of the evolved block, where the ballast goes.
    """

    number: int
    kept: float
    print: Print
    similar: float
    plastic: float
    servos: float
    ballast: float
    middle: np.ndarray

    @property
    def name(self) -> str:
        """Name of the part, as in the evolved model."""
        return f"part{self.number}"

    @property
    def mass(self) -> float:
        """Mass in kg."""
        return self.plastic + self.servos + self.ballast


@dataclasses.dataclass(frozen=True, eq=False)
class Design:
    """Robot to build.

    wall: m. obstacles: sentences on what keeps it from being built or from moving as it evolved.
    """

    walk: Walk
    parts: tuple[Part, ...]
    scale: Similarity
    wall: float
    blocks: tuple[Block, ...]
    hinges: tuple[Hinge, ...]
    obstacles: tuple[str, ...]


def longest_side(parts: Sequence[Part]) -> float:
    """Return the longest side of all blocks in m."""
    return float(max(2 * part.half.max() for part in parts))


def parts_of(walk: Walk) -> tuple[Part, ...]:
    """Return the parts of a walk's body."""
    settings = walk.champion.settings
    return tuple(grow(walk.champion.genome, settings.parts, settings.links))


def designed(walk: Walk, length: float, wall: float, catalogue: Catalogue) -> Design:
    """Return the robot that moves as a walk's body did.

    The robot is as light as its heaviest block allows, at most as dense as the evolved body; other
    blocks get ballast. length: m, of the longest side of its blocks. wall: m, of printed parts.
    """
    parts = parts_of(walk)
    size = length / longest_side(parts)
    motions, angles = _motions(walk, parts), _angles(walk, parts)
    shapes = [_shape(parts, number, angles, size) for number in range(len(parts))]
    prints = [
        printed(solid, wall, [np.zeros(3), *_joints(parts, number, size)])
        for number, (solid, _, _) in enumerate(shapes)
    ]
    plastic = np.array([PLASTIC * one.volume for one in prints])
    evolved = np.array([DENSITY * 8 * part.half.prod() * size**3 for part in parts])
    density = min(float((plastic / evolved).max()), 1.0)
    for _ in range(ROUNDS):
        scale = Similarity(size, density)
        hinges = _hinges(parts, motions, angles, scale, prints, catalogue)
        servos = np.zeros(len(parts))
        for hinge in hinges:
            servos[hinge.carrier] += hinge.servo.kilograms
        needed = min(float(((plastic + servos) / evolved).max()), 1.0)
        if needed <= density * (1 + 1e-9):
            break
        density = needed
    similar = evolved * scale.density
    blocks = tuple(
        Block(
            number=number,
            kept=shapes[number][1],
            print=prints[number],
            similar=float(similar[number]),
            plastic=float(plastic[number]),
            servos=float(servos[number]),
            ballast=float(max(similar[number] - plastic[number] - servos[number], 0.0)),
            middle=part.middle * size,
        )
        for number, part in enumerate(parts)
    )
    found = [obstacle for _, _, obstacle in shapes if obstacle]
    found += [said for hinge in hinges for said in _of_hinge(hinge, parts)]
    found += [said for one in blocks for said in _of_block(one)]
    return Design(walk, parts, scale, wall, blocks, hinges, tuple(found))


def easier(design: Design, catalogue: Catalogue) -> Design | None:
    """Return the robot of another length with the fewest obstacles; None if none has fewer.

    Torques grow with the fourth power of the length while hinges slow down, so a servo may be too
    weak for a large robot and too slow or too big for a small one.
    """
    others = [designed(design.walk, each, design.wall, catalogue) for each in LENGTHS]
    best = min(others, key=lambda one: (len(one.obstacles), max(h.load for h in one.hinges)))
    return best if len(best.obstacles) < len(design.obstacles) else None


def hinge_names(parts: Sequence[Part]) -> list[tuple[str, int]]:
    """Return the name of each hinge and the number of its part, in the model's order of parts."""
    return [
        (f"part{number}_{hinge}", number)
        for number, part in enumerate(parts)
        for hinge in range(len(part.hinges))
    ]


def _motions(walk: Walk, parts: Sequence[Part]) -> dict[str, Motion]:
    """Return the motion of each hinge at its shaft, of the evolved body.

    A hinge's damping is that of its motor: its torque falls with speed, so the shaft gets the
    commanded torque less the damping. Its rotor's inertia is not counted.
    """
    film, joints = walk.trajectory, walk.creature.joints
    found = {}
    for name, number in hinge_names(parts):
        place = joints.names.index(name)
        speed = film.qvel[0][:, joints.dof_adr[place]]
        torque = film.torque[0][:, place] - DAMPING * parts[number].strength * speed
        found[name] = Motion(torque, speed)
    return found


def _angles(walk: Walk, parts: Sequence[Part]) -> dict[str, tuple[float, float]]:
    """Return the least and the largest angle of each hinge in rad, with a margin."""
    joints, found = walk.creature.joints, {}
    for name, _ in hinge_names(parts):
        angle = walk.qpos[:, joints.qpos_adr[joints.names.index(name)]]
        found[name] = (float(angle.min()) - MARGIN, float(angle.max()) + MARGIN)
    return found


def _joints(parts: Sequence[Part], number: int, size: float) -> list[np.ndarray]:
    """Return the places [3] in m at which other parts are joined to one."""
    return [part.place * size for part in parts if part.parent == number]


def _shape(
    parts: Sequence[Part], number: int, angles: Mapping[str, tuple[float, float]], size: float
) -> tuple[Solid, float, str]:
    """Return a block clear of its parent, the share of it that is left, and an obstacle if any.

    In evolution a block turns into the one that it is joined to. A block that cannot be cut clear
    is returned whole.
    """
    part = parts[number]
    whole = block(part.half * size, part.middle * size)
    if part.parent < 0:
        return whole, 1.0, ""
    outward = _face(parts[part.parent], part)
    swept = [np.linspace(*angles[f"part{number}_{k}"], SAMPLES) for k in range(len(part.hinges))]
    faces = [-(_turned(part, each).T @ outward) for each in itertools.product(*swept)]
    cut = whole.cut(faces, -GAP if part.hinges else 0.0)
    kept = cut.volume() / whole.volume()
    on = f"part{part.parent}"
    if kept < LEAST_KEPT:
        said = f"part{number} turns into {on}: cut clear of it, {100 * kept:.0f} % of it is left"
        return whole, 1.0, f"{said}, so it is printed whole"
    lost = [
        f"part{child}"
        for child, other in enumerate(parts)
        if other.parent == number and not cut.holds(other.place * size)
    ]
    if lost:
        said = f"part{number} turns into {on}: cut clear of it, it loses the place of {lost[0]}"
        return whole, 1.0, f"{said}, so it is printed whole"
    return cut, kept, ""


def _face(parent: Part, part: Part) -> np.ndarray:
    """Return the normal [3] of the face of its parent on which a part is, in the parent's axes."""
    place = (part.place - parent.middle) / parent.half
    face = int(np.argmax(np.abs(place)))
    normal: np.ndarray = np.sign(place[face]) * np.eye(3)[face]
    return normal


def _turned(part: Part, angles: Sequence[float]) -> np.ndarray:
    """Return a part's axes [3, 3] (columns) in its parent's, at these angles of its hinges."""
    axes = part.axes
    for axis, angle in zip(part.hinges, angles, strict=True):
        i, j = (axis + 1) % 3, (axis + 2) % 3
        turn = np.eye(3)
        turn[[i, j], [i, j]] = np.cos(angle)
        turn[j, i], turn[i, j] = np.sin(angle), -np.sin(angle)
        axes = axes @ turn
    return axes


def _hinges(
    parts: Sequence[Part],
    motions: Mapping[str, Motion],
    angles: Mapping[str, tuple[float, float]],
    scale: Similarity,
    prints: Sequence[Print],
    catalogue: Catalogue,
) -> tuple[Hinge, ...]:
    """Return each hinge with the lightest servo that drives it, and the servo's place.

    The first servo of a joint sits in the parent, the others in the part that they move; where one
    does not fit, it sits in the other of these two.
    """
    taken: dict[int, list[Packed]] = {number: [] for number in range(len(parts))}
    found = []
    for name, number in hinge_names(parts):
        part = parts[number]
        motion = motions[name].scaled(scale.torque, scale.speed)
        servo, load = lightest(catalogue, motion)
        joints = {part.parent: part.place * scale.length, number: np.zeros(3)}
        order = [part.parent, number] if name.endswith("_0") else [number, part.parent]
        carrier = order[0]
        place: Packed | None = None
        for holder in order:
            cavity = prints[holder].cavity
            if cavity is not None:
                place = packed(cavity, servo.half, joints[holder], taken[holder])
            if place is not None:
                carrier = holder
                taken[holder].append(place)
                break
        cut = len(prints[number].solid.normals) > 6
        swing = float(part.swing[int(name.rpartition("_")[2])])
        reach = angles[name] if cut else (-swing, swing)
        found.append(Hinge(name, motion, servo, load, reach, carrier, place))
    return tuple(found)


def _of_hinge(hinge: Hinge, parts: Sequence[Part]) -> list[str]:
    """Return the obstacles of a hinge."""
    found = []
    number = int(hinge.name.removeprefix("part").partition("_")[0])
    if hinge.load > 1:
        short = f"{hinge.servo.name}, would have to be {hinge.load:.1f} times as strong and fast"
        found.append(f"{hinge.name}: no servo of the catalogue drives it; the nearest, {short}")
    if hinge.place is None:
        inside = f"part{parts[number].parent} nor part{number}"
        found.append(f"{hinge.name}: {hinge.servo.name} fits into neither {inside}")
    return found


def _of_block(one: Block) -> list[str]:
    """Return the obstacles of a block."""
    found = []
    if one.mass > 1.01 * one.similar:
        more = 100 * (one.mass / one.similar - 1)
        found.append(
            f"{one.name}: {more:.0f} % heavier than a similar body's, and cannot be lighter"
        )
    return found
