"""Blender add-on: an armature learns to walk by the installed program `mjxgait`.

`commands.py`, `job.py` and `footfalls.py` do without Blender: command lines, the processes that run
them, and the footfalls that a file states.
`scene.py` moves characters and motions between Blender and files; `ui.py` has operators and panel.
Blender has a Python of its own, so nothing here imports the package mjxgait.
"""


def register() -> None:
    """Add the operators and the panel to Blender."""
    from . import ui

    ui.register()


def unregister() -> None:
    """Take them out, and end what runs."""
    from . import ui

    ui.unregister()
