"""Hand-written C around MuJoCo's functions: `c_peer.c`, compiled at the start of the contest.

The shared object of the installed mujoco package does the physics, in double precision as shipped.
"""

import ctypes
import multiprocessing
import shutil
import subprocess
import time
from collections.abc import Callable
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Protocol

import mujoco
import numpy as np

from mjxgait.creature import Creature
from mjxgait.processes import cores, single_threaded
from mjxgait.reference.layout import LowestPoint
from peers.mujoco_peer import Law, check_controller, quiet
from peers.workload import Lap, Workload, bare_model

SOURCE = Path(__file__).with_suffix(".c")
COMPILERS = ("cc", "gcc", "clang")
FLAGS = ("-O3", "-march=native", "-shared", "-fPIC")
TUNING = ("threshold", "period", "steer", "pitch", "pitch_rate", "roll", "roll_rate")
"""In the order of docs/reference/controller.md; here so that a peer's process imports no JAX."""


class NoCompiler(Exception):
    """The C peer cannot be built; the message says why."""


def build(folder: Path) -> Path:
    """Compile the shared object into `folder` and return its path.

    Raises:
      NoCompiler: there is no C compiler, or it fails.
    """
    package = Path(mujoco.__file__).parent
    compiler = next((found for name in COMPILERS if (found := shutil.which(name))), None)
    if compiler is None:
        raise NoCompiler(f"no C compiler ({', '.join(COMPILERS)}) was found")
    libraries = sorted([*package.glob("libmujoco*.so*"), *package.glob("libmujoco*.dylib")])
    if not libraries:
        raise NoCompiler("the mujoco package has no shared object to link with")
    made = folder / "c_peer.so"
    command = [compiler, *FLAGS, f"-I{package / 'include'}", str(SOURCE), "-o", str(made)]
    command += [str(libraries[0]), f"-Wl,-rpath,{package}", "-lm"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise NoCompiler(f"{compiler} failed: {' '.join(done.stderr.split())[:300]}")
    return made


class CPeer:
    """One core's share of a workload: the episodes `first`, `first + stride`, ..."""

    def __init__(self, workload: Workload, first: int, stride: int, library: Path) -> None:
        check_controller(workload.config)
        creature = workload.creature()
        model, watched = bare_model(creature)
        self.model = quiet(model)
        self.data = mujoco.MjData(model)
        self.work, self.kept = _work(workload, creature, model, watched)
        self.share = (first, stride, workload.episodes)
        self.library = ctypes.CDLL(str(library))

    def lap(self) -> tuple[int, float]:
        """Return the useful steps, and the sum over episodes of the distance forward in m."""
        steps, forward = ctypes.c_longlong(), ctypes.c_double()
        self.library.lap(
            ctypes.byref(self.work),
            ctypes.c_void_p(self.model._address),
            ctypes.c_void_p(self.data._address),
            *self.share,
            ctypes.byref(steps),
            ctypes.byref(forward),
        )
        return steps.value, forward.value


def _work(
    workload: Workload, creature: Creature, model: mujoco.MjModel, watched: np.ndarray
) -> tuple[ctypes.Structure, list[np.ndarray]]:
    """Fill the `Work` of c_peer.c; return it and the arrays that it points to.

    The C struct has the same fields in the same order.
    """
    law, limits = Law(creature, workload), creature.settings.termination
    forbidden = watched[len(creature.feet.foot_of) :] if limits.touch else watched[:0]
    integers = {
        "joints": len(creature.joints.stand),
        "poses": law.poses,
        "interpolation": law.interpolation,
        "starts": len(workload.qpos),
        "steps": workload.steps,
        "by_clock": law.by_clock,
        "constraint_forces": workload.config.drive.constraint_forces,
        "forbidden": len(forbidden),
        "trunk": creature.trunk,
        "root_dof": law.root,
    }
    numbers = {
        "body_length": creature.frame.body_length,
        "stand_height": creature.frame.stand_height,
        "min_up": limits.min_up,
        "lowest": limits.height[0],
        "highest": limits.height[1],
    }
    addresses = {
        "qpos_adr": creature.joints.qpos_adr,
        "dof_adr": creature.joints.dof_adr,
        "geom": forbidden,
        "push_step": workload.push_step,
    }
    arrays = _body(creature, law, LowestPoint(model, forbidden)) | _episodes(workload, law, model)
    kept = [np.array(x, np.int32, order="C") for x in addresses.values()]
    kept += [np.array(x, np.float64, order="C") for x in arrays.values()]

    class Work(ctypes.Structure):
        _fields_ = [
            *((name, ctypes.c_int) for name in integers),
            *((name, ctypes.c_double) for name in numbers),
            *((name, ctypes.c_void_p) for name in (*addresses, *arrays)),
        ]

    pointers = [x.ctypes.data for x in kept]
    return Work(*integers.values(), *numbers.values(), *pointers), kept


def _body(creature: Creature, law: Law, forbidden: LowestPoint) -> dict[str, np.ndarray]:
    return {
        "kp": law.kp,
        "kd": law.kd,
        "limit": creature.gains.torque_limit,
        "low": creature.joints.low,
        "high": creature.joints.high,
        "stand": creature.joints.stand,
        "steer_bend": creature.corrections.steer_bend,
        "steer_stride": creature.corrections.steer_stride,
        "balance_pitch": creature.corrections.balance_pitch,
        "balance_roll": creature.corrections.balance_roll,
        "reach": np.column_stack([forbidden.radius, forbidden.box, forbidden.ellipsoid]),
        "axes": law.axes.T,
        "up": creature.frame.up,
        "start": law.start,
        "forward": law.forward,
        "left": law.left,
    }


def _episodes(workload: Workload, law: Law, model: mujoco.MjModel) -> dict[str, np.ndarray]:
    return {
        "cycle": law.cycle,
        "tuning": np.stack([workload.tuning[name] for name in TUNING], 1),
        "qpos": workload.qpos,
        "qvel": workload.qvel,
        "friction": workload.friction,
        "push": workload.push,
        "geom_friction": model.geom_friction[:, 0],
        "pair_friction": model.pair_friction[:, 0],
    }


class Peer(Protocol):
    """A contestant's share of the work."""

    def lap(self) -> tuple[int, float]:
        """Simulate all its episodes; return useful steps, and the sum of distances forward in m."""
        ...


class Workers:
    """Processes that wait between laps, so that they take no time from other contestants.

    startup: s until all were ready.
    """

    def __init__(
        self,
        peer: Callable[[Workload, int, int], Peer],
        workload: Workload,
        count: int | None = None,
    ) -> None:
        count = count or cores()
        self.episodes = workload.episodes
        began = time.perf_counter()
        context = multiprocessing.get_context("spawn")
        pairs = [context.Pipe() for _ in range(count)]
        self.processes = [
            context.Process(target=_serve, args=(theirs, peer, workload, i, count), daemon=True)
            for i, (_, theirs) in enumerate(pairs)
        ]
        with single_threaded():
            for process in self.processes:
                process.start()
        self.pipes = [ours for ours, _ in pairs]
        for _, theirs in pairs:
            theirs.close()
        for pipe in self.pipes:
            pipe.recv()
        self.startup = time.perf_counter() - began

    def lap(self) -> Lap:
        """Run the workload once."""
        began = time.perf_counter()
        for pipe in self.pipes:
            pipe.send("go")
        results = [pipe.recv() for pipe in self.pipes]
        seconds = time.perf_counter() - began
        steps, forward, processor = (sum(values) for values in zip(*results, strict=True))
        return Lap(seconds, steps, forward / self.episodes, processor)

    def close(self) -> None:
        """End the processes."""
        for pipe in self.pipes:
            pipe.close()
        for process in self.processes:
            process.join()


def _serve(
    pipe: Connection,
    peer: Callable[[Workload, int, int], Peer],
    workload: Workload,
    first: int,
    stride: int,
) -> None:
    contestant = peer(workload, first, stride)
    try:
        pipe.send("ready")
        while pipe.recv():
            began = time.process_time()
            pipe.send((*contestant.lap(), time.process_time() - began))
    except (EOFError, KeyboardInterrupt):
        pass
