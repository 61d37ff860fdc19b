"""DART through dartpy, with stable PD as in its tutorial.

The body is rebuilt from the MuJoCo model: same masses, joints and feet; only the feet have
contacts. DART has no armature, and solves its contacts as a linear complementarity problem to the
end. It steps one world at a time; the controller is vectorised over `LANES` worlds, as far as
dartpy's accessors allow.
"""

import dartpy  # type: ignore[import-not-found,unused-ignore]
import mujoco
import numpy as np

from mjxgait.creature import Creature
from peers.mujoco_peer import Law
from peers.workload import Workload

FREE_DOFS = 6
LANES = 32
TOUCH_EVERY = 4
"""Steps between two checks for contact of forbidden parts: each costs a call per part."""


class Unsupported(ValueError):
    """A creature that this peer cannot rebuild."""


def check_supported(creature: Creature) -> None:
    """Check that DART can simulate this creature.

    Raises:
      Unsupported: it cannot; the message says why.
    """
    _Lane(creature)


class DartPeer:
    """One core's share of a workload: the episodes `first`, `first + stride`, ..."""

    def __init__(self, workload: Workload, first: int, stride: int) -> None:
        self.work, self.creature = workload, workload.creature()
        self.jobs = np.arange(first, workload.episodes, stride)
        self.law = Law(self.creature, workload)
        self.lanes = [_Lane(self.creature) for _ in range(min(LANES, len(self.jobs)))]
        # DART's degrees of freedom: the root's six, then the joints in the order of the model's
        # bodies.
        self.kd = np.concatenate([np.zeros(FREE_DOFS), self.law.kd])
        self.damping = np.diag(self.kd * self.law.step)
        self.limit = np.concatenate([np.zeros(FREE_DOFS), self.creature.gains.torque_limit])

    def lap(self) -> tuple[int, float]:
        """Return the useful steps, and the sum over episodes of the distance forward in m."""
        waiting, total, forward = list(self.jobs[::-1]), 0, 0.0
        for lane in self.lanes:
            lane.begin(int(waiting.pop()), self.work)
        running = self.lanes
        while running:
            transforms = [lane.trunk.getWorldTransform() for lane in running]
            pos, rot = (
                np.array([t.translation() for t in transforms]),
                np.array([t.rotation() for t in transforms]),
            )
            ended = self._down(running, pos, rot) | np.array(
                [lane.step >= self.work.steps for lane in running]
            )
            if not ended.any():
                self._step(running, pos, rot)
                continue
            for lane in (running[i] for i in ended.nonzero()[0]):
                total, forward, lane.job = total + lane.step, forward + lane.moved, -1
                if waiting:
                    lane.begin(int(waiting.pop()), self.work)
            running = [lane for lane in running if lane.job >= 0]
        return total, forward

    def _step(self, running: list["_Lane"], pos: np.ndarray, rot: np.ndarray) -> None:
        starts = len(self.work.qpos)
        genome, position = (
            np.array([lane.job // starts for lane in running]),
            np.array([lane.position for lane in running]),
        )
        for lane, turned in zip(running, rot, strict=True):
            if lane.step == self.work.push_step[lane.job % starts]:
                lane.push(turned.T @ self.work.push[lane.job % starts][:3])
        q = np.array([lane.skeleton.getPositions() for lane in running])
        v = np.array([lane.skeleton.getVelocities() for lane in running])
        # `Law` reads the root's angular velocity in MuJoCo's order. Both simulators have it in the
        # body's frame.
        target = self.law.target(
            genome, position, pos, rot, np.concatenate([v[:, 3:6], v[:, :3], v[:, FREE_DOFS:]], 1)
        )
        forces = self._stable_pd(running, q, v, target)
        moved = (pos - self.law.start) @ self.law.forward
        steps = np.array([lane.step + 1 for lane in running])
        position = self.law.advance(genome, position, target, q[:, FREE_DOFS:], steps)
        for i, lane in enumerate(running):
            lane.skeleton.setForces(forces[i])
            lane.world.step()
            lane.position, lane.moved, lane.step = int(position[i]), float(moved[i]), lane.step + 1

    def _stable_pd(
        self, running: list["_Lane"], q: np.ndarray, v: np.ndarray, target: np.ndarray
    ) -> np.ndarray:
        """Compute the tutorial's formula, clamped like ours.

        It includes the constraint forces of the previous step.
        """
        p, d = np.zeros_like(q), -self.kd * v
        p[:, FREE_DOFS:] = -self.law.kp * (
            q[:, FREE_DOFS:] + v[:, FREE_DOFS:] * self.law.step - target
        )
        mass = np.array([lane.skeleton.getMassMatrix() for lane in running])
        bias = np.array([lane.skeleton.getCoriolisAndGravityForces() for lane in running])
        pushed = np.array([lane.skeleton.getConstraintForces() for lane in running])
        acceleration = np.linalg.solve(mass + self.damping, (p + d - bias + pushed)[..., None])[
            ..., 0
        ]
        return np.clip(p + d - self.kd * acceleration * self.law.step, -self.limit, self.limit)

    def _down(self, running: list["_Lane"], pos: np.ndarray, rot: np.ndarray) -> np.ndarray:
        limits = self.creature.settings.termination
        height = pos[:, 2] / self.creature.frame.stand_height
        fine = (
            (rot[:, 2] @ self.creature.frame.up >= limits.min_up)
            & (height >= limits.height[0])
            & (height <= limits.height[1])
        )
        if limits.touch:
            fine &= [lane.step % TOUCH_EVERY != 0 or not lane.touches() for lane in running]
        return ~fine


class _Lane:
    """A separate world with one creature, and the progress of its episode."""

    def __init__(self, creature: Creature) -> None:
        self.model = creature.evolution_model
        self.skeleton, self.bodies = _skeleton(creature, self.model)
        self.trunk, self.floor = self.bodies[creature.trunk], _floor()
        self.balls = _forbidden_spheres(creature, self.model)
        self.world = dartpy.simulation.World()
        self.world.setGravity(self.model.opt.gravity)
        self.world.setTimeStep(float(self.model.opt.timestep))
        self.world.setCollisionDetector(dartpy.simulation.CollisionDetectorType.DART)
        self.world.addSkeleton(self.skeleton)
        self.world.addSkeleton(self.floor)
        self.job, self.step, self.position, self.moved = -1, 0, 0, 0.0

    def begin(self, job: int, work: Workload) -> None:
        """Put the creature at the start of an episode."""
        start = job % len(work.qpos)
        qpos, qvel = work.qpos[start], work.qvel[start]
        root = dartpy.math.Isometry3()
        root.set_translation(qpos[:3])
        root.set_rotation(_rotation(qpos[3:7]))
        self.world.reset()
        self.skeleton.resetGeneralizedForces()
        self.skeleton.clearConstraintImpulses()
        self.skeleton.setPositions(
            np.concatenate([dartpy.dynamics.FreeJoint.convertToPositions(root), qpos[7:]])
        )
        self.skeleton.setVelocities(
            np.concatenate([qvel[3:6], root.rotation().T @ qvel[:3], qvel[6:]])
        )
        friction = float(self.model.geom("floor").friction[0] * work.friction[start])
        self.floor.getBodyNode(0).getShapeNode(0).getDynamicsAspect().setFrictionCoeff(friction)
        self.job, self.step, self.position, self.moved = job, 0, 0, 0.0

    def push(self, velocity: np.ndarray) -> None:
        """Add to the root's velocity, in the body's frame."""
        now = self.skeleton.getVelocities()
        now[3:6] += velocity
        self.skeleton.setVelocities(now)

    def touches(self) -> bool:
        """Return whether a forbidden part touches the floor."""
        for body, centres, radius in self.balls:
            transform = self.bodies[body].getWorldTransform()
            if transform.translation()[2] + min(centres @ transform.rotation()[2]) < radius:
                return True
        return False


def _skeleton(
    creature: Creature, model: mujoco.MjModel
) -> "tuple[dartpy.dynamics.Skeleton, dict[int, dartpy.dynamics.BodyNode]]":
    """Build the body; also return its DART nodes by MuJoCo's body ids."""
    skeleton = dartpy.dynamics.Skeleton("creature")
    nodes: dict[int, dartpy.dynamics.BodyNode] = {}
    for body in range(1, model.nbody):
        node = _node(skeleton, model, body, nodes.get(int(model.body_parentid[body])))
        frame = _rotation(model.body_iquat[body])
        inertia = frame @ np.diag(model.body_inertia[body]) @ frame.T
        node.setInertia(
            dartpy.dynamics.Inertia(float(model.body_mass[body]), model.body_ipos[body], inertia)
        )
        nodes[body] = node
    for geom in creature.feet.stepping:
        _sphere(nodes[int(model.geom_bodyid[geom])], model, int(geom))
    return skeleton, nodes


def _node(
    skeleton: "dartpy.dynamics.Skeleton",
    model: mujoco.MjModel,
    body: int,
    parent: "dartpy.dynamics.BodyNode | None",
) -> "dartpy.dynamics.BodyNode":
    """Add a body and its joint: free, one hinge, or two crossing hinges as a universal joint."""
    dynamics = dartpy.dynamics
    joints = range(model.body_jntadr[body], model.body_jntadr[body] + model.body_jntnum[body])
    if [model.jnt_type[j] for j in joints] == [mujoco.mjtJoint.mjJNT_FREE]:
        return skeleton.createFreeJointAndBodyNodePair()[1]
    if len(joints) not in (1, 2) or any(
        model.jnt_type[j] != mujoco.mjtJoint.mjJNT_HINGE or np.any(model.jnt_pos[j]) for j in joints
    ):
        raise Unsupported(
            "the DART peer knows one hinge or two crossing ones per body, at the body's origin"
        )
    properties = (
        dynamics.RevoluteJointProperties()
        if len(joints) == 1
        else dynamics.UniversalJointProperties()
    )
    if len(joints) == 1:
        properties.mAxis = model.jnt_axis[joints[0]]
    else:
        properties.mAxis = [model.jnt_axis[j] for j in joints]
    place = dartpy.math.Isometry3()
    place.set_translation(model.body_pos[body])
    place.set_rotation(_rotation(model.body_quat[body]))
    properties.mT_ParentBodyToJoint = place
    create = (
        skeleton.createRevoluteJointAndBodyNodePair
        if len(joints) == 1
        else skeleton.createUniversalJointAndBodyNodePair
    )
    return create(parent, properties)[1]


def _sphere(node: "dartpy.dynamics.BodyNode", model: mujoco.MjModel, geom: int) -> None:
    if model.geom_type[geom] != mujoco.mjtGeom.mjGEOM_SPHERE:
        raise Unsupported("the DART peer knows spheres as feet only")
    shape = node.createShapeNode(dartpy.dynamics.SphereShape(float(model.geom_size[geom, 0])))
    shape.setRelativeTranslation(model.geom_pos[geom])
    shape.createCollisionAspect()
    # DART takes the lower of two frictions: this makes it the floor's.
    shape.createDynamicsAspect().setFrictionCoeff(10.0)


def _floor() -> "dartpy.dynamics.Skeleton":
    """Return a box whose top is the floor."""
    floor = dartpy.dynamics.Skeleton("floor")
    _, node = floor.createWeldJointAndBodyNodePair()
    shape = node.createShapeNode(dartpy.dynamics.BoxShape([200.0, 200.0, 1.0]))
    shape.setRelativeTranslation([0.0, 0.0, -0.5])
    shape.createCollisionAspect()
    shape.createDynamicsAspect()
    return floor


def _forbidden_spheres(
    creature: Creature, model: mujoco.MjModel
) -> list[tuple[int, np.ndarray, float]]:
    """Return body, centres and radius of spheres that reach as low as the forbidden parts.

    A capsule becomes its two end spheres.
    """
    balls = []
    for geom in creature.feet.watched[len(creature.feet.foot_of) :]:
        body, centre, size = (
            int(model.geom_bodyid[geom]),
            model.geom_pos[geom],
            model.geom_size[geom],
        )
        shape = mujoco.mjtGeom(model.geom_type[geom])
        if shape not in (mujoco.mjtGeom.mjGEOM_SPHERE, mujoco.mjtGeom.mjGEOM_CAPSULE):
            raise Unsupported("the DART peer knows spheres and capsules only")
        along = _rotation(model.geom_quat[geom])[:, 2] * (
            size[1] if shape == mujoco.mjtGeom.mjGEOM_CAPSULE else 0.0
        )
        balls.append((body, np.array([centre + along, centre - along]), float(size[0])))
    return balls


def _rotation(quat: np.ndarray) -> np.ndarray:
    flat = np.zeros(9)
    mujoco.mju_quat2Mat(flat, np.asarray(quat, float))
    return flat.reshape(3, 3)
