"""Episode statistics of a recording, computed a second time in NumPy."""

import mujoco
import numpy as np

from mjxgait.creature import Creature
from mjxgait.creature.settings import Termination
from mjxgait.reference.outcome import Fall, Trajectory
from mjxgait.tasks.falls import Reason
from mjxgait.tasks.walk.stats import CONTACT_GAP, SWING


class Frames:
    """A row of a recording, replayed in MuJoCo; frames are states before their torque acts.

    trunk_pos: [T, 3] m. trunk_rot: [T, 3, 3]. spin: [T, 3] rad/s, world.
    low, place: [T, G], [T, G, 2] m, of the watched spheres and boxes.
    """

    def __init__(self, creature: Creature, film: Trajectory, row: int) -> None:
        self.creature = creature
        model, data = creature.model, mujoco.MjData(creature.model)
        self.qpos, self.qvel, self.torque = film.qpos[row], film.qvel[row], film.torque[row]
        velocity = np.zeros(6)
        pos, rot, spin, low, place = [], [], [], [], []
        for qpos, qvel in zip(self.qpos, self.qvel, strict=True):
            data.qpos[:], data.qvel[:] = qpos, qvel
            mujoco.mj_kinematics(model, data)
            mujoco.mj_comPos(model, data)
            mujoco.mj_comVel(model, data)
            kind = mujoco.mjtObj.mjOBJ_XBODY
            mujoco.mj_objectVelocity(model, data, kind, creature.trunk, velocity, 0)
            pos.append(data.xpos[creature.trunk].copy())
            rot.append(data.xmat[creature.trunk].reshape(3, 3).copy())
            spin.append(velocity[:3].copy())
            low.append([lowest(model, data, g) for g in creature.feet.watched])
            place.append(data.geom_xpos[creature.feet.watched, :2].copy())
        self.trunk_pos, self.trunk_rot, self.spin = np.array(pos), np.array(rot), np.array(spin)
        self.low, self.place = np.array(low), np.array(place)
        self.joints, self.speeds = (
            self.qpos[:, creature.joints.qpos_adr],
            self.qvel[:, creature.joints.dof_adr],
        )
        self.up = self.trunk_rot[:, 2] @ creature.frame.up
        self.touch = self.low[:, 4:].min(1) < 0


def lowest(model: mujoco.MjModel, data: mujoco.MjData, geom: int) -> float:
    """Least height in m of a sphere, or of a box by its corners."""
    if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_SPHERE:
        return float(data.geom_xpos[geom, 2] - model.geom_size[geom, 0])
    assert model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_BOX
    corners = model.geom_size[geom] * (2 * np.indices((2, 2, 2)).reshape(3, 8).T - 1)
    return float(
        (data.geom_xpos[geom] + corners @ data.geom_xmat[geom].reshape(3, 3).T)[:, 2].min()
    )


def end(frames: Frames, fall: Termination | Fall | None = None) -> tuple[int, Reason]:
    """First frame that ends an episode, and the reason; the number of frames if none does."""
    limits = fall or frames.creature.settings.termination
    height = frames.trunk_pos[:, 2] / frames.creature.frame.stand_height
    # If several hold, the last one counts.
    found = np.full(len(height), Reason.FINISHED)
    if limits.touch:
        found[frames.touch] = Reason.TOUCHED
    found[height > limits.height[1]] = Reason.TOO_HIGH
    found[height < limits.height[0]] = Reason.TOO_LOW
    found[frames.up < limits.min_up] = Reason.TIPPED
    ends = np.flatnonzero(found != Reason.FINISHED)
    return (int(ends[0]), Reason(found[ends[0]])) if len(ends) else (len(height), Reason.FINISHED)


def stats_of(frames: Frames, steps: int, half: int, clearance: float) -> dict[str, np.ndarray]:
    """Statistics of the first `steps` frames by name, without `reason`; needs one frame more.

    half: frame of the distance at half time. clearance: m, target of each foot in each swing.
    """
    creature, torque = frames.creature, frames.torque[:steps]
    joints, speeds = frames.joints[:steps], frames.speeds[:steps]
    low, place = frames.low[:steps, :4], frames.place[:steps, :4]
    forward, left = frames.trunk_pos[:steps, :2].T - creature.frame.stand_pos[:2, None]
    nose = frames.trunk_rot[steps - 1] @ creature.frame.forward
    down = low < CONTACT_GAP
    hurried = np.linalg.norm(np.diff(place, axis=0), axis=2)
    slid = hurried * (down[1:] & down[:-1])
    outside = (joints < creature.joints.pose_low) | (joints > creature.joints.pose_high)
    return {
        "steps": steps,
        "forward": forward[-1],
        "left": left[-1],
        "forward_half": forward[min(half, steps) - 1],
        "heading": np.arctan2(nose[1], nose[0]),
        "loaded": (low < 0)[-1],
        "touchdowns": (np.diff((low < 0).astype(int), axis=0, prepend=0) > 0).sum(0),
        "contact": down.sum(0),
        "slip": slid.sum(0),
        "airborne": (~down.any(1)).sum(),
        "foot_height": low.mean(1).sum(),
        "foot_speed": hurried.max() / creature.model.opt.timestep,
        "foot_pos": place[-1],
        "foot_down": down[-1],
        "tilt": (1 - frames.up[:steps]).sum(),
        "wobble": (frames.spin[:steps] ** 2).sum(),
        "touch": frames.touch[:steps].sum(),
        "work": np.maximum(torque * speeds, 0).sum() * creature.model.opt.timestep,
        "saturation": (np.abs(torque) >= creature.gains.torque_limit).mean(1).sum(),
        "limits": outside.mean(1).sum(),
        **_swings(low, SWING * creature.frame.hip_height, clearance),
    }


def _swings(low: np.ndarray, rise: float, clearance: float) -> dict[str, np.ndarray]:
    """Swings of each foot, from above `rise` to below half of it."""
    count, shortfall, peak = np.zeros(4), np.zeros(4), np.zeros(4)
    swinging = np.zeros(4, bool)
    for foot, heights in enumerate(low.T):
        begin = 0
        for frame, height in enumerate(heights):
            if height > rise:
                swinging[foot] = True
            elif height < rise / 2 and swinging[foot]:
                swinging[foot] = False
                count[foot] += 1
                highest = heights[begin : frame + 1].max()
                shortfall[foot] += np.clip(1 - highest / clearance, 0, 1)
                begin = frame
        # The feet begin on the floor, at zero.
        peak[foot] = heights[begin:].max(initial=-np.inf if begin else 0)
    return {"swings": count, "swinging": swinging, "shortfall": shortfall, "peak": peak}
