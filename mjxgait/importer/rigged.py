"""Model with hinges and capsules from a skeleton at rest.

The file states no body, so every choice is reported as a guess. The axes are the file's.
"""

import xml.etree.ElementTree as ET
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

from mjxgait.animation.clips.clip import Rig, written
from mjxgait.animation.clips.fbx import FBX, rig_of_fbx
from mjxgait.animation.clips.read_glb import rig_of_glb
from mjxgait.animation.clips.read_text import rig_of_bvh
from mjxgait.errors import UserError, listed
from mjxgait.importer.notes import Confidence, Guess, Notes, plain_names
from mjxgait.importer.rig import Plan
from mjxgait.importer.rig_arms import hanging
from mjxgait.importer.rig_hinges import Hinge, hinges_of
from mjxgait.importer.rig_radii import SKINNED, THICK, radii_of, slimmer
from mjxgait.importer.source import Source

RIGS: Mapping[str, Callable[[Path], Rig]] = {
    ".bvh": rig_of_bvh,
    ".glb": rig_of_glb,
    FBX: rig_of_fbx,
}
UP, OTHER, SURER = "y", "z", 1.5
"""Default up axis; the other candidate; and the least ratio of the limbs' descent to prefer it."""
DENSITY = 1000.0
"""kg/m³, the density of water and of animals."""
MOST_BONES = 400
METRES, CENTIMETRES = 4.0, 400.0
"""Heights in file units below which a skeleton is in metres, or in centimetres; else millimetres.
"""


def source_of_rig(path: Path, up: str | None, height: float | None, notes: Notes) -> Source:
    """Return the model of the skeleton in a BVH, GLB or FBX file.

    Args:
      up: the axis that points up, if the user states it. height: m, at rest.

    Raises:
      UserError: the file is damaged, or has no skeleton.
    """
    rig = _bare(RIGS[path.suffix.lower()](path))
    _check(path, rig)
    upward = Guess("up", up, "high", "as given") if up else _upward(rig)
    axis = "xyz".index(upward.value)
    plan = Plan(axis, _measured(rig, axis, height, notes))
    if not plan.limbs:
        raise UserError(
            f"{path}: all its bones begin in the middle; a creature needs legs to its left and right"
        )
    thick = radii_of(plan)
    plan, turned = hanging(plan, thick)
    hinges = hinges_of(plan)
    radii = slimmer(plan, hinges, thick)
    names = plain_names(
        [name.rpartition(":")[2] for name in plan.rig.names],
        [f"bone_{i}" for i in range(len(plan.rig.names))],
    )
    _tell(plan, hinges, names, notes)
    bones = dict(zip(names, map(written, plan.rig.names), strict=True))
    limbs = {name for name, inside in zip(names, plan.on_limbs, strict=True) if inside}
    tree = _tree(plan, hinges, radii, names, notes)
    if turned:
        arms = listed([names[bone] for bone in turned])
        notes.guess(f"arms from {arms} down", "hang", "high", "the skeleton rests with spread arms")
    return Source(
        tree,
        up=upward,
        bones=bones,
        limbs=frozenset(limbs),
        turned={names[bone]: turn.as_matrix() for bone, turn in turned.items()},
        swings=_swings(plan, hinges, names),
    )


def _swings(plan: Plan, hinges: list[list[Hinge]], names: list[str]) -> frozenset[str]:
    """Names of the hinges by which arms swing ahead and back; a spread arm has none."""
    return frozenset(
        f"{names[bone]}_{hinge.name}"
        for bone, *_ in plan.arms.values()
        for hinge in hinges[bone]
        if hinge.name == "pitch"
    )


def _bare(rig: Rig) -> Rig:
    """Remove handles that move no skin, and roots that only carry the others."""
    skinned = {b for b, skin in enumerate(rig.skins) if len(skin)}
    needed = set(range(len(rig.names)))
    if skinned:
        needed, ends = set(), list(rig.ends)
        for bone in skinned:
            while bone >= 0 and bone not in needed:
                needed.add(bone)
                bone = rig.parents[bone]
        for bone in set(range(len(rig.names))) - needed:
            parent = rig.parents[bone]  # a removed leaf still marks its parent's end
            if parent in skinned and not rig.children(bone):
                ends[parent] = np.concatenate([ends[parent], rig.places[[bone]]])
        rig = Rig(rig.names, rig.parents, rig.places, tuple(ends), rig.skins, rig.metres)
    top = min(needed, default=0)
    while len(below := [b for b in rig.children(top) if b in needed]) == 1 and top not in skinned:
        needed.discard(top)
        top = below[0]

    def within(bone: int) -> bool:
        while bone not in (top, -1):
            bone = rig.parents[bone]
        return bone == top

    return rig.taken([b for b in sorted(needed) if within(b)])


def _check(path: Path, rig: Rig) -> None:
    if not rig.names:
        raise UserError(f"{path}: has no bones")
    if len(rig.names) > MOST_BONES:
        raise UserError(
            f"{path}: {len(rig.names)} bones; more than {MOST_BONES} is not one creature"
        )
    spots = np.concatenate([rig.places, *rig.ends, *rig.skins])
    if not (np.isfinite(spots).all() and np.abs(spots).max() < 1e9):
        raise UserError(f"{path}: the place of a bone or of its skin is not a finite number")
    if not np.ptp(rig.places, axis=0).max() > 1e-6:
        raise UserError(f"{path}: all its bones are in one place; there is no skeleton to walk on")


def _upward(rig: Rig) -> Guess:
    """Up axis: glTF's, or the one along which the limbs come down to the floor."""
    if rig.metres is not None:
        return Guess("up", UP, "high", "as the file states")
    usual, other = (Plan("xyz".index(axis), rig).stands for axis in (UP, OTHER))
    if other > SURER * usual:
        return Guess(
            "up", OTHER, "medium", f"limbs come down to the floor along it, not along {UP}"
        )
    sure: Confidence = "high" if usual > SURER * other else "low"
    return Guess("up", UP, sure, "as in most BVH files")


def _measured(rig: Rig, up: int, height: float | None, notes: Notes) -> Rig:
    """Return the skeleton in metres."""
    tall = float(np.ptp(np.concatenate([rig.places, *rig.ends, *rig.skins])[:, up]))
    if height is not None:
        if not (0.0 < height < 1e3 and tall > 1e-9):
            raise UserError(f"--height {height:g}: must be the metres that it is tall at rest")
        notes.guess("height", f"{height:g} m", "high", "as given")
        return rig.scaled(height / tall)
    if rig.metres is not None:
        notes.guess("height", f"{rig.metres * tall:.3g} m", "high", "the file states its unit")
        return rig.scaled(rig.metres)
    unit, name = (
        (1.0, "metres")
        if tall < METRES
        else (0.01, "centimetres")
        if tall < CENTIMETRES
        else (0.001, "millimetres")
    )
    notes.guess(
        "height",
        f"{unit * tall:.3g} m",
        "low",
        f"{tall:.3g} units of the file, taken for {name}; --height says otherwise",
    )
    return rig.scaled(unit)


def _tree(
    plan: Plan, hinges: list[list[Hinge]], radii: list[float], names: list[str], notes: Notes
) -> ET.Element:
    rig = plan.rig
    root = ET.Element("mujoco", model="rig")
    gravity = np.zeros(3)
    gravity[plan.up] = -9.81
    ET.SubElement(root, "compiler", angle="degree", autolimits="true")
    ET.SubElement(root, "option", gravity=_text(gravity))
    bodies: list[ET.Element] = []
    volume = 0.0
    for bone, (name, parent) in enumerate(zip(names, rig.parents, strict=True)):
        above = ET.SubElement(root, "worldbody") if parent < 0 else bodies[parent]
        place = rig.places[bone] - (rig.places[parent] if parent >= 0 else 0.0)
        bodies.append(ET.SubElement(above, "body", name=name, pos=_text(place)))
        if parent < 0:
            ET.SubElement(bodies[-1], "freejoint", name="root")
        for hinge in hinges[bone]:
            ET.SubElement(
                bodies[-1],
                "joint",
                name=f"{name}_{hinge.name}",
                axis=_text(hinge.axis),
                range=f"{hinge.low:g} {hinge.high:g}",
            )
        for start, end in plan.capsules(bone, radii[bone]):
            ends = _text(np.concatenate([start, end]) - np.tile(rig.places[bone], 2))
            size, density = f"{radii[bone]:.6g}", f"{DENSITY:g}"
            shape = {"type": "capsule", "fromto": ends, "size": size, "density": density}
            ET.SubElement(bodies[-1], "geom", shape)
            length = float(np.linalg.norm(end - start))
            volume += np.pi * radii[bone] ** 2 * (length + 4 / 3 * radii[bone])
    notes.guess(
        "density",
        f"{DENSITY:g} kg/m³",
        "medium",
        f"that of water, as of animals: {DENSITY * volume:.3g} kg in all",
    )
    return root


def _tell(plan: Plan, hinges: list[list[Hinge]], names: list[str], notes: Notes) -> None:
    skinned = sum(len(skin) >= SKINNED for skin in plan.rig.skins)
    notes.guess(
        "shapes",
        f"capsules along {len(names)} bones",
        "medium" if skinned else "low",
        f"of {skinned} as thick as the skin that follows them"
        if skinned
        else f"radius of limbs {THICK:.0%} of their length, the trunk as wide as its limbs",
    )
    alike: dict[tuple[str, Confidence, str], list[str]] = {}
    for name, own in zip(names, hinges, strict=True):
        if own:
            turns = ", ".join(f"{h.name} {h.low:.0f} to {h.high:.0f}" for h in own)
            alike.setdefault((turns, own[0].confidence, own[0].reason), []).append(name)
    for (turns, confidence, reason), those in alike.items():
        notes.guess(f"hinges of {listed(those)}", f"{turns} deg", confidence, reason)
    if plan.feet:
        feet = listed([names[bone] for bone in plan.feet])
        notes.guess(f"soles of {feet}", "from heel to toe", "medium", "it stands on two feet")
    if rigid := [name for name, own in zip(names[1:], hinges[1:], strict=True) if not own]:
        notes.guess("rigid", listed(rigid), "medium", "too short to matter, or within the trunk")


def _text(values: np.ndarray) -> str:
    return " ".join(f"{value:.9g}" for value in values)
