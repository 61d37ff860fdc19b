"""Use the add-on in Blender as its buttons do, and report what came of it.

PYTHON in_blender.py ZIP PROGRAM CHARACTER FOLDER; PYTHON has Blender as a module. Installs ZIP,
opens CHARACTER, presses both buttons, and writes what Blender exports then: walk.glb, fixed.glb.
Prints a line of JSON.
"""

import importlib
import json
import math
import sys
from pathlib import Path
from types import SimpleNamespace

import bpy
from mathutils import Euler, Vector

sys.path.append(str(Path(__file__).parents[2] / "benchmarks"))
from rig_of_blender import wrapped

archive, program, character, folder = sys.argv[1:]
MODULE = "bl_ext.user_default.mjxgait"
FRAMES_PER_S = 30


def main() -> None:
    bpy.ops.wm.read_factory_settings(use_empty=True)
    installed = bpy.ops.extensions.package_install_files(
        filepath=archive, repo="user_default", enable_on_install=True
    )
    ui = importlib.import_module(f"{MODULE}.ui")
    preferences = bpy.context.preferences.addons[MODULE].preferences
    told: dict[str, object] = {"installed": list(installed)}
    armature = opened()
    told["absent"] = refused(preferences, ui)
    preferences.program, preferences.folder = program, str(Path(folder) / "runs")
    settings = bpy.context.scene.mjxgait
    settings.gait, settings.speed = "trot", 0.5
    things = len(bpy.data.objects)
    told["walked"] = list(bpy.ops.mjxgait.walk())
    told["said"] = ui.State.said
    told["action"] = said(armature)
    told["left_behind"] = len(bpy.data.objects) - things
    exported("walk.glb", armature)
    told["fixed"] = list(bpy.ops.mjxgait.refine())
    told["kept"] = sorted(action.name for action in bpy.data.actions)
    exported("fixed.glb", armature)
    told["modal"] = by_timer(ui, armature)
    told["drawn"] = drawn(ui)
    print("told", json.dumps(told))


def opened() -> bpy.types.Object:
    """The character, moved and turned as an artist leaves it, in pose mode and posed."""
    bpy.context.scene.render.fps = FRAMES_PER_S
    bpy.ops.import_scene.gltf(filepath=character)
    armature = next(thing for thing in bpy.data.objects if thing.type == "ARMATURE")
    for thing in [thing for thing in bpy.data.objects if thing.type == "MESH"]:
        bpy.data.objects.remove(thing)  # a mesh of points, which Blender does not export
    bpy.context.view_layer.objects.active = armature
    bpy.ops.object.mode_set(mode="EDIT")
    for bone in armature.data.edit_bones:  # along the limbs, so their axes are no longer the file's
        bone.tail = bone.children[0].head if bone.children else bone.head + Vector((0, -5, -1))
        bone.roll = 0.3
    bpy.ops.object.mode_set(mode="OBJECT")
    wrapped(armature)
    armature.location, armature.rotation_mode = (0.4, -0.2, 0.0), "XYZ"
    armature.rotation_euler.z += math.radians(30)
    for number, bone in enumerate(armature.pose.bones):
        bone.rotation_mode = ("QUATERNION", "XYZ", "ZYX", "AXIS_ANGLE")[number % 4]
    armature.pose.bones["Neck"].matrix_basis = Euler((0.3, 0.0, 0.0)).to_matrix().to_4x4()
    bpy.ops.object.mode_set(mode="POSE")
    return armature


def refused(preferences: bpy.types.AddonPreferences, ui: object) -> str:
    """What the button says if there is no program."""
    preferences.program = "/nowhere/mjxgait"
    try:
        bpy.ops.mjxgait.walk()
    except RuntimeError:  # how an error of an operator arrives in a script
        return ui.State.said
    return ""


def said(armature: bpy.types.Object) -> dict[str, object]:
    action = armature.animation_data.action
    return {
        "name": action.name,
        "range": list(action.frame_range),
        "cyclic": action.use_cyclic,
        "mode": bpy.context.mode,
        "markers": sorted((marker.name, marker.frame) for marker in action.pose_markers),
    }


def exported(name: str, armature: bpy.types.Object) -> None:
    bpy.ops.object.mode_set(mode="OBJECT")
    bpy.ops.export_scene.gltf(
        filepath=str(Path(folder) / name),
        export_format="GLB",
        export_animation_mode="ACTIVE_ACTIONS",
        export_optimize_animation_size=False,
        export_anim_slide_to_zero=True,
        export_def_bones=False,
    )
    bpy.context.view_layer.objects.active = armature


def by_timer(ui: object, armature: bpy.types.Object) -> dict[str, object]:
    """What an operator does with a window: here Blender's part is played by hand."""
    calls, reports = [], []
    manager = SimpleNamespace(
        windows=[],
        event_timer_add=lambda period, window: calls.append("timer") or "timer",
        event_timer_remove=lambda timer: calls.append("no timer"),
        modal_handler_add=lambda operator: calls.append("handler"),
    )
    context = SimpleNamespace(
        **{name: getattr(bpy.context, name) for name in ("object", "scene", "preferences")},
        window_manager=manager,
        window=None,
    )
    operator = ui.Work()
    operator.report = lambda kind, text: reports.append(text)
    began = operator.invoke(context, None)
    job, tick = ui.State.job, SimpleNamespace(type="TIMER")
    passed = operator.modal(context, SimpleNamespace(type="MOUSEMOVE"))
    waits = operator.modal(context, tick)
    panel = drawn(ui)
    busy = ui.Work.poll(context)
    bpy.ops.mjxgait.cancel()
    ended = operator.modal(context, tick)
    return {
        "results": [*began, *passed, *waits, *ended],
        "calls": calls,
        "reports": reports,
        "panel": panel,
        "busy": busy,
        "ended": job.cancelled and not job.running,
    }


class Layout:
    """Notes what is drawn; a property or an operator that does not exist is an error."""

    def __init__(self, notes: list[str]) -> None:
        self.notes = notes

    def prop(self, data: object, name: str, slider: bool = False) -> None:
        self.notes.append(data.bl_rna.properties[name].name)

    def operator(self, name: str, text: str = "", icon: str = "NONE") -> SimpleNamespace:
        group, _, own = name.partition(".")
        self.notes.append(text or getattr(getattr(bpy.ops, group), own).get_rna_type().name)
        return SimpleNamespace()

    def label(self, text: str, icon: str) -> None:
        self.notes.append(text)

    def progress(self, factor: float, text: str) -> None:
        self.notes.append(f"{factor} {text}")

    def column(self, align: bool) -> "Layout":
        return self

    def separator(self) -> None:
        pass


def drawn(ui: object) -> list[str]:
    notes: list[str] = []
    ui.MJXGAIT_PT_panel.draw(SimpleNamespace(layout=Layout(notes)), bpy.context)
    return notes


main()
