"""Measurements of a recorded trajectory: contacts, slip, clearance, power, strides.

Letters: `T` frames, `J` actuated joints, `N` feet, `B` bodies, `R` strides.
"""

import dataclasses
import itertools

import mujoco
import numpy as np

from mjxgait.creature import Creature
from mjxgait.creature.geometry import posed
from mjxgait.reference.frames import FrameReader
from mjxgait.reference.grown import Grown, seen_grown
from mjxgait.reference.layout import foot_middles, level_nose, start_frame
from mjxgait.reference.outcome import Trajectory
from mjxgait.reference.overlap import overlaps
from mjxgait.reference.starts import Starts
from mjxgait.reference.terrain import terrain_of

CARRIES = 1e-3
"""Share of the body weight above which a foot is in contact; less is solver residue."""


@dataclasses.dataclass(frozen=True)
class Dimensions:
    """Sizes of the body against which a gait is evaluated, in m, kg, m/s².

    torque_limit: N·m per joint. joint_range: rad per joint, infinite without one.
    foot_places: m forward and left of the trunk when standing, per foot.
    crawler: whether parts other than feet may touch the floor.
    partner: joint on the other side, per joint; empty for an asymmetric body.
    stand_tilt: deg of the trunk's up axis when standing.
    shapeless: share of the mass of moving parts without any shape.
    """

    stand_height: float
    hip_height: float
    body_length: float
    mass: float
    gravity: float
    torque_limit: tuple[float, ...]
    joint_range: tuple[tuple[float, float], ...]
    foot_names: tuple[str, ...]
    foot_places: tuple[tuple[float, float], ...]
    crawler: bool = False
    partner: tuple[int, ...] = ()
    stand_tilt: float = 0.0
    shapeless: float = 0.0


@dataclasses.dataclass(frozen=True, eq=False)
class Recording:
    """One simulation, frame by frame.

    time_step: s.
    trunk_pos: [T, 3] m forward and left of the start, and above the ground.
    trunk_up: [T] trunk's up axis . world up. pitch, roll: [T] rad.
    joint_pos, joint_vel, torque: [T, J] rad, rad/s, N·m.
    foot_force: [T, N] N, normal. foot_slip: [T, N] m/s, tangential, of the foot's material at the
    contact; 0 without contact.
    foot_height: [T, N] m, lowest point above the ground.
    touch: [T] whether a part other than feet and permitted geoms touches the ground.
    penetration: [T] m, deepest contact with the floor.
    body_speed: [T] m/s, centre of mass of the fastest body; the origin of one without mass.
    heading: [T] rad of the trunk, left of the start's forward, without jumps.
    goal: m ahead of the start; 0 if the task has none.
    light: [3] m, place in the world; None if the task has none.
    clearance: [T] m to the bar, `bar.FAR` at most; None if the task has none.
    grown: additional measurements of a modular body; None for others.
    foot_ahead: [T, N] m along the trunk's nose from the trunk to the foot; None if not measured.
    overlap_pairs: names of the P pairs of parts that ever overlap. overlap: [T, P] m, depth.
    """

    dimensions: Dimensions
    time_step: float
    trunk_pos: np.ndarray
    trunk_up: np.ndarray
    pitch: np.ndarray
    roll: np.ndarray
    joint_pos: np.ndarray
    joint_vel: np.ndarray
    torque: np.ndarray
    foot_force: np.ndarray
    foot_slip: np.ndarray
    foot_height: np.ndarray
    touch: np.ndarray
    penetration: np.ndarray
    body_speed: np.ndarray
    overlap_pairs: tuple[tuple[str, str], ...]
    overlap: np.ndarray
    heading: np.ndarray | None = None
    goal: float = 0.0
    clearance: np.ndarray | None = None
    grown: Grown | None = None
    light: np.ndarray | None = None
    foot_ahead: np.ndarray | None = None

    @property
    def contact(self) -> np.ndarray:
        """Whether each foot carries weight [T, N]."""
        return self.foot_force > CARRIES * self.dimensions.mass * self.dimensions.gravity

    def window(self, begin: float, end: float = np.inf) -> "Recording":
        """Return the frames from `begin` to `end` in s."""
        frames = slice(
            round(begin / self.time_step), None if np.isinf(end) else round(end / self.time_step)
        )
        arrays = {
            f.name: getattr(self, f.name)[frames]
            for f in dataclasses.fields(self)
            if isinstance(getattr(self, f.name), np.ndarray) and f.name != "light"
        }
        grown = self.grown and self.grown.window(frames)
        return dataclasses.replace(self, **arrays, grown=grown)


def dimensions(creature: Creature) -> Dimensions:
    """Return the sizes of a creature."""
    model = creature.model
    data = posed(model, creature.stand_qpos)
    axes = data.xmat[creature.trunk].reshape(3, 3) @ np.stack(
        [creature.frame.forward, creature.frame.left], 1
    )
    up = data.xmat[creature.trunk].reshape(3, 3) @ creature.frame.up
    feet = foot_middles(creature, data.geom_xpos[None])[0]
    middles = (feet - data.xpos[creature.trunk]) @ axes
    return Dimensions(
        stand_height=creature.frame.stand_height,
        hip_height=creature.frame.hip_height,
        body_length=creature.frame.body_length,
        mass=creature.frame.mass,
        gravity=creature.gravity,
        torque_limit=tuple(map(float, creature.gains.torque_limit)),
        joint_range=tuple(
            (float(low), float(high))
            for low, high in zip(creature.joints.low, creature.joints.high, strict=True)
        ),
        foot_names=creature.feet.names,
        foot_places=tuple((float(forward), float(left)) for forward, left in middles),
        crawler=len(creature.feet.ground) > 0,
        partner=creature.mirror.partners if creature.mirror.symmetric else (),
        stand_tilt=float(np.degrees(np.arccos(min(up[2], 1.0)))),
        shapeless=_shapeless(model),
    )


def _shapeless(model: mujoco.MjModel) -> float:
    """Return the share of the mass of moving parts, with what is fixed to them, without a shape."""
    part = model.body_weldid
    bare = ~np.isin(part, part[model.geom_bodyid])
    return float(model.body_mass[bare].sum() / model.body_mass.sum())


def measure(
    creature: Creature,
    trajectory: Trajectory,
    row: int = 0,
    inside: bool = True,
    aimed: Starts | None = None,
    drag: float | None = None,
) -> Recording:
    """Replay one undisturbed simulation: set every stored frame in C MuJoCo, read its contacts.

    Frames after a simulation blew up are NaN, which no criterion accepts.

    Args:
      inside: whether to measure overlaps of parts; with meshes this takes a quarter of the time.
      aimed: initial conditions, if the task has a goal or a bar.
      drag: N·s/m³ of the water around a modular body, 0 on land; None for other bodies. In a
        modular body overlaps of the standing pose count, too.
    """
    start = start_frame(creature)
    qpos, qvel, torque = trajectory.qpos[row], trajectory.qvel[row], trajectory.torque[row]
    bar = None if aimed is None or np.isinf(aimed.bar[row, 0]) else aimed.bar[row]
    light = None if aimed is None or not aimed.light[row].any() else aimed.light[row]
    frames = _replayed(creature, qpos, qvel, torque, bar)
    forward, left, up = (
        frames.trunk_rot @ axis
        for axis in (creature.frame.forward, creature.frame.left, creature.frame.up)
    )
    moved = frames.trunk_pos - start.place * [1, 1, 0]
    ground = terrain_of(creature)
    above = moved[:, 2] - (ground.height(*frames.trunk_pos[:, :2].T) if ground else 0.0)
    crossed = overlaps(creature, qpos if inside else qpos[:0], excused=drag is None)
    return Recording(
        dimensions=dimensions(creature),
        time_step=trajectory.time_step,
        trunk_pos=np.stack([moved @ start.forward, moved @ start.left, above], 1),
        trunk_up=up[:, 2],
        pitch=-np.arcsin(np.clip(forward[:, 2], -1, 1)),
        roll=np.arcsin(np.clip(left[:, 2], -1, 1)),
        joint_pos=qpos[:, creature.joints.qpos_adr],
        joint_vel=qvel[:, creature.joints.dof_adr],
        torque=torque,
        foot_force=frames.foot_force,
        foot_slip=frames.foot_slip,
        foot_height=frames.foot_height,
        touch=frames.touch,
        penetration=frames.penetration,
        body_speed=frames.body_speed,
        overlap_pairs=crossed.pairs,
        heading=np.unwrap(np.arctan2(forward @ start.left, forward @ start.forward)),
        overlap=crossed.depth if inside else np.zeros((len(qpos), 0)),
        goal=0.0 if aimed is None else float(aimed.goal[row]),
        clearance=None if bar is None else frames.clearance,
        light=None if light is None else start.place + light,
        grown=None if drag is None else seen_grown(creature, qpos, qvel, drag),
        foot_ahead=_ahead(frames),
    )


def _replayed(
    creature: Creature,
    qpos: np.ndarray,
    qvel: np.ndarray,
    torque: np.ndarray,
    bar: np.ndarray | None,
) -> FrameReader:
    """Set every frame [T] in C MuJoCo, up to the first that is not finite."""
    frames = FrameReader(creature, len(qpos), bar)
    for k in range(len(qpos)):
        if not (np.isfinite(qpos[k]).all() and np.isfinite(qvel[k]).all()):
            break
        frames.read(k, qpos[k], qvel[k], torque[k])
    frames.finish()
    return frames


def _ahead(frames: FrameReader) -> np.ndarray:
    """Return the distance [T, N] in m from the trunk to each foot, along its level nose."""
    apart = foot_middles(frames.creature, frames.geom_xpos) - frames.trunk_pos[:, None]
    nose = level_nose(frames.creature, frames.trunk_rot)
    found: np.ndarray = np.einsum("tnx,tx->tn", apart, nose)
    return found


SWING = 0.03
"""Rise of a foot in a swing, in hip heights; the swing ends at half of it."""


def stride_starts(recording: Recording) -> np.ndarray:
    """Return the frames [R + 1] at which strides begin: one foot's footfalls; empty without a walk.

    That foot lands most evenly of those that swing at least as often as the median foot. A foot
    that trembles or scuffs in some strides does not mark strides.
    """
    falls = falls_of_feet(recording)
    usual = sorted(map(len, falls))[(len(falls) - 1) // 2]
    often = [foot for foot in falls if len(foot) >= max(usual, 2)]
    return min(often, key=_unevenness, default=np.zeros(0, dtype=int))


def falls_of_feet(recording: Recording) -> list[np.ndarray]:
    """Return the frames at which each foot [N] has come down from a swing."""
    threshold = SWING * recording.dimensions.hip_height
    return [footfalls(height, threshold) for height in recording.foot_height.T]


def footfalls(height: np.ndarray, threshold: float) -> np.ndarray:
    """Return the frames at which a foot of height [T] in m has come down from a swing."""
    swinging, frames = _swinging(height, threshold)
    return frames[1:][np.diff(swinging) < 0]


def swings(height: np.ndarray, threshold: float) -> int:
    """Count the rises of a height [T] to the threshold after it was below half of it."""
    swinging, _ = _swinging(height, threshold)
    return int((np.diff(swinging) > 0).sum())


def clearances(window: Recording) -> np.ndarray:
    """Return the greatest height [R, N] in m of each foot's lowest point in each stride."""
    starts = stride_starts(window)
    peaks = [window.foot_height[a:b].max(0) for a, b in itertools.pairwise(starts)]
    return np.array(peaks) if peaks else np.full((1, window.foot_height.shape[1]), np.nan)


def stride_frequency(window: Recording, clearance: float) -> float:
    """Return the frequency in Hz of strides, or of the median foot's swings if that is higher.

    clearance: height of a swing in hip heights; the foot must come down to half of it in between.
    """
    starts = stride_starts(window)
    if len(starts) < 2:
        return np.nan
    strides = 1 / (float(np.diff(starts).mean()) * window.time_step)
    threshold = clearance * window.dimensions.hip_height
    counts = [swings(height, threshold) for height in window.foot_height.T]
    return max(strides, float(np.median(counts)) / (len(window.foot_height) * window.time_step))


def _swinging(height: np.ndarray, threshold: float) -> tuple[np.ndarray, np.ndarray]:
    """Return swing (1) or stance (0), and the frames at which that is certain."""
    state = np.where(height >= threshold, 1, np.where(height < threshold / 2, 0, -1))
    frames = np.flatnonzero(state >= 0)
    return state[frames], frames


def _unevenness(frames: np.ndarray) -> float:
    """Return the standard deviation of the times between footfalls over their mean."""
    between = np.diff(frames)
    return float(between.std() / between.mean())


def spells(holds: np.ndarray) -> list[tuple[int, int]]:
    """Return the first frame of each spell in which something [T] holds, and the one after it."""
    edges = np.diff(np.concatenate([[0], holds.astype(int), [0]]))
    begins, ends = np.flatnonzero(edges > 0).tolist(), np.flatnonzero(edges < 0).tolist()
    return list(zip(begins, ends, strict=True))
