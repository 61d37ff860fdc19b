"""Foot and trunk geoms for floor contact: spheres and capsules replace the file's shapes."""

import dataclasses

import numpy as np

from mjxgait.creature.geometry import quaternion, rotation
from mjxgait.importer.notes import Notes
from mjxgait.importer.parts import GEOM, Body, Shape
from mjxgait.importer.skeleton import Tip, foot_tips, tip_points

SPHERE, CAPSULE = int(GEOM.mjGEOM_SPHERE), int(GEOM.mjGEOM_CAPSULE)
BAND = 0.03
"""Share of the hip height within which points count as the sole."""
STEEP = 0.5
"""Sine of the slope from which a capsule touches the floor with one end only."""
SMALL_FOOT, NARROW_FOOT = 0.12, 0.07
"""Shares of the hip height: a foot up to the first is a ball, up to the second a bar."""
NEAR_FLOOR = 0.1
"""Share of the hip height below which a part other than a foot may not collide."""
MOST_TRUNK_SHAPES = 3


@dataclasses.dataclass(frozen=True, eq=False)
class Stance:
    """Bodies in the standing pose, the creature facing +x.

    xpos: [B, 3] m. xrot: [B, 3, 3]. floor: m. hip: hip height in m.
    """

    xpos: np.ndarray
    xrot: np.ndarray
    floor: float
    hip: float


def lay_soles(
    bodies: list[Body], groups: list[list[int]], stance: Stance, planar: bool, notes: Notes
) -> list[list[str]]:
    """Add foot geoms to `bodies`, and return their names for each foot.

    groups: places of each foot's last moving body and the bodies welded to it.
    """
    names = []
    for group in groups:
        made = _sole(bodies, group, stance, planar, notes)
        for n, (i, shape) in enumerate(made):
            shape.name = f"{bodies[group[0]].name}_foot" + (f"_{n + 1}" if len(made) > 1 else "")
            if not any(shape is s for s in bodies[i].shapes):
                bodies[i].shapes.append(shape)
        names.append([shape.name for _, shape in made])
    return names


def _sole(
    bodies: list[Body], group: list[int], stance: Stance, planar: bool, notes: Notes
) -> list[tuple[int, Shape]]:
    """Shapes of one foot and the places of their bodies; old shapes only stay visible."""
    name = bodies[group[0]].name
    owned = [(i, s) for i in group for s in bodies[i].shapes]
    solid = [tip for tip in foot_tips(bodies, group) if tip.far.any()]
    if not solid:
        i = group[-1]
        ball = _ball(bodies[i], np.zeros(3), 0.03 * stance.hip)
        notes.change(
            f'a sphere added to "{bodies[i].name}"',
            "the foot has no shape that could touch the floor",
        )
        return [(i, ball)]
    heights = [tip_points([tip], stance.xpos, stance.xrot)[:, 2].min() for tip in solid]
    band = BAND * stance.hip
    low = [tip for tip, h in zip(solid, heights, strict=True) if h <= min(heights) + band]
    for _, s in owned:
        s.seen, s.solid = s.seen or (s.solid and not any(o.seen for _, o in owned)), False
    round_only = all(t.shape.kind in (SPHERE, CAPSULE) for t in low) and len(low) <= 4
    made = (
        [_round_foot(bodies, t, stance, notes) for t in low]
        if round_only
        else _fitted(bodies, low, group[0], stance, band)
    )
    if not round_only:
        what = " and ".join(sorted({_kind_name(t.shape.kind) for t in low}))
        shapes = " and ".join(sorted({_kind_name(s.kind) for _, s in made}))
        notes.change(
            f'foot "{name}": {len(made)} {shapes} in place of its {what}',
            "spheres and capsules touch the floor fastest and most smoothly",
        )
    if planar:
        made = _across(bodies, made, stance)
        notes.change(
            f'foot "{name}" widened across to {2 * stance.hip:.2g} m',
            "the body lives in a plane; wide feet keep it from tipping sideways",
        )
    return made


def _kind_name(kind: int) -> str:
    return GEOM(kind).name.removeprefix("mjGEOM_").lower()


def _ball(body: Body, pos: np.ndarray, radius: float, seen: bool = False) -> Shape:
    size = np.array([radius, 0.0, 0.0])
    return Shape(
        SPHERE,
        size,
        pos,
        np.array([1.0, 0, 0, 0]),
        _colour(body),
        pos[None],
        radius,
        True,
        seen or not _drawn(body),
    )


def bar(body: Body, a: np.ndarray, b: np.ndarray, radius: float) -> Shape:
    """Return a capsule between two points [3] of the body's frame."""
    along = b - a
    length = float(np.linalg.norm(along))
    if length < 1e-6:
        return _ball(body, (a + b) / 2, radius)
    z = along / length
    x = np.cross(z, np.eye(3)[int(np.abs(z).argmin())])
    x /= np.linalg.norm(x)
    quat = quaternion(np.stack([x, np.cross(z, x), z], axis=1))
    size = np.array([radius, length / 2, 0.0])
    return Shape(
        CAPSULE,
        size,
        (a + b) / 2,
        quat,
        _colour(body),
        np.stack([a, b]),
        radius,
        True,
        not _drawn(body),
    )


def _drawn(body: Body) -> bool:
    return any(s.seen for s in body.shapes)


def _colour(body: Body) -> np.ndarray:
    return body.shapes[0].rgba if body.shapes else np.array([0.3, 0.3, 0.3, 1.0])


def _round_foot(bodies: list[Body], tip: Tip, stance: Stance, notes: Notes) -> tuple[int, Shape]:
    """Return the foot shape of a sphere or capsule.

    A sphere or a lying capsule stays as it is. A steep capsule becomes a ball at its lower end; a
    ball at its upper end may not touch the floor.
    """
    i, shape = tip.body, tip.shape
    world = stance.xpos[i] + shape.points @ stance.xrot[i].T
    slope = abs(world[0, 2] - world[-1, 2]) / max(float(np.linalg.norm(world[0] - world[-1])), 1e-9)
    if shape.kind == SPHERE or (slope < STEEP and tip.far.all()):
        shape.solid = True
        return i, shape
    lower, upper = (shape.points[k] for k in np.argsort(world[:, 2])[[0, -1]])
    knee = _ball(bodies[i], upper, shape.radius)
    count = sum(s.name.startswith(f"{bodies[i].name}_upper_end") for s in bodies[i].shapes)
    knee.name, knee.seen = f"{bodies[i].name}_upper_end" + (f"_{count + 1}" if count else ""), False
    bodies[i].shapes.append(knee)
    notes.change(
        f'foot "{bodies[i].name}": the lower end of its capsule',
        "it touches the floor there; the upper end counts as a knee",
    )
    return i, _ball(bodies[i], lower, shape.radius)


def _fitted(
    bodies: list[Body], low: list[Tip], home: int, stance: Stance, band: float
) -> list[tuple[int, Shape]]:
    """Spheres or capsules with the footprint of the low points as their lower side."""
    world = tip_points(low, stance.xpos, stance.xrot)
    thick = float(np.ptp(world[:, 2]))
    bottom = float(world[:, 2].min())
    sole = world[world[:, 2] <= bottom + band]
    low_corner, high_corner = sole.min(0), sole.max(0)
    length, width = (float(v) for v in (high_corner - low_corner)[:2])
    middle = (low_corner + high_corner) / 2
    at, turn = stance.xpos[home], stance.xrot[home]

    def local(x: float, y: float, radius: float) -> np.ndarray:
        return turn.T @ (np.array([x, y, bottom + radius]) - at)

    least, most = 0.01 * stance.hip, max(thick / 2, 0.015 * stance.hip)
    if max(length, width) < SMALL_FOOT * stance.hip:
        radius = float(np.clip(max(length, width) / 2, least, max(thick / 2, 0.04 * stance.hip)))
        return [(home, _ball(bodies[home], local(middle[0], middle[1], radius), radius))]
    radius = float(np.clip(min(length, width) / 2, least, most))
    ends_x = (low_corner[0] + radius, high_corner[0] - radius)
    ends_y = (low_corner[1] + radius, high_corner[1] - radius)
    if width < NARROW_FOOT * stance.hip:
        return [
            (
                home,
                bar(
                    bodies[home],
                    local(ends_x[0], middle[1], radius),
                    local(ends_x[1], middle[1], radius),
                    radius,
                ),
            )
        ]
    if length < NARROW_FOOT * stance.hip:
        return [
            (
                home,
                bar(
                    bodies[home],
                    local(middle[0], ends_y[0], radius),
                    local(middle[0], ends_y[1], radius),
                    radius,
                ),
            )
        ]
    radius = float(np.clip(min(length, width) / 6, least, most))
    ends_x = (low_corner[0] + radius, high_corner[0] - radius)
    ends_y = (low_corner[1] + radius, high_corner[1] - radius)
    return [
        (home, bar(bodies[home], local(ends_x[0], y, radius), local(ends_x[1], y, radius), radius))
        for y in ends_y
    ]


def _across(
    bodies: list[Body], made: list[tuple[int, Shape]], stance: Stance
) -> list[tuple[int, Shape]]:
    """Replace each ball and each end of a capsule by a long capsule across.

    Nothing changes in the creature's plane.
    """
    wide = []
    for i, shape in made:
        shape.solid = False
        if any(shape is s for s in bodies[i].shapes):
            shape.seen = True
        across = stance.xrot[i].T @ [0.0, stance.hip, 0.0]
        for point in shape.points:
            beam = bar(bodies[i], point - across, point + across, shape.radius)
            beam.seen = False
            wide.append((i, beam))
    return wide


def guard_parts(
    bodies: list[Body],
    feet: list[list[int]],
    trunk: list[int],
    segments: list[list[int]],
    stance: Stance,
    notes: Notes,
) -> None:
    """Give all parts but the feet a few spheres and capsules; if they touch, the episode ends."""
    on_feet = {i for group in feet for i in group}
    lowered = []
    for segment in segments:
        if on_feet & set(segment):
            continue
        most = MOST_TRUNK_SHAPES if segment == trunk else 1
        owned = [(i, s) for i in segment for s in bodies[i].shapes]
        chosen = [(i, s) for i, s in owned if s.solid] or (
            [(i, s) for i, s in owned if s.seen] if segment == trunk else []
        )
        chosen.sort(
            key=lambda pair: -float(np.ptp(pair[1].points, axis=0).max() + 2 * pair[1].radius)
        )
        for i, s in owned:
            s.seen, s.solid = s.seen or (s.solid and not _drawn(bodies[i])), False
        for i, s in chosen[:most]:
            guard = s if s.kind in (SPHERE, CAPSULE) else _inscribed(bodies[i], s)
            clearance = (
                (stance.xpos[i] + guard.points @ stance.xrot[i].T)[:, 2].min()
                - guard.radius
                - stance.floor
            )
            if clearance < NEAR_FLOOR * stance.hip:
                lowered.append(bodies[i].name)
                continue
            guard.solid = True
            if guard is not s:
                bodies[i].shapes.append(guard)
                notes.change(
                    f'"{bodies[i].name}": a {_kind_name(guard.kind)} in place of its '
                    f"{_kind_name(s.kind)}",
                    "for touching the floor",
                )
    for body in bodies:
        for shape in body.shapes:  # knee balls of feet collide only if they are high enough
            if "_upper_end" in shape.name:
                i = bodies.index(body)
                height = (
                    (stance.xpos[i] + shape.points @ stance.xrot[i].T)[:, 2].min()
                    - shape.radius
                    - stance.floor
                )
                shape.solid = bool(height > NEAR_FLOOR * stance.hip)
    if lowered:
        notes.change(
            f"{', '.join(dict.fromkeys(lowered))} do not collide",
            "they are so near the floor that a good step would touch it",
        )


def _inscribed(body: Body, shape: Shape) -> Shape:
    """Return a capsule along the longest side of the shape's box, a little thinner than it."""
    turn = rotation(shape.quat)
    local = (shape.points - shape.pos) @ turn
    low, high = local.min(0), local.max(0)
    half, middle = (high - low) / 2, (low + high) / 2
    longest = int(half.argmax())
    radius = max(float(np.delete(half, longest).min()), 1e-3)
    reach = max(float(half[longest]) - radius, 0.0)
    axis = np.eye(3)[longest] * reach
    a, b = (shape.pos + turn @ (middle + sign * axis) for sign in (-1, 1))
    made = bar(body, a, b, radius)
    made.seen = False
    return made
