"""Operators and the panel in the sidebar of the 3D view.

A job runs in its own process while a timer reads its progress, so Blender stays free. Called
without a window, as a script does, an operator waits for the end.
"""

import dataclasses
import os
import tempfile
import time
from pathlib import Path
from typing import Any, ClassVar

import bpy

from . import commands, scene
from .commands import Choices, NotStarted
from .job import Job

PERIOD = 0.25
"""Seconds between two looks at the process."""
LINE = 46
"""Characters in a line of the panel."""
ANIMATION = "walk"
"""Beginning of the name of the animation that `mjxgait export --onto` adds."""


class State:
    """The job under way, and the last result in words."""

    job: ClassVar[Job | None] = None
    said: ClassVar[str] = ""


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
        """What is asked, without Blender."""
        asked: dict[str, Any] = {
            field.name: getattr(self, field.name) for field in dataclasses.fields(Choices)
        }
        for menu in ("gait", "style"):
            asked[menu] = "" if asked[menu] == "NONE" else asked[menu]
        return Choices(**asked)


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


class Work:
    """What both operators do: a job for an armature, a timer, and a new action at the end."""

    bl_options: ClassVar[set[str]] = {"REGISTER", "UNDO"}
    animated = False
    called = "walk"
    _timer = None
    _armature = ""

    @classmethod
    def poll(cls, context: Any) -> bool:
        """Return whether a job can begin."""
        return State.job is None and scene.chosen_armature(context) is not None

    def steps(self, *given: Any) -> tuple[commands.Step, ...]:
        """Return the commands; see `commands.walk_steps`."""
        return commands.walk_steps(*given)

    def start(self, context: Any) -> Job:
        """Export the character and start the job.

        Raises:
          NotStarted: it cannot begin.
        """
        found, armature = program(context), scene.chosen_armature(context)
        settings, render = context.scene.mjxgait, context.scene.render
        folder = new_folder(context)
        scene.export_character(armature, folder / commands.CHARACTER, settings.deform_only, False)
        if self.animated:
            scene.export_character(armature, folder / commands.CYCLE, settings.deform_only, True)
        rate = commands.nearest_rate(render.fps / render.fps_base)
        self._armature, State.said = armature.name, ""
        return Job(self.steps(found, folder, settings.choices, rate), folder)

    def execute(self, context: Any) -> set[str]:
        """Do the whole job; Blender waits."""
        try:
            State.job = job = self.start(context)
        except NotStarted as why:
            return self.refuse(str(why))
        while job.running:
            time.sleep(PERIOD)
            job.poll()
        return self.finish(context)

    def invoke(self, context: Any, event: Any) -> set[str]:
        """Start the job and come back to it by a timer."""
        try:
            State.job = self.start(context)
        except NotStarted as why:
            return self.refuse(str(why))
        self._timer = context.window_manager.event_timer_add(PERIOD, window=context.window)
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context: Any, event: Any) -> set[str]:
        """Look at the job; every other event passes on."""
        if event.type != "TIMER" or State.job is None:
            return {"PASS_THROUGH"}
        State.job.poll()
        redraw(context)
        if State.job.running:
            return {"PASS_THROUGH"}
        context.window_manager.event_timer_remove(self._timer)
        return self.finish(context)

    def cancel(self, context: Any) -> None:
        """End the job, as Blender asks when it loads another file."""
        if State.job is not None:
            State.job.cancel()
            State.job = None

    def finish(self, context: Any) -> set[str]:
        """Bring the motion of a job that has ended, or say why there is none."""
        job, State.job = State.job, None
        assert job is not None
        if job.cancelled:
            return self.refuse("Cancelled", "INFO")
        if job.error:
            return self.refuse(job.error)
        armature = bpy.data.objects.get(self._armature)
        if armature is None:
            return self.refuse(
                f'"{self._armature}" is gone; its walk is {job.folder / commands.WALK}'
            )
        try:
            walk = job.folder / commands.WALK
            action, lost = scene.bring_motion(armature, walk, ANIMATION, self.called)
        except NotStarted as why:
            return self.refuse(str(why))
        lacks = f" Bones not found: {', '.join(lost[:4])}." if lost else ""
        State.said = f"{action.name}: {job.progress.verdict or 'Done'}{lacks}"
        self.report({"INFO"}, State.said)  # type: ignore[attr-defined]
        return {"FINISHED"}

    def refuse(self, why: str, kind: str = "ERROR") -> set[str]:
        """Say why nothing was made."""
        State.said = why
        self.report({kind}, why)  # type: ignore[attr-defined]
        return {"CANCELLED"}


class MJXGAIT_OT_walk(Work, bpy.types.Operator):
    """Evolve a walk for the armature; it becomes a new action."""

    bl_idname, bl_label = "mjxgait.walk", "Make it walk"


class MJXGAIT_OT_refine(Work, bpy.types.Operator):
    """Make the armature's current action walk; the result is a new action."""

    bl_idname, bl_label = "mjxgait.refine", "Fix this cycle"
    animated = True
    called = "walk, fixed"

    @classmethod
    def poll(cls, context: Any) -> bool:
        """Return whether there is a cycle to fix."""
        armature = scene.chosen_armature(context)
        data = armature and armature.animation_data
        return bool(super().poll(context) and data and data.action)

    def steps(self, *given: Any) -> tuple[commands.Step, ...]:
        """Return the commands; see `commands.refine_steps`."""
        return commands.refine_steps(*given)


class MJXGAIT_OT_cancel(bpy.types.Operator):
    """End the job and what it has started."""

    bl_idname, bl_label = "mjxgait.cancel", "Cancel"

    def execute(self, context: Any) -> set[str]:
        """End it; the operator that started it notices."""
        if State.job is not None:
            State.job.cancel()
        return {"FINISHED"}


class MJXGAIT_PT_panel(bpy.types.Panel):
    """Panel in the sidebar of the 3D view."""

    bl_label = bl_category = "mjxgait"
    bl_space_type, bl_region_type = "VIEW_3D", "UI"

    def draw(self, context: Any) -> None:
        """Draw the settings, or the job under way."""
        layout = self.layout
        layout.use_property_split = True
        if State.job is not None:
            draw_job(layout, State.job)
            return
        if why := missing(context):
            wrapped(layout, why, "ERROR")
            layout.operator("preferences.addon_show", text="Preferences").module = __package__
            return
        draw_settings(layout, context.scene.mjxgait)
        if State.said:
            wrapped(layout, State.said, "INFO")


def draw_job(layout: Any, job: Job) -> None:
    """Draw the progress, and a button that ends the job."""
    layout.progress(factor=job.progress.share, text=f"{job.progress.share:.0%}")
    wrapped(layout, job.progress.text)
    layout.operator(MJXGAIT_OT_cancel.bl_idname, icon="CANCEL")


def draw_settings(layout: Any, settings: Settings) -> None:
    """Draw the settings and both buttons."""
    for name in ("speed", "turn", "gait", "style"):
        layout.prop(settings, name, slider=True)
    layout.operator(MJXGAIT_OT_walk.bl_idname, icon="ARMATURE_DATA")
    layout.prop(settings, "keep", slider=True)
    layout.operator(MJXGAIT_OT_refine.bl_idname, icon="ACTION")
    layout.separator()
    for name in ("travelling", "deform_only", "height", "keep_movable", "freeze"):
        layout.prop(settings, name)
    for name in ("population", "generations", "seed", "more"):
        layout.prop(settings, name)


def wrapped(layout: Any, text: str, icon: str = "NONE") -> None:
    """Draw a text in lines that fit the sidebar."""
    column, line = layout.column(align=True), ""
    for word in text.split():
        if line and len(line) + len(word) >= LINE:
            column.label(text=line, icon=icon)
            line, icon = "", "BLANK1" if icon != "NONE" else "NONE"
        line = f"{line} {word}".strip()
    column.label(text=line, icon=icon)


def redraw(context: Any) -> None:
    """Draw the sidebars again."""
    for window in context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "VIEW_3D":
                area.tag_redraw()


CLASSES = (
    *(Settings, Preferences, MJXGAIT_OT_walk, MJXGAIT_OT_refine, MJXGAIT_OT_cancel),
    MJXGAIT_PT_panel,
)


def register() -> None:
    """Add the classes, and the settings to scenes."""
    for kind in CLASSES:
        bpy.utils.register_class(kind)
    bpy.types.Scene.mjxgait = bpy.props.PointerProperty(type=Settings)


def unregister() -> None:
    """Take them out, and end what runs."""
    if State.job is not None:
        State.job.cancel()
        State.job = None
    del bpy.types.Scene.mjxgait
    for kind in reversed(CLASSES):
        bpy.utils.unregister_class(kind)
