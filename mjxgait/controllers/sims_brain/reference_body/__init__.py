"""Reference growth of modular bodies, without JAX.

This is a second implementation of the growth in `mjxgait.controllers.sims_brain`, from the genome's
arrays by name; tests compare the two.
"""
