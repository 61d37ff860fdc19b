"""The ground as height and normal at (x, y): what it may be (`spec`), and the same for the compiled
program (`surface`). Docs: docs/ground.md.
"""
