"""Creatures of blocks as people and the examiner know them: grown plainly, without JAX.

What evolution grows in arrays (`mjxgait.controllers.sims_brain`) is grown here a second time, from the genome's
arrays by name; the tests hold the two to each other.
"""
