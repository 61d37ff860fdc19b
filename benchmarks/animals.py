"""Write thirteen bodies with legs as MJCF files, as a user would build them from capsules.

    python benchmarks/animals.py FOLDER
    python benchmarks/imported.py --files FOLDER/*.xml --out runs/animals

From a mouse of 22 g to an elephant of 3.3 t; beetle and raptor state their torques.
"""

import argparse
import dataclasses
import math
import re
from collections.abc import Callable, Iterator
from pathlib import Path

Point = tuple[float, float, float]
Hinge = tuple[str, Point, float, float]
"""Name, axis, and range in degrees."""
X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
ZERO = (0.0, 0.0, 0.0)
SIDES = (("l", 1), ("r", -1))


@dataclasses.dataclass(frozen=True)
class Link:
    """A part of a limb: hinges, the way to its end in m, radius in m, mass in kg, more geoms."""

    name: str
    hinges: tuple[Hinge, ...]
    end: Point
    radius: float
    mass: float
    more: str = ""


def numbers(*values: float) -> str:
    return " ".join(f"{value:.4g}" for value in values)


def capsule(a: Point, b: Point, radius: float, mass: float) -> str:
    return (
        f'<geom type="capsule" fromto="{numbers(*a, *b)}" size="{radius:.4g}" mass="{mass:.4g}"/>'
    )


def ball(at: Point, radius: float, mass: float) -> str:
    return f'<geom type="sphere" pos="{numbers(*at)}" size="{radius:.4g}" mass="{mass:.4g}"/>'


def solid(kind: str, size: tuple[float, ...], mass: float, at: Point = ZERO) -> str:
    place = numbers(*at)
    return f'<geom type="{kind}" pos="{place}" size="{numbers(*size)}" mass="{mass:.4g}"/>'


def joint(name: str, axis: Point, low: float, high: float) -> str:
    return f'<joint name="{name}" axis="{numbers(*axis)}" range="{low:g} {high:g}"/>'


def part(name: str, at: Point, inner: str, turn: float = 0.0) -> str:
    return f'<body name="{name}" pos="{numbers(*at)}" euler="0 0 {turn:.5g}">{inner}</body>'


def limb(name: str, at: Point, links: list[Link], turn: float = 0.0) -> str:
    """Return a chain of links, each at the end of the one before. turn: degrees about z."""
    inner = ""
    for place, link in reversed(list(enumerate(links))):
        own = f"{name}_{link.name}"
        hinges = "".join(
            joint(f"{own}_{hinge}", axis, low, high) for hinge, axis, low, high in link.hinges
        )
        shape = capsule(ZERO, link.end, link.radius, link.mass)
        start, turned = (at, turn) if place == 0 else (links[place - 1].end, 0.0)
        inner = part(own, start, hinges + shape + link.more + inner, turned)
    return inner


def corners(
    place: tuple[float, float],
    lengths: tuple[float, float],
    radius: float,
    mass: float,
    knees: tuple[int, int] = (1, 1),
) -> str:
    """Return four legs of two links. place: m ahead and aside. knees: 1 if they bend back."""
    legs = ""
    (ahead, aside), (upper, lower) = place, lengths
    for end, x, knee in (("f", ahead, knees[0]), ("h", -ahead, knees[1])):
        bends = (-5, 110) if knee > 0 else (-110, 5)
        for side, sign in SIDES:
            swing = (("abd", X, -20, 20), ("swing", Y, -60, 60))
            foot = ball((0, 0, -lower), 1.3 * radius, mass / 10)
            thigh = Link("thigh", swing, (0, 0, -upper), 1.3 * radius, mass)
            shank = Link("shank", (("knee", Y, *bends),), (0, 0, -lower), radius, mass / 2, foot)
            legs += limb(f"{end}{side}", (x, sign * aside, 0), [thigh, shank])
    return legs


def around(count: int, radius: float, leg: list[Link], half: bool = False) -> str:
    """Return alike legs around a trunk, each turned outward. half: the first by half a step."""
    legs = ""
    for i in range(count):
        turn = 360 * (i + 0.5 * half) / count
        at = (radius * math.cos(math.radians(turn)), radius * math.sin(math.radians(turn)), 0.0)
        legs += limb(f"leg{i}", at, leg, turn)
    return legs


def row(
    draw: Callable[[int], str], count: int, gap: float, name: str, hinge: str, bend: float
) -> str:
    """Return parts behind each other, each on an upright hinge. bend: its range in degrees."""
    behind = ""
    for i in reversed(range(count)):
        own = draw(i) + behind
        joined = joint(f"{hinge}{i}", Z, -bend, bend) + own
        behind = part(f"{name}{i}", (-gap, 0, 0), joined) if i else own
    return behind


def beetle() -> tuple[float, str]:
    legs = ""
    for row, x in enumerate((0.12, 0, -0.12)):
        for side, sign in SIDES:
            swing = (("yaw", Z, -35, 35), ("lift", X, -40, 40))
            coxa = Link("coxa", swing, (0, sign * 0.08, 0.02), 0.008, 0.02)
            knee = (("knee", X, -50, 50),)
            tibia = Link("tibia", knee, (0, sign * 0.04, -0.11), 0.006, 0.015)
            legs += limb(f"{side}{row}", (x, sign * 0.05, 0), [coxa, tibia])
    return 0.09, solid("ellipsoid", (0.16, 0.055, 0.035), 0.35) + legs


def giraffe() -> tuple[float, str]:
    head = capsule((0.35, 0, 0.7), (0.7, 0, 0.6), 0.1, 20)
    neck = [
        Link("a", (("pitch", Y, -30, 30),), (0.5, 0, 0.9), 0.13, 45),
        Link("b", (("pitch", Y, -40, 40),), (0.35, 0, 0.7), 0.1, 35, head),
    ]
    trunk = capsule((-0.6, 0, 0.05), (0.65, 0, 0.2), 0.33, 420)
    legs = corners((0.65, 0.22), (0.9, 0.95), 0.07, 40)
    return 1.95, trunk + legs + limb("neck", (0.75, 0, 0.2), neck)


def mouse() -> tuple[float, str]:
    bends = (("yaw", Z, -40, 40), ("pitch", Y, -40, 40))
    tail = [
        Link("a", bends, (-0.03, 0, 0), 0.002, 0.0005),
        Link("b", bends[:1], (-0.03, 0, 0), 0.0015, 0.0004),
    ]
    trunk = solid("ellipsoid", (0.04, 0.015, 0.013), 0.016) + ball((0.045, 0, 0.006), 0.011, 0.002)
    legs = corners((0.028, 0.012), (0.014, 0.014), 0.0022, 0.0005)
    return 0.03, trunk + legs + limb("tail", (-0.04, 0, 0), tail)


def star5() -> tuple[float, str]:
    lift = (("yaw", Z, -40, 40), ("lift", Y, -45, 45))
    leg = [
        Link("up", lift, (0.14, 0, 0.03), 0.02, 0.2),
        Link("down", (("knee", Y, -45, 45),), (0.05, 0, -0.2), 0.017, 0.15),
    ]

    return 0.18, solid("cylinder", (0.12, 0.035), 1.5) + around(5, 0.1, leg)


def centipede10() -> tuple[float, str]:
    def segment(i: int) -> str:
        inner = solid("box", (0.06, 0.045, 0.025), 0.4)
        for side, sign in SIDES:
            swing = (("yaw", Z, -35, 35), ("lift", X, -35, 35))
            knee = (0.0, sign * 0.09, -0.05)
            lower = capsule(knee, (0, sign * 0.11, -0.11), 0.009, 0.03)
            leg = Link("leg", swing, knee, 0.01, 0.05, lower)
            inner += limb(f"s{i}{side}", (0, sign * 0.045, 0), [leg])
        return inner

    return 0.13, row(segment, 5, 0.15, "seg", "spine", 25)


def raptor() -> tuple[float, str]:
    leg = [
        Link("thigh", (("abd", X, -20, 20), ("swing", Y, -70, 50)), (0.2, 0, -0.3), 0.05, 3.5),
        Link("shin", (("knee", Y, 0, 110),), (-0.25, 0, -0.3), 0.035, 1.6),
        Link("meta", (("ankle", Y, -100, 10),), (0.12, 0, -0.22), 0.025, 0.6),
        Link("toes", (("toe", Y, -45, 45),), (0.14, 0, -0.02), 0.02, 0.3),
    ]
    tail = [
        Link("a", (("yaw", Z, -25, 25), ("pitch", Y, -20, 20)), (-0.4, 0, 0), 0.06, 3),
        Link("b", (("yaw", Z, -25, 25),), (-0.4, 0, 0), 0.04, 1.5),
    ]
    trunk = capsule((-0.28, 0, 0), (0.3, 0, 0.05), 0.13, 15)
    head = capsule((0.3, 0, 0.1), (0.5, 0, 0.3), 0.06, 2)
    head += capsule((0.5, 0, 0.3), (0.72, 0, 0.3), 0.06, 1.5)
    legs = "".join(limb(side, (0, sign * 0.11, -0.05), leg) for side, sign in SIDES)
    return 0.9, trunk + head + legs + limb("tail", (-0.3, 0, 0.02), tail)


def ostrich() -> tuple[float, str]:
    leg = [
        Link("thigh", (("abd", X, -15, 15), ("swing", Y, -50, 50)), (0.25, 0, -0.25), 0.08, 9),
        Link("shin", (("knee", Y, 0, 100),), (-0.3, 0, -0.42), 0.05, 4),
        Link("meta", (("ankle", Y, -100, 5),), (0.1, 0, -0.42), 0.03, 1.5),
        Link("foot", (("toe", Y, -40, 40),), (0.18, 0, -0.02), 0.025, 0.6),
    ]
    head = capsule(ZERO, (0.1, 0, 0), 0.04, 1)
    neck = [Link("a", (("pitch", Y, -30, 30),), (0.1, 0, 0.7), 0.04, 4, head)]
    legs = "".join(limb(side, (0, sign * 0.14, -0.1), leg) for side, sign in SIDES)
    trunk = solid("ellipsoid", (0.5, 0.24, 0.24), 70)
    return 1.25, trunk + legs + limb("neck", (0.4, 0, 0.1), neck)


def child() -> tuple[float, str]:
    limbs = ""
    for side, sign in SIDES:
        hip = (("roll", X, -25, 25), ("yaw", Z, -25, 25), ("pitch", Y, -90, 30))
        sole = solid("box", (0.085, 0.035, 0.012), 0.3, (0.035, 0, -0.045))
        ankle = (("pitch", Y, -35, 35), ("roll", X, -15, 15))
        leg = [
            Link("thigh", hip, (0, 0, -0.27), 0.05, 2.4),
            Link("shin", (("knee", Y, 0, 120),), (0, 0, -0.26), 0.038, 1.1),
            Link("foot", ankle, (0.01, 0, -0.03), 0.02, 0.2, sole),
        ]
        arm = [
            Link("upper", (("pitch", Y, -80, 80),), (0, sign * 0.03, -0.2), 0.03, 0.7),
            Link("fore", (("elbow", Y, -110, 0),), (0.02, 0, -0.18), 0.025, 0.5),
        ]
        limbs += limb(side, (0, sign * 0.075, -0.08), leg)
        limbs += limb(f"{side}arm", (0, sign * 0.15, 0.3), arm)
    chest = capsule((0, -0.06, 0.22), (0, 0.06, 0.22), 0.1, 8.5)
    trunk = solid("box", (0.07, 0.1, 0.08), 3.5) + chest + ball((0, 0, 0.46), 0.1, 3.2)
    return 0.66, trunk + limbs


def tripod() -> tuple[float, str]:
    hip = (("yaw", Z, -50, 50), ("lift", Y, -50, 50))
    leg = [
        Link("hip", hip, (0.18, 0, -0.05), 0.025, 0.4),
        Link("shank", (("knee", Y, -60, 60),), (0.06, 0, -0.28), 0.02, 0.3),
    ]

    return 0.34, solid("cylinder", (0.14, 0.05), 2.5) + around(3, 0.12, leg)


def elephant() -> tuple[float, str]:
    trunk = capsule((-0.75, 0, 0.2), (0.85, 0, 0.25), 0.6, 2100)
    nose = capsule((1.3, 0, 0.1), (1.65, 0, -0.1), 0.28, 350)
    return 1.75, trunk + nose + corners((0.8, 0.4), (0.8, 0.75), 0.16, 140, knees=(-1, 1))


def dachshund() -> tuple[float, str]:
    legs = {"f": "", "h": ""}
    for side, sign in SIDES:
        for end, bends in (("f", (-100, 10)), ("h", (-10, 100))):
            foot = ball((-0.005, 0, -0.07), 0.018, 0.05)
            swing = (("abd", X, -20, 20), ("swing", Y, -60, 60))
            knee = (("knee", Y, *bends),)
            leg = [
                Link("thigh", swing, (0.01, 0, -0.07), 0.018, 0.25),
                Link("shank", knee, (-0.005, 0, -0.07), 0.014, 0.12, foot),
            ]
            at = (0.14 if end == "f" else -0.14, sign * 0.06, -0.04)
            legs[end] += limb(f"{end}{side}", at, leg)
    spine = joint("spine_yaw", Z, -25, 25) + joint("spine_pitch", Y, -20, 20)
    rear = part("rear", (-0.02, 0, 0), spine + capsule(ZERO, (-0.2, 0, 0), 0.06, 3.2) + legs["h"])
    trunk = capsule((0.18, 0, 0), ZERO, 0.062, 3.4)
    return 0.2, trunk + capsule((0.22, 0, 0.05), (0.33, 0, 0.06), 0.04, 0.8) + legs["f"] + rear


def lizard() -> tuple[float, str]:
    def segment(i: int) -> str:
        inner = capsule((0.04, 0, 0), (-0.04, 0, 0), 0.02, 0.07)
        for side, sign in SIDES if i in (0, 2) else ():
            swing = (("yaw", Z, -45, 45), ("lift", X, -40, 40))
            leg = [
                Link("upper", swing, (0, sign * 0.045, 0), 0.007, 0.008),
                Link("lower", (("elbow", X, -50, 50),), (0, sign * 0.012, -0.04), 0.006, 0.006),
            ]
            inner += limb(f"{'fmh'[i]}{side}", (0, sign * 0.02, 0), leg)
        if i == 0:
            inner += ball((0.08, 0, 0.005), 0.018, 0.03)
        return inner

    return 0.045, row(segment, 4, 0.09, "part", "bend", 30)


def spider8() -> tuple[float, str]:
    lift = (("yaw", Z, -30, 30), ("lift", Y, -40, 40))
    leg = [
        Link("femur", lift, (0.05, 0, 0.025), 0.004, 0.0015),
        Link("tibia", (("knee", Y, -50, 50),), (0.03, 0, -0.065), 0.003, 0.001),
    ]

    trunk = solid("ellipsoid", (0.035, 0.028, 0.018), 0.02) + ball((-0.05, 0, 0.008), 0.024, 0.015)
    return 0.045, trunk + around(8, 0.03, leg, half=True)


BODIES: dict[str, tuple[Callable[[], tuple[float, str]], float]] = {
    "beetle": (beetle, 0.8),
    "giraffe": (giraffe, 0.0),
    "mouse": (mouse, 0.0),
    "star5": (star5, 0.0),
    "centipede10": (centipede10, 0.0),
    "raptor": (raptor, 150.0),
    "ostrich": (ostrich, 0.0),
    "child": (child, 0.0),
    "tripod": (tripod, 0.0),
    "elephant": (elephant, 0.0),
    "dachshund": (dachshund, 0.0),
    "lizard": (lizard, 0.0),
    "spider8": (spider8, 0.0),
}
"""What draws each body, and the torque in N·m that its file states; 0: none."""


def models() -> Iterator[tuple[str, str]]:
    """Yield the name and the MJCF text of each body."""
    for name, (draw, torque) in BODIES.items():
        height, inner = draw()
        joints = re.findall(r'joint name="([^"]+)"', inner) if torque else []
        motors = "".join(
            f'<motor joint="{one}" ctrlrange="-{torque:g} {torque:g}"/>' for one in joints
        )
        yield (
            name,
            f'<mujoco model="{name}"><compiler angle="degree" autolimits="true"/><worldbody>'
            f'<body name="trunk" pos="0 0 {height}"><freejoint/>{inner}</body></worldbody>'
            f"<actuator>{motors}</actuator></mujoco>\n",
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    folder = parser.parse_args().folder
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in models():
        (folder / f"{name}.xml").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
