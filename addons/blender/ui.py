"""Operators and the panel in the sidebar of the 3D view.

A job runs in its own process while a timer reads its progress, so Blender stays free. Called
without a window, as a script does, an operator waits for the end.
"""

import time
from typing import Any, ClassVar

import bpy

from . import commands, scene
from .commands import NotStarted
from .job import Job
from .settings import Preferences, Settings, missing, new_folder, program, wrapped

PERIOD = 0.25
"""Seconds between two looks at the process."""
ANIMATION = "walk"
"""Beginning of the name of the animation that `mjxgait export --onto` adds."""


class State:
    """The job under way, and the last result in words."""

    job: ClassVar[Job | None] = None
    said: ClassVar[str] = ""


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
