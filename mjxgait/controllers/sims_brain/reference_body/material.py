"""What genes mean, and what blocks are made of: the constants that both growths share."""

JOINTS = ("rigid", "revolute", "twist", "universal", "bend-twist", "twist-bend", "spherical")
"""Sims' kinds of joint, by number."""
AXES = ((), (2,), (0,), (1, 2), (2, 0), (0, 2), (0, 1, 2))
"""Per kind the part's own axes that its hinges turn about, the first nearest to the parent."""
NEURONS = (
    *("sum", "product", "divide", "sum-threshold", "greater-than", "sign-of", "min", "max", "abs"),
    *("if", "interpolate", "sin", "cos", "atan", "log", "expt", "sigmoid", "integrate"),
    *("differentiate", "smooth", "memory", "oscillate-wave", "oscillate-saw"),
)
"""Sims' functions, by number."""
INPUTS = 3
SENSORS = 7
"""Of a part: the angles of up to three hinges, whether it touches the ground, and the light's
direction along its own three axes."""
SMALLEST, LARGEST = 0.02, 0.3
"""m; no half size becomes smaller or larger by scaling."""
ROOM = 0.01
"""How deep a block may stand in another that it does not hang on, of the smaller one's size (the
cube root of its volume), at rest; deeper, it does not grow."""
DENSITY = 1000.0
"""kg/m³, water's."""
STRENGTH = 3000.0
"""N/m: the largest torque of a hinge over the cross-section of what it moves (Sims 1994)."""
DAMPING = 0.1
"""s: a hinge's damping over its strength; so none turns faster than 10 rad/s by itself."""
ROTOR = 0.01
"""s: its armature over its damping, so that the smallest blocks can be simulated."""
GRAVITY, FRICTION = 9.81, 0.9
"""m/s², and of the ground; there is neither in water."""
HARDEST = 2.0
"""Steps, the time constant of a touch (`solref`): the least that MuJoCo simulates as it is given."""
DRAG = 500.0
"""N·s/m³, what water does to a face per area and normal velocity."""
IN_LIGHT = ("follow", "follow-on-land")
"""Tasks in which there is a light; in all others nobody sees any."""
LIGHT = 10.0
"""m from a follower to its light: too far to be reached."""
