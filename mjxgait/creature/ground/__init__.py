"""The ground as height and normal at (x, y).

`spec` describes it; `surface` computes it in the compiled program. Docs: docs/reference/ground.md.
"""
