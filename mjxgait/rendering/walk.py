"""A champion's undisturbed walk, simulated once in C MuJoCo, the source of all pictures and clips.

Overlays (goals, a bar) collide with nothing and are in no simulation.
Letters: `T` frames (control steps), `J` joints, `G` geoms, `nq` as in MuJoCo.
"""

import dataclasses
from collections.abc import Mapping
from functools import cached_property
from pathlib import Path

import mujoco
import numpy as np

from mjxgait.certification import Lack, NoCertificate, certificate_state
from mjxgait.certification.acceptance import task_rules
from mjxgait.certification.config import CertificateConfig
from mjxgait.certification.trials import simulate
from mjxgait.champion import Champion
from mjxgait.controllers.sims_brain.reference_body import THEIRS, grow, opponent_genome
from mjxgait.creature import Creature
from mjxgait.reference.bar import RADIUS
from mjxgait.reference.layout import Ground, StartFrame, start_frame
from mjxgait.reference.measure import Recording, measure, stride_starts
from mjxgait.reference.outcome import Trajectory
from mjxgait.reference.starts import Starts, nominal_starts
from mjxgait.reference.terrain import terrain_of
from mjxgait.rendering.dress import CUBE_COLOUR, dress, face_of_eyes
from mjxgait.training.folder import CERTIFICATE, command

GEOM = mujoco.mjtGeom
GOAL_COLOUR, BAR_COLOUR, POST_COLOUR = (
    [0.10, 0.55, 0.50, 1.0],
    [0.95, 0.70, 0.15, 1.0],
    [0.55, 0.57, 0.60, 1.0],
)
DISC = 0.25, 0.004
"""Radius in body lengths and half the height in m of a goal."""
BODY = "marks"


def marked(
    spec: mujoco.MjSpec,
    creature: Creature,
    goals: np.ndarray,
    floor: np.ndarray,
    bar: np.ndarray | None,
) -> mujoco.MjSpec:
    """Return the creature's specification with the goals and the bar added as its last body.

    Args:
      goals: [goals] m ahead of the start. floor: [goals] m, height of the floor there. bar: [2] m
        ahead of the start and above the floor, of its lower edge.
    """
    start, body = start_frame(creature), spec.worldbody.add_body(name=BODY)
    radius = DISC[0] * creature.frame.body_length
    for ahead, level in zip(goals, floor, strict=True):
        place = [*_ahead(start, ahead)[:2], level + DISC[1]]
        _add(body, GEOM.mjGEOM_CYLINDER, GOAL_COLOUR, pos=place, size=[radius, DISC[1], 0])
    if bar is not None:
        _add_bar(body, start, float(bar[0]), float(bar[1]), 1.2 * creature.frame.body_length)
    return spec


def _add_bar(
    body: mujoco.MjsBody, start: StartFrame, ahead: float, height: float, half: float
) -> None:
    """Add a bar on posts that rise above it. half: m, half its width."""
    middle, up = _ahead(start, ahead), np.array([0.0, 0.0, height + RADIUS])
    ends = [middle + side * half * start.left for side in (1, -1)]
    across = np.concatenate([end + up for end in ends])
    _add(body, GEOM.mjGEOM_CAPSULE, BAR_COLOUR, fromto=across, size=[RADIUS, 0, 0])
    for end in ends:
        post = np.concatenate([end, end + 1.15 * up])
        _add(body, GEOM.mjGEOM_CAPSULE, POST_COLOUR, fromto=post, size=[0.7 * RADIUS, 0, 0])


def _ahead(start: StartFrame, distance: float) -> np.ndarray:
    """Place [3] m on the floor, ahead of the start."""
    place: np.ndarray = start.place * [1, 1, 0] + distance * start.forward
    return place


def _add(body: mujoco.MjsBody, kind: mujoco.mjtGeom, colour: list[float], **given: object) -> None:
    body.add_geom(type=kind, rgba=colour, contype=0, conaffinity=0, group=1, **given)


WARMUP = 2.0
"""Time for a gait to settle, s; strides are taken from later if there are enough."""
LEAST_WAY = 0.1
"""m; a shorter way has no direction."""
AFTERMATH = 0.7
"""Time shown after a fall, s."""


@dataclasses.dataclass(frozen=True, eq=False)
class Walk:
    """One walk, which ends at the requested time or soon after a fall.

    fell: s, infinite if it stayed up. start: initial conditions, with any goal and bar of the task.
    """

    creature: Creature
    champion: Champion
    trajectory: Trajectory
    fell: float
    start: Starts | None = None

    @property
    def time_step(self) -> float:
        """Time between frames, s."""
        return self.trajectory.time_step

    @property
    def qpos(self) -> np.ndarray:
        """Poses [T, nq]: m, quaternions, rad."""
        return self.trajectory.qpos[0]

    @property
    def seconds(self) -> float:
        """Duration of the walk."""
        return len(self.qpos) * self.time_step

    @cached_property
    def recording(self) -> Recording:
        """Measurements of every frame."""
        return measure(self.creature, self.trajectory)

    @cached_property
    def shown(self) -> mujoco.MjModel:
        """The creature's model as pictures show it; goals and bar follow its own bodies."""
        return self.creature.model if self.source is None else self.source.compile()

    @cached_property
    def dressed(self) -> mujoco.MjModel:
        """The creature's model as files show it: colours and eyes, but neither goals nor bar."""
        spec = self._dressed() if self.grown else None
        return self.creature.model if spec is None else spec.compile()

    @cached_property
    def source(self) -> mujoco.MjSpec | None:
        """Source of `shown`; None if that is the creature's own model."""
        if self.marked is not None:
            return self.marked
        return self._dressed() if self.grown else None

    @cached_property
    def marked(self) -> mujoco.MjSpec | None:
        """The creature with goals and bar; None without them."""
        if self.start is None:
            return None
        goals, bar = self._goals(self.start.goal[:1]), self.start.bar[0]
        over = bar if np.isfinite(bar).all() else None
        if not len(goals) and over is None:
            return None
        places = self.creature.frame.stand_pos[:2] + np.outer(goals, self.forward)
        return marked(self._dressed(), self.creature, goals, self.ground_heights(places), over)

    def _dressed(self) -> mujoco.MjSpec:
        """The creature's specification; blocks that grew have colours and eyes."""
        spec = mujoco.MjSpec.from_string(self.creature.files["creature.xml"])
        if not self.grown:
            return spec
        self._dress(spec, self.champion.genome, "")
        if theirs := opponent_genome(self.champion.genome):
            self._dress(spec, theirs, THEIRS)
            spec.geom(self.creature.settings.creature.beside[1]).rgba = CUBE_COLOUR
        return spec

    def _dress(self, spec: mujoco.MjSpec, genome: Mapping[str, np.ndarray], prefix: str) -> None:
        """Give colours and eyes to the body that grew from a genome."""
        settings, (places, rots) = self.champion.settings, self.body_poses()
        root = self.creature.model.body(f"{prefix}part0").id
        parts = grow(genome, settings.parts, settings.links)
        way = places[-1, root] - places[0, root]
        way = way if self.afloat else way * [1, 1, 0]
        length = float(np.linalg.norm(way))
        ahead = way / length if length > LEAST_WAY else np.zeros(3)
        dress(spec, parts, face_of_eyes(parts, rots[:, root], ahead), prefix)

    def _goals(self, first: np.ndarray) -> np.ndarray:
        """All goals [goals] of the walk, m ahead of the start."""
        goals, next_goal = list(first[first > 0]), task_rules(self.champion.task).next_goal
        farthest = ((self.trunk_pos[:, :2] - self.trunk_pos[0, :2]) @ self.forward).max()
        while len(goals) and (after := next_goal(goals[-1], goals[0], farthest)) > goals[-1]:
            goals.append(after)
        return np.array(goals)

    @cached_property
    def forward(self) -> np.ndarray:
        """Horizontal unit vector [2] in the world, the creature's initial direction.

        A body that grew has no front: the direction of its whole way counts.
        """
        if self.grown:
            way = (self.trunk_pos[-1] - self.trunk_pos[0])[:2]
            if np.linalg.norm(way) > LEAST_WAY:
                return way / np.linalg.norm(way)
        axis = (self.creature.frame.stand_rot @ self.creature.frame.forward)[:2]
        return axis / np.linalg.norm(axis)

    @property
    def grown(self) -> bool:
        """True if the body grew from a graph of blocks."""
        return "graph.half" in self.champion.genome

    @cached_property
    def trunk_pos(self) -> np.ndarray:
        """Trunk positions [T, 3] m in the world."""
        return self.body_poses()[0][:, self.creature.trunk]

    @property
    def afloat(self) -> bool:
        """True if the creature is in water, where its height is free."""
        return task_rules(self.champion.task, self.champion.wish).drag > 0

    @cached_property
    def ground(self) -> Ground | None:
        """Ground of the walk; None for the plane z = 0."""
        return terrain_of(self.creature)

    def ground_heights(self, places: np.ndarray) -> np.ndarray:
        """Return the ground's heights [T] m at places [T, 2] m in the world."""
        return self.ground.height(*places.T) if self.ground else np.zeros(len(places))

    def stride_frames(self) -> np.ndarray:
        """Return the frames at which a stride begins, before any fall.

        Strides are cycles of the controller, which loop without a seam; without a cycle, footfalls.
        """
        phase = self.trajectory.phase[0]
        cyclic = np.isfinite(phase).all()
        starts = np.flatnonzero(np.diff(phase) < 0) + 1 if cyclic else stride_starts(self.recording)
        return starts[starts * self.time_step < self.fell]

    def steady_strides(self, count: int) -> tuple[int, int] | None:
        """Return first and last frame of `count` successive strides with a duration nearest to the
        median; None if there are too few.
        """
        starts = self.stride_frames()
        settled = starts[starts * self.time_step >= WARMUP]
        starts = settled if len(settled) > count else starts
        if len(starts) <= count:
            return None
        lengths = starts[count:] - starts[:-count]
        chosen = int(np.argmin(np.abs(lengths - np.median(lengths))))
        return int(starts[chosen]), int(starts[chosen + count])

    def body_poses(self) -> tuple[np.ndarray, np.ndarray]:
        """Return world positions [T, nbody, 3] m and rotations [T, nbody, 3, 3] of the bodies."""
        return poses_of(self.creature.model, self.qpos, ("xpos", "xmat"))

    def geom_poses(self, frames: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return world positions [T, G, 3] m and rotations [T, G, 3, 3] of all geoms in `shown`."""
        return poses_of(self.shown, self.qpos[frames], ("geom_xpos", "geom_xmat"))


def record_walk(creature: Creature, champion: Champion, seconds: float) -> Walk:
    """Simulate the champion on the creature's ground, without noise or pushes."""
    task = task_rules(champion.task, champion.wish)
    start = task.aimed(nominal_starts(creature, 1), CertificateConfig())
    outcome = simulate(creature, champion, start, seconds, record=1, threads=1)
    film, fell = outcome.trajectory, float(outcome.fell[0])
    finite = np.isfinite(film.qpos[0]).all(1) & np.isfinite(film.qvel[0]).all(1)
    last = len(finite) if finite.all() else int(np.argmin(finite))
    last = min(last, round((fell + AFTERMATH) / film.time_step)) if np.isfinite(fell) else last
    # A walk that diverges at once is shown standing.
    frames = np.minimum(np.arange(max(last, 2)), max(last, 1) - 1)
    return Walk(creature, champion, film.taken(frames), fell, start)


def poses_of(
    model: mujoco.MjModel, qpos: np.ndarray, names: tuple[str, str]
) -> tuple[np.ndarray, np.ndarray]:
    """Return positions [T, n, 3] m and rotations [T, n, 3, 3] in poses [T, nq].

    names: of the two arrays in MuJoCo's data, such as xpos and xmat.
    """
    data = mujoco.MjData(model)
    where, how = ([] for _ in names)
    for row in qpos:
        data.qpos[:] = row
        mujoco.mj_kinematics(model, data)
        where.append(getattr(data, names[0]).copy())
        how.append(getattr(data, names[1]).reshape(-1, 3, 3).copy())
    return np.array(where), np.array(how)


def doubt(run: Path, walk: Walk) -> str:
    """Return one line that gives the reasons why a run's champion is not certified; empty if it is.

    walk: of this champion, freshly simulated.
    """
    reasons = [f"it falls after {walk.fell:.1f} s"] if np.isfinite(walk.fell) else []
    state = certificate_state(run / CERTIFICATE, walk.champion, walk.creature)
    if isinstance(state, NoCertificate):
        way_out = f", which {command('certify', run, run=run)} does"
        reasons.append(state.reason + (way_out if state.lack is Lack.MISSING else ""))
    elif state.verdict.certified:
        return ""
    elif failed := state.verdict.failed:
        names = ", ".join(f"{c.number} {c.name}".strip() for c in failed)
        reasons.append(f"it fails {'criterion' if len(failed) == 1 else 'criteria'} {names}")
    else:
        reasons.append(state.verdict.reservation or "its certificate has no criteria")
    return f"Not certified: {'; '.join(reasons)}"
