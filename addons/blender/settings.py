"""What the user sets: the panel's settings, and the add-on's preferences."""

import dataclasses
import os
import tempfile
from pathlib import Path
from typing import Any

import bpy

from . import commands
from .commands import Choices, NotStarted

LINE = 46
"""Characters in a line of the panel."""


def items(names: tuple[str, ...], none: str) -> list[tuple[str, str, str]]:
    """Return the items of a menu; the first, NONE, stands for no choice."""
    return [("NONE", none, ""), *((name, name.capitalize(), "") for name in names)]


class Settings(bpy.types.PropertyGroup):
    """Settings of the panel; they belong to the scene."""

    speed: bpy.props.FloatProperty(  # type: ignore[valid-type]
        name="Speed",
        description="Body lengths per second; 0: whatever evolves",
        min=0.0,
        soft_max=3.0,
        step=10,
    )
    turn: bpy.props.FloatProperty(  # type: ignore[valid-type]
        name="Turn", description="Degrees per second to the left", soft_min=-45.0, soft_max=45.0
    )
    gait: bpy.props.EnumProperty(name="Gait", items=items(commands.GAITS, "Any"))  # type: ignore[valid-type]
    style: bpy.props.EnumProperty(name="Style", items=items(commands.STYLES, "None"))  # type: ignore[valid-type]
    travelling: bpy.props.BoolProperty(  # type: ignore[valid-type]
        name="Move the root", description="Otherwise the character walks in place"
    )
    keep: bpy.props.FloatProperty(  # type: ignore[valid-type]
        name="Keep",
        description="Share of your cycle that stays: 1 keeps its poses, 0 allows 30 degrees",
        min=0.0,
        max=1.0,
        default=0.5,
    )
    keep_movable: bpy.props.StringProperty(  # type: ignore[valid-type]
        name="Movable",
        description="Bones that carry no leg and may move, such as neck* tail*",
    )
    freeze: bpy.props.StringProperty(  # type: ignore[valid-type]
        name="Frozen", description="Bones that stay as they rest, such as toe*"
    )
    height: bpy.props.FloatProperty(  # type: ignore[valid-type]
        name="Height", description="Of the character at rest, in m; 0: as it is", min=0.0
    )
    deform_only: bpy.props.BoolProperty(  # type: ignore[valid-type]
        name="Deform bones only", description="Leave out bones that move no skin, such as controls"
    )
    population: bpy.props.IntProperty(  # type: ignore[valid-type]
        name="Population", description="0: the program's own", min=0
    )
    generations: bpy.props.IntProperty(  # type: ignore[valid-type]
        name="Generations", description="At most so many; 0: the program's own", min=0
    )
    seed: bpy.props.IntProperty(name="Seed", description="Another one, another walk", min=0)  # type: ignore[valid-type]
    more: bpy.props.StringProperty(  # type: ignore[valid-type]
        name="Options", description="Further options of mjxgait train or refine"
    )

    @property
    def choices(self) -> Choices:
        """Chosen settings, without Blender."""
        chosen: dict[str, Any] = {
            field.name: getattr(self, field.name) for field in dataclasses.fields(Choices)
        }
        for menu in ("gait", "style"):
            chosen[menu] = "" if chosen[menu] == "NONE" else chosen[menu]
        return Choices(**chosen)


class Preferences(bpy.types.AddonPreferences):
    """Preferences of the add-on."""

    bl_idname = __package__

    program: bpy.props.StringProperty(  # type: ignore[valid-type]
        name="Program",
        description="Path of mjxgait; empty: the one on the search path",
        subtype="FILE_PATH",
    )
    folder: bpy.props.StringProperty(  # type: ignore[valid-type]
        name="Runs",
        description="Folder for the run of each job; empty: a temporary one",
        subtype="DIR_PATH",
    )

    def draw(self, context: Any) -> None:
        """Draw them, with a note if the program is missing."""
        for name in ("program", "folder"):
            self.layout.prop(self, name)
        if why := missing(context):
            wrapped(self.layout, why, "ERROR")


def preferences(context: Any) -> Any:
    """Return the add-on's preferences."""
    return context.preferences.addons[__package__].preferences


def program(context: Any) -> str:
    """Return the path of `mjxgait`; see `find_program`."""
    return commands.find_program(bpy.path.abspath(preferences(context).program))


def missing(context: Any) -> str:
    """Return why there is no program; empty if there is one."""
    try:
        program(context)
    except NotStarted as why:
        return str(why)
    return ""


def new_folder(context: Any) -> Path:
    """Make the folder of a job.

    Raises:
      NotStarted: it cannot be made.
    """
    place = bpy.path.abspath(preferences(context).folder) or None
    try:
        if place:
            os.makedirs(place, exist_ok=True)
        return Path(tempfile.mkdtemp(prefix="mjxgait-", dir=place or bpy.app.tempdir or None))
    except OSError as error:
        raise NotStarted(f"{place}: cannot be written ({error.strerror or error})") from None


def wrapped(layout: Any, text: str, icon: str = "NONE") -> None:
    """Draw a text in lines that fit the sidebar."""
    column, line = layout.column(align=True), ""
    for word in text.split():
        if line and len(line) + len(word) >= LINE:
            column.label(text=line, icon=icon)
            line, icon = "", "BLANK1" if icon != "NONE" else "NONE"
        line = f"{line} {word}".strip()
    column.label(text=line, icon=icon)
