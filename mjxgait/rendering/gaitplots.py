"""Plots of one walk: footfalls, joint angles with their targets, trunk height and speed."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from mjxgait.reference.measure import spells
from mjxgait.rendering.curves import ACCENT, DARK, MIDDLE, Figures, titled
from mjxgait.rendering.walk import WARMUP, Walk

STRIDES = 2
"""Strides shown."""
FALLBACK = 2.0
"""Time shown of a walk without steady strides, s."""
ROW = 0.28
"""Half the height of a footfall bar."""


def subject_of(walk: Walk) -> str:
    """Return creature, seed and mean speed of a walk, with which its titles begin."""
    seed = walk.champion.origin.get("seed")
    seeds = [] if seed is None else [f"seed {seed}"]
    return ", ".join([walk.creature.title, *seeds, _outcome(walk)])


def _outcome(walk: Walk) -> str:
    """Mean straight-line speed from `WARMUP` on, or the time of a fall."""
    if np.isfinite(walk.fell):
        return f"fell at {walk.fell:.1f} s"
    last = len(walk.trunk_pos) - 1
    first = min(round(WARMUP / walk.time_step), last // 2)
    moved = walk.trunk_pos[last] - walk.trunk_pos[first]
    # In water there is no level way.
    way = np.linalg.norm(moved) if walk.afloat else moved[:2] @ walk.forward
    return f"{way / ((last - first) * walk.time_step):.2f} m/s"


def gait_window(walk: Walk, strides: int = STRIDES) -> tuple[slice, str]:
    """Return the frames to show and their description: steady strides, or the beginning of the walk
    if it has none.
    """
    found = walk.steady_strides(strides)
    if found:
        return slice(*found), f"{strides} strides from {found[0] * walk.time_step:.2f} s on"
    last = min(len(walk.qpos), round(FALLBACK / walk.time_step))
    what = (
        f"it fell after {walk.fell:.2f} s" if np.isfinite(walk.fell) else "it has no steady stride"
    )
    return slice(0, last), f"the first {last * walk.time_step:.2f} s; {what}"


def draw_footfalls(axes: Axes, walk: Walk) -> None:
    """Draw a bar while a foot carries weight (Hildebrand's diagram)."""
    window, what = gait_window(walk)
    contact, step = walk.recording.contact[window], walk.time_step
    names = walk.creature.feet.names
    share = contact.mean(0)
    for row, foot in enumerate(contact.T):
        for begin, end in spells(foot):
            axes.add_patch(
                Rectangle(
                    (begin * step, row - ROW),
                    (end - begin) * step,
                    2 * ROW,
                    facecolor=DARK,
                    linewidth=0,
                )
            )
        axes.text(len(contact) * step * 1.01, row, f"{share[row]:.0%}", va="center")
    labels = [_plain(name).removesuffix(" foot").removesuffix(" lower") for name in names]
    axes.set(
        xlim=(0, len(contact) * step),
        ylim=(len(names) - 0.5, -0.5),
        xlabel="time (s)",
        title=titled(subject_of(walk), f"footfalls, with each foot's duty factor; {what}"),
    )
    axes.set_yticks(range(len(names)), labels)
    axes.grid(False, axis="y")
    _mark_strides(axes, walk, window)
    if axes.get_legend_handles_labels()[0]:
        axes.legend(loc="lower left", bbox_to_anchor=(0.75, 1.0))


def draw_joints(drawing: Figure, walk: Walk) -> None:
    """Draw angle and target of every joint, mirror partners in one row and on one scale."""
    window, what = gait_window(walk)
    pairs, middle = _partners(walk)
    order = [*pairs, *middle]
    columns = 2 if len(order) <= 20 else 4
    axes = drawing.subplots(-(-len(order) // columns), columns, sharex=True, squeeze=False)
    for left, right in axes.reshape(-1, 2)[: len(pairs) // 2]:
        right.sharey(left)
        right.tick_params(labelleft=False)
    angles, targets = (
        np.degrees(walk.recording.joint_pos[window]),
        np.degrees(walk.trajectory.target[0][window]),
    )
    time = np.arange(len(angles)) * walk.time_step
    for place, panel in enumerate(axes.flat):
        if place >= len(order):
            panel.set_visible(False)
            continue
        j = order[place]
        panel.plot(time, targets[:, j], "--", color=MIDDLE, linewidth=1.2, label="target")
        panel.plot(time, angles[:, j], "-", color=DARK, linewidth=1.5, label="angle")
        panel.set_title(_plain(walk.creature.joints.names[j]), fontsize=9)
        _mark_strides(panel, walk, window)
        panel.set_xlim(0, time[-1])
        panel.tick_params(labelsize=8)
    drawing.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside upper right", ncols=3)
    drawing.supxlabel("time (s)", fontsize=10)
    drawing.supylabel("joint angle (°)", fontsize=10)
    title = titled(subject_of(walk), f"joint angles and their targets; {what}")
    drawing.suptitle(title, fontsize=11, x=0.01, ha="left")


def draw_trunk(drawing: Figure, walk: Walk) -> None:
    """Draw height and forward speed of the trunk over the whole walk."""
    recording, step = walk.recording, walk.time_step
    time = np.arange(len(recording.trunk_pos)) * step
    above, below = drawing.subplots(2, 1, sharex=True)
    above.plot(time, recording.trunk_pos[:, 2], "-", color=DARK, linewidth=1)
    above.axhline(walk.creature.frame.stand_height, color=MIDDLE, linestyle=":", label="standing")
    title = titled(subject_of(walk), "trunk: height above the floor and forward speed")
    above.set(ylabel="height (m)", title=title)
    above.set_ylim(
        0, max(1.35 * np.nanmax(recording.trunk_pos[:, 2]), 1.4 * walk.creature.frame.stand_height)
    )
    speed = np.gradient(recording.trunk_pos[:, 0], step)
    below.plot(time, speed, "-", color="0.7", linewidth=0.8, label="at each moment")
    if (starts := walk.stride_frames()).size > 1:
        way = np.diff(recording.trunk_pos[starts, 0]) / (np.diff(starts) * step)
        below.step(
            starts * step,
            [*way, way[-1]],
            where="post",
            color=DARK,
            linewidth=1.8,
            label="mean of each stride",
        )
    below.axhline(0, color=DARK, linewidth=0.8)
    below.set(xlabel="time (s)", ylabel="speed (m/s)", xlim=(0, time[-1]))
    low, high = np.nanpercentile(speed, [1, 99])
    below.set_ylim(min(1.2 * low, -0.05), max(1.5 * high, 0.1))
    for panel in (above, below):
        if np.isfinite(walk.fell):
            panel.axvline(
                walk.fell, color=ACCENT, linewidth=1.5, label=f"fell at {walk.fell:.2f} s"
            )
        panel.legend(loc="upper right", ncols=3)


def gait_figures(walk: Walk) -> Figures:
    """Return the plots of this file by file name."""
    rows = -(-len(walk.creature.joints.names) // 2)
    return {
        "footfalls": (
            (9, 1.1 + 0.42 * len(walk.creature.feet.names)),
            lambda drawing: draw_footfalls(drawing.subplots(), walk),
        ),
        "joints": ((9, 1.2 + 1.15 * rows), lambda drawing: draw_joints(drawing, walk)),
        "trunk": ((9, 4.7), lambda drawing: draw_trunk(drawing, walk)),
    }


def _mark_strides(axes: Axes, walk: Walk, window: slice) -> None:
    """Draw a line where a new stride begins."""
    for frame in walk.stride_frames():
        if window.start < frame < window.stop:
            axes.axvline(
                (frame - window.start) * walk.time_step,
                color=ACCENT,
                linewidth=1.2,
                zorder=3,
                label="a new stride begins",
            )


def _partners(walk: Walk) -> tuple[list[int], list[int]]:
    """Joints in pairs of left and right, and those of the middle."""
    partner = walk.creature.mirror.partner
    pairs = [(j, int(p)) for j, p in enumerate(partner) if j < p]
    return [j for pair in pairs for j in pair], [j for j, p in enumerate(partner) if j == p]


def _plain(name: str) -> str:
    return name.replace("_", " ")
