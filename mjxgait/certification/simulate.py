"""Simulations of one champion in C MuJoCo with the reference controller in NumPy.

Letters: `S` simulations, `R` recorded ones (the first of the `S`), `T` control steps.
"""

import concurrent.futures
from functools import partial

import numpy as np

from mjxgait.certification.config import CertificateConfig
from mjxgait.certification.tasks import how_simulated
from mjxgait.champion import Champion
from mjxgait.cores import cores
from mjxgait.creature import Creature
from mjxgait.reference.controllers import Twin
from mjxgait.reference.outcome import Fall, Outcome, Trajectory
from mjxgait.reference.starts import Starts
from mjxgait.reference.stepping import Stepping
from mjxgait.reference.watch import Watch


def simulate(
    creature: Creature,
    champion: Champion,
    starts: Starts,
    seconds: float,
    *,
    record: int = 0,
    heading: np.ndarray | None = None,
    fall: Fall | None = None,
    threads: int = 0,
    watch: Watch | None = None,
    twin: Twin | None = None,
) -> Outcome:
    """Simulate the champion from every start; a start without a goal gets the task's nominal one.

    Args:
      record: R, number of simulations to record, from the first on. These run to the end even
        after a fall; the others stop there.
      fall: conditions of a fall; the task's by default.
      heading: [T] or [S, T] rad, commanded heading at each control step; None takes the task's,
        mostly straight ahead.
      threads: 0 takes the machine's cores. The result does not depend on it.
      watch: receives the simulations that can no longer succeed, and ends all once that decides
        the result. The distances until then do depend on threads.
      twin: replaces the champion's own reference controller. One that treats simulations
        differently needs a single thread.
    """
    threads = threads or cores()
    # Interleaved, so that each thread gets its share of every kind of start.
    shares = [np.arange(i, len(starts), threads) for i in range(min(threads, len(starts)))]
    steps = round(seconds / creature.model.opt.timestep)
    task = how_simulated(champion.task, champion.wish)
    fall = fall or task.fall(CertificateConfig())
    starts = task.aimed(starts, CertificateConfig())
    if heading is None:
        heading = task.told(steps, creature.model.opt.timestep)
    told = None if heading is None else np.broadcast_to(heading, (len(starts), steps))

    def run(share: np.ndarray) -> Outcome:
        mine, kept = starts.rows(share), int((share < record).sum())
        stepping = Stepping(creature, champion, mine, kept, fall, task, twin)
        tell = None if watch is None else partial(watch.tell, share)
        return stepping.to_the_end(steps, None if told is None else told[share], tell)

    with concurrent.futures.ThreadPoolExecutor(len(shares)) as pool:
        parts = list(pool.map(run, shares))
    order = np.argsort(np.concatenate(shares))
    kept = np.argsort(np.concatenate([share[share < record] for share in shares]))
    fields = ("qpos", "qvel", "torque", "target", "phase")
    return Outcome(
        fell=np.concatenate([p.fell for p in parts])[order],
        travel=np.concatenate([p.travel for p in parts])[order],
        path=np.concatenate([p.path for p in parts])[order],
        aside=np.concatenate([p.aside for p in parts])[order],
        clearance=np.concatenate([p.clearance for p in parts])[order],
        astray=np.concatenate([p.astray for p in parts])[order],
        middle=np.concatenate([p.middle for p in parts])[order],
        low=np.concatenate([p.low for p in parts])[order],
        trajectory=Trajectory(
            creature.model.opt.timestep,
            *(np.concatenate([getattr(p.trajectory, f) for p in parts])[kept] for f in fields),
        ),
    )
