"""Meaning of genes and material of blocks: constants shared by both implementations of growth."""

JOINTS = ("rigid", "revolute", "twist", "universal", "bend-twist", "twist-bend", "spherical")
"""Sims' joint types, by number."""
AXES = ((), (2,), (0,), (1, 2), (2, 0), (0, 2), (0, 1, 2))
"""Hinge axes of each joint type, in the part's own axes, the first nearest to the parent."""
NEURONS = (
    *("sum", "product", "divide", "sum-threshold", "greater-than", "sign-of", "min", "max", "abs"),
    *("if", "interpolate", "sin", "cos", "atan", "log", "expt", "sigmoid", "integrate"),
    *("differentiate", "smooth", "memory", "oscillate-wave", "oscillate-saw"),
)
"""Sims' neuron functions, by number."""
INPUTS = 3
SENSORS = 7
"""Sensors of a part: the angles of up to three hinges, ground contact, and the light's direction
along its own three axes."""
SMALLEST, LARGEST = 0.02, 0.3
"""m; limits of half sizes after scaling."""
ROOM = 0.01
"""Largest overlap depth at rest with a block other than the parent, relative to the smaller one's
size (the cube root of its volume); a block that overlaps more does not grow."""
DENSITY = 1000.0
"""kg/m³; that of water."""
STRENGTH = 3000.0
"""N/m: largest torque of a hinge over the cross-section of the part it moves (Sims 1994)."""
DAMPING = 0.1
"""s: a hinge's damping over its strength; its own torque turns it at 10 rad/s at most."""
ROTOR = 0.01
"""s: a hinge's armature over its damping, so that the smallest blocks can be simulated."""
GRAVITY, FRICTION = 9.81, 0.9
"""m/s², and friction of the ground; neither acts in water."""
HARDEST = 2.0
"""Contact time constant (`solref`) in steps: the smallest that MuJoCo simulates as given."""
DRAG = 500.0
"""N·s/m³; drag of water on a face per area and normal velocity."""
IN_LIGHT = ("follow", "follow-on-land")
"""Tasks with a light; without one its observations are zero."""
LIGHT = 10.0
"""m from a creature to its light: too far to be reached."""
