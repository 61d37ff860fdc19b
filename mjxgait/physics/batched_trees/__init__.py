"""Physics of a mixed population: every lane has its own tree, as data.

The equations are those of `physics.lane_major`, with the lanes innermost. Here a link's parent is a
number too, so a sum along the tree is a masked sum over all earlier links, and matrices are dense.
"""
