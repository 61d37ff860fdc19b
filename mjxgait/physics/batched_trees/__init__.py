"""Physics of a mixed population: every lane has a tree of its own, as data.

The equations are those of `physics.fast`, with the lanes innermost. What differs: whose parent a
link has is a number too, so a sum along the tree is a sum over all links that come before, with a
mask, and matrices are dense.
"""
