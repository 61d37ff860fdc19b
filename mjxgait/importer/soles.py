"""Foot and trunk geoms for floor contact: spheres and capsules replace the file's shapes."""

import dataclasses

import numpy as np

from mjxgait.creature.geometry import rotation
from mjxgait.importer.body import KinematicModel, Tip, tip_points
from mjxgait.importer.notes import Notes
from mjxgait.importer.shapes import Bar, Shape, bar, is_drawn, mark

BAND = 0.03
"""Share of the hip height within which points count as the sole."""
STEEP = 0.5
"""Sine of the slope from which a capsule touches the floor with one end only."""
SMALL_FOOT, NARROW_FOOT = 0.12, 0.07
"""Shares of the hip height: a foot up to the first is a ball, up to the second a bar."""
NEAR_FLOOR = 0.1
"""Share of the hip height below which a part other than a foot may not collide."""
MOST_TRUNK_SHAPES = 3
ROUND = ("sphere", "capsule")
UPPER_END = "_upper_end"
"""In the names of balls at the upper ends of capsules on which the creature stands."""


def lowest_part(sole: np.ndarray, hip: float) -> np.ndarray:
    """Points of a sole [n, 3] near its lowest; hip: hip height in m."""
    near: np.ndarray = sole[sole[:, 2] < sole[:, 2].min() + BAND * hip]
    return near


@dataclasses.dataclass(frozen=True, eq=False)
class Stance:
    """Bodies in the standing pose, the creature facing +x.

    xpos: [B, 3] m. xrot: [B, 3, 3]. floor: m. hip: hip height in m.
    """

    xpos: np.ndarray
    xrot: np.ndarray
    floor: float
    hip: float

    def clearance(self, shape: Shape | Bar) -> float:
        """Height in m of a shape's lowest point above the floor."""
        heights = (self.xpos[shape.body] + shape.points @ self.xrot[shape.body].T)[:, 2]
        return float(heights.min() - shape.radius - self.floor)


def lay_soles(
    kinematics: KinematicModel, stance: Stance, planar: bool, notes: Notes
) -> list[list[str]]:
    """Add foot geoms to the editable model, and return their names for each foot."""
    names = []
    for group in range(len(kinematics.feet)):
        made = _sole(kinematics, group, stance, planar, notes)
        name = f"{kinematics.bodies[kinematics.feet[group][0]].name}_foot"
        own = [name + (f"_{n + 1}" if len(made) > 1 else "") for n in range(len(made))]
        for name, shape in zip(own, made, strict=True):
            _put(kinematics, shape, name)
        names.append(own)
    return names


def _put(kinematics: KinematicModel, shape: Shape | Bar, name: str = "") -> None:
    """Let a shape touch the floor under a name."""
    if isinstance(shape, Bar):
        shape.added(kinematics.bodies[shape.body], name)
    else:
        mark(shape.geom, True, shape.seen)
        shape.geom.name = name or shape.geom.name


def _sole(
    kinematics: KinematicModel, foot: int, stance: Stance, planar: bool, notes: Notes
) -> list[Shape | Bar]:
    """Shapes of one foot; old shapes only stay visible."""
    group, name = kinematics.feet[foot], kinematics.bodies[kinematics.feet[foot][0]].name
    solid = [tip for tip in kinematics.tips[foot] if tip.far.any()]
    if not solid:
        last = kinematics.bodies[group[-1]]
        notes.change(
            f'a sphere added to "{last.name}"', "the foot has no shape that could touch the floor"
        )
        return [Bar(group[-1], np.zeros((1, 3)), 0.03 * stance.hip, not is_drawn(last))]
    heights = [tip_points([tip], stance.xpos, stance.xrot)[:, 2].min() for tip in solid]
    band = BAND * stance.hip
    low = [tip for tip, h in zip(solid, heights, strict=True) if h <= min(heights) + band]
    _only_seen([s for i in group for s in kinematics.shapes[i]])
    made: list[Shape | Bar]
    if all(t.shape.kind in ROUND for t in low) and len(low) <= 4:
        made = [_round_foot(kinematics, t, stance, notes) for t in low]
    else:
        made = _fitted(kinematics, low, group[0], stance, band)
        what = " and ".join(sorted({t.shape.kind for t in low}))
        shapes = " and ".join(sorted({s.kind for s in made}))
        notes.change(
            f'foot "{name}": {len(made)} {shapes} in place of its {what}',
            "spheres and capsules touch the floor fastest and most smoothly",
        )
    if planar:
        made = _across(made, stance)
        notes.change(
            f'foot "{name}" widened across to {2 * stance.hip:.2g} m',
            "the body lives in a plane; wide feet keep it from tipping sideways",
        )
    return made


def _only_seen(shapes: list[Shape]) -> None:
    """Let no shape touch the floor; one of them stays visible where none was."""
    for s in shapes:
        mark(s.geom, False, s.seen or (s.solid and not any(o.seen for o in shapes)))


def _round_foot(kinematics: KinematicModel, tip: Tip, stance: Stance, notes: Notes) -> Shape | Bar:
    """Return the foot shape of a sphere or capsule.

    A sphere or a lying capsule stays as it is. A steep capsule becomes a ball at its lower end; a
    ball at its upper end may not touch the floor.
    """
    shape, i = tip.shape, tip.shape.body
    world = stance.xpos[i] + shape.points @ stance.xrot[i].T
    slope = abs(world[0, 2] - world[-1, 2]) / max(float(np.linalg.norm(world[0] - world[-1])), 1e-9)
    if shape.kind == "sphere" or (slope < STEEP and tip.far.all()):
        return shape
    lower, upper = (shape.points[[k]] for k in np.argsort(world[:, 2])[[0, -1]])
    body = kinematics.bodies[i]
    knee = body.name + UPPER_END
    count = sum(geom.name.startswith(knee) for geom in body.geoms)
    seen = not is_drawn(body)
    _put(kinematics, Bar(i, upper, shape.radius, False), knee + (f"_{count + 1}" if count else ""))
    notes.change(
        f'foot "{body.name}": the lower end of its capsule',
        "it touches the floor there; the upper end counts as a knee",
    )
    return Bar(i, lower, shape.radius, seen)


def _fitted(
    kinematics: KinematicModel, low: list[Tip], home: int, stance: Stance, band: float
) -> list[Shape | Bar]:
    """Spheres or capsules with the footprint of the low points as their lower side."""
    world = tip_points(low, stance.xpos, stance.xrot)
    thick = float(np.ptp(world[:, 2]))
    bottom = float(world[:, 2].min())
    sole = world[world[:, 2] <= bottom + band]
    low_corner, high_corner = sole.min(0)[:2], sole.max(0)[:2]
    length, width = (float(v) for v in high_corner - low_corner)
    middle = (low_corner + high_corner) / 2
    seen = not is_drawn(kinematics.bodies[home])
    least, most = 0.01 * stance.hip, max(thick / 2, 0.015 * stance.hip)

    def laid(radius: float, *ends: tuple[float, float]) -> Bar:
        points = np.array([[x, y, bottom + radius] for x, y in ends]) - stance.xpos[home]
        local = points @ stance.xrot[home]
        return bar(home, local[0], local[-1], radius, seen)

    if max(length, width) < SMALL_FOOT * stance.hip:
        radius = float(np.clip(max(length, width) / 2, least, max(thick / 2, 0.04 * stance.hip)))
        return [laid(radius, (middle[0], middle[1]))]
    narrow = min(length, width) < NARROW_FOOT * stance.hip
    radius = float(np.clip(min(length, width) / (2 if narrow else 6), least, most))
    (x, y), (to_x, to_y) = low_corner + radius, high_corner - radius
    if width < NARROW_FOOT * stance.hip:
        return [laid(radius, (x, middle[1]), (to_x, middle[1]))]
    if narrow:
        return [laid(radius, (middle[0], y), (middle[0], to_y))]
    return [laid(radius, (x, side), (to_x, side)) for side in (y, to_y)]


def _across(made: list[Shape | Bar], stance: Stance) -> list[Shape | Bar]:
    """Replace each ball and each end of a capsule by a long capsule across.

    Nothing changes in the creature's plane.
    """
    wide: list[Shape | Bar] = []
    for shape in made:
        if isinstance(shape, Shape):
            mark(shape.geom, False, True)
        across = stance.xrot[shape.body].T @ [0.0, stance.hip, 0.0]
        wide += [
            bar(shape.body, point - across, point + across, shape.radius, False)
            for point in shape.points
        ]
    return wide


def guard_parts(kinematics: KinematicModel, stance: Stance, notes: Notes) -> None:
    """Give all parts but the feet a few spheres and capsules; if they touch, the episode ends."""
    on_feet = {i for group in kinematics.feet for i in group}
    lowered = []
    for segment in kinematics.segments():
        if on_feet & set(segment):
            continue
        most = MOST_TRUNK_SHAPES if segment == kinematics.trunk else 1
        owned = [s for i in segment for s in kinematics.shapes[i]]
        chosen = [s for s in owned if s.solid]
        if not chosen and segment == kinematics.trunk:
            chosen = [s for s in owned if s.seen]
        chosen.sort(key=lambda s: -float(np.ptp(s.points, axis=0).max() + 2 * s.radius))
        for i in segment:
            _only_seen(kinematics.shapes[i])
        for s in chosen[:most]:
            guard = s if s.kind in ROUND else _inscribed(s)
            name = kinematics.bodies[s.body].name
            if stance.clearance(guard) < NEAR_FLOOR * stance.hip:
                lowered.append(name)
                continue
            _put(kinematics, guard)
            if guard is not s:
                notes.change(
                    f'"{name}": a {guard.kind} in place of its {s.kind}',
                    "for touching the floor",
                )
    for i, body in enumerate(kinematics.bodies):
        for geom in body.geoms:  # knee balls of feet collide only if they are high enough
            if UPPER_END in geom.name:
                ball = Bar(i, geom.pos[None], float(geom.size[0]), False)
                mark(geom, stance.clearance(ball) > NEAR_FLOOR * stance.hip, False)
    if lowered:
        notes.change(
            f"{', '.join(dict.fromkeys(lowered))} do not collide",
            "they are so near the floor that a good step would touch it",
        )


def _inscribed(shape: Shape) -> Bar:
    """Return a capsule along the longest side of the shape's box, a little thinner than it."""
    pos, turn = shape.geom.pos, rotation(shape.geom.quat)
    local = (shape.points - pos) @ turn
    low, high = local.min(0), local.max(0)
    half, middle = (high - low) / 2, (low + high) / 2
    longest = int(half.argmax())
    radius = max(float(np.delete(half, longest).min()), 1e-3)
    reach = max(float(half[longest]) - radius, 0.0)
    axis = np.eye(3)[longest] * reach
    a, b = (pos + turn @ (middle + sign * axis) for sign in (-1, 1))
    return bar(shape.body, a, b, radius, False)
