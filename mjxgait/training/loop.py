"""Host loop around the jitted generation: it counts, logs, checkpoints and stops."""

import dataclasses
import functools
import importlib.metadata
import json
import platform
import signal
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path

import jax
import numpy as np

from mjxgait.champion import write_champion
from mjxgait.config.schema import Config
from mjxgait.creature import Creature
from mjxgait.errors import UserError
from mjxgait.evolution.state import EvolutionState, GenerationMetrics, stop_reason
from mjxgait.files import write_text
from mjxgait.lru import LruCache
from mjxgait.simulation.evaluator import Evaluator
from mjxgait.tasks.base import Task
from mjxgait.training.checkpoint import Checkpoints
from mjxgait.training.examination import Examined, Examiner, Exams, Validation, why_ended
from mjxgait.training.experiment import Experiment, Step, build_experiment
from mjxgait.training.folder import (
    BODY,
    CERTIFICATE,
    CHAMPION,
    EXAMS,
    METRICS,
    MOTHERS,
    STRESS,
    Line,
    append_lines,
    keep_body,
    kept_champion,
    read_metrics,
    truncate_metrics,
)
from mjxgait.training.prescreen import prescreen_of
from mjxgait.training.screen import Screen
from mjxgait.training.stages import CompiledGeneration
from mjxgait.training.stored import disk_errors


def train(
    folder: Path,
    creature: Creature,
    config: Config,
    screen: Screen,
    resume: bool = False,
    generation: int | None = None,
    evaluator: Evaluator | None = None,
    begin: Callable[[], object] = lambda: None,
) -> bool:
    """Run or resume the evolution in a run folder; return whether it came to its end.

    Args:
      resume: go on from a checkpoint, the latest or that of `generation`.
      evaluator: evaluates the individuals instead of this machine.
      begin: creates the folder of a new run; called after the last check.
    """
    experiment = build_experiment(creature, config)
    begin()
    checkpoints = Checkpoints(folder, config.keep_every)
    # A run that was killed before its first checkpoint starts again, with the same results.
    restored, begun = None, -1
    if resume and (checkpoints.generations() or generation is not None):
        abstract = experiment.abstract()
        restored = checkpoints.restore(abstract, creature.digest, generation)
        begun = int(restored.generation)
        mend_champion(folder, experiment, restored)
    # Checkpoints first: a kill in between leaves extra log lines, never a gap in the log.
    if later := checkpoints.drop_after(begun):
        names = ", ".join(map(str, later))
        screen.say(f"Dropped the checkpoints after generation {begun}: {names}; they come anew.")
    with disk_errors(folder):
        truncate_metrics(folder / METRICS, begun)
    if experiment.plant_note:
        screen.say(experiment.plant_note)
    if prescreen := prescreen_of(experiment):
        prescreen.begin()
    with screen.compiling(creature.name, experiment):
        step, state = _compiled(experiment, evaluator, restored)
    began = time.perf_counter()
    examiner = Examiner(experiment, versions(), screen.say, Exams(folder / EXAMS), prescreen)
    try:
        with interruptible() as interrupted:
            state, reason, examined = _evolve(
                folder, examiner, step, experiment.place(state), checkpoints, screen, interrupted
            )
    finally:
        screen.close()
        checkpoints.close()
    if reason is not None:
        conclude(folder, creature, screen, examined or examiner.best(state))
    report(folder, screen, reason, time.perf_counter() - began)
    return reason is not None


def mend_champion(folder: Path, experiment: Experiment, state: EvolutionState) -> None:
    """Write the best of a state as the run's champion if the run has no readable one."""
    try:
        kept_champion(folder, experiment.creature)
    except UserError:
        if np.isfinite(state.fitness[0]):
            with disk_errors(folder):
                champion = experiment.champion(state, versions())
                write_champion(champion, experiment.creature, folder / CHAMPION)


def _compiled(
    experiment: Experiment, evaluator: Evaluator | None, restored: EvolutionState | None
) -> tuple[Step, EvolutionState]:
    """Return the program of a generation, and the restored or first state.

    The first state has its own program. It is compiled in parallel, because the compiler uses one
    core in its first seconds on the large program.
    """
    if restored is not None:
        return _step(experiment, evaluator), restored
    with ThreadPoolExecutor(1) as aside:
        first = aside.submit(experiment.init)
        return _step(experiment, evaluator), first.result()


_COMPILED: LruCache[CompiledGeneration] = LruCache(2)
"""Programs of this process's runs, so that the next seed in a notebook is not traced again."""


def _step(experiment: Experiment, evaluator: Evaluator | None) -> Step:
    evaluates = evaluator is None
    stages = _COMPILED.find((experiment.shape, evaluates), lambda: experiment.stages(evaluates))
    return experiment.step(stages, evaluator)


def conclude(folder: Path, creature: Creature, screen: Screen, examined: Examined | None) -> None:
    """Write the champion of a run that has ended, its body and its certificate."""
    if examined is None:
        return
    with disk_errors(folder):
        write_champion(examined.champion, creature, folder / CHAMPION)
        body = examined.champion.embodied(creature)
        if body.digest != creature.digest:
            keep_body(folder / BODY, body)
        write_text(folder / CERTIFICATE, examined.certificate.to_json())
        if examined.beyond:
            text = json.dumps(examined.beyond.document(), indent=2) + "\n"
            write_text(folder / STRESS, text)
    screen.certificate(examined.certificate)


def report(folder: Path, screen: Screen, reason: str | None, seconds: float) -> None:
    """Print a summary of a run; reason: why it ended, None when the user interrupted it."""
    if lines := read_metrics(folder / METRICS):
        screen.report(
            folder, reason or "interrupted", lines[-1], seconds, interrupted=reason is None
        )


def _evolve(
    folder: Path,
    examiner: Examiner,
    step: Step,
    state: EvolutionState,
    checkpoints: Checkpoints,
    screen: Screen,
    interrupted: threading.Event,
) -> tuple[EvolutionState, str | None, Examined | None]:
    """Run generations until the end of the run.

    Returns the last state, why the run ended (None when the user interrupted it), and the certified
    individual that ended it, if any.
    """
    config, creature = examiner.experiment.config, examiner.experiment.creature
    looks, saved, examined = Validation(examiner), int(state.generation), None
    while True:
        reason, generation = stop_reason(state, config.evolution), int(state.generation)
        over = reason is not None or interrupted.is_set()
        saves = generation > saved and generation % config.checkpoint_every == 0
        # No checkpoint may be of a generation that validation may still discard.
        if found := looks.found(wait=over or saves or looks.due(state)):
            examined, state = found
            later, generation = generation, int(state.generation)
            if later > generation:
                screen.say(
                    f"Generation {generation} is what the run ends with; what evolved beside its "
                    f"examination, up to generation {later}, is forgotten."
                )
            with disk_errors(folder):
                truncate_metrics(folder / METRICS, generation)
            reason = why_ended(generation, examined.certificate.margin)
            break
        if saves:
            checkpoints.save(state, creature.name, creature.digest)
            saved = generation
        if over:
            break
        looks.begin(state)
        state = _generation(folder, examiner.experiment, step, state, screen)
    if generation > saved:
        checkpoints.save(state, creature.name, creature.digest)
    return state, reason, examined


def _generation(
    folder: Path, experiment: Experiment, step: Step, state: EvolutionState, screen: Screen
) -> EvolutionState:
    """Run one generation, append it to the log and write its best as champion.

    Nothing is written before the whole first population is evaluated.
    """
    began = time.perf_counter()
    state, metrics = step(state)
    metrics = jax.device_get(metrics)
    if metrics.generation < 0:
        return state
    line = metrics_line(metrics, time.perf_counter() - began, experiment.simulator.task)
    line |= followed(experiment.simulator.controller.numbers(state.genomes))
    append_lines(folder / METRICS, [line])
    if np.isfinite(metrics.best):
        with disk_errors(folder):
            write_champion(
                experiment.champion(state, versions()), experiment.creature, folder / CHAMPION
            )
    screen.generation(line, experiment.config)
    return state


def metrics_line(metrics: GenerationMetrics, seconds: float, task: Task) -> Line:
    """Return the line of `metrics.jsonl` for a generation; non-finite numbers become null."""
    line = {
        field.name: getattr(metrics, field.name).item()
        for field in dataclasses.fields(metrics)
        if getattr(metrics, field.name) is not None and not getattr(metrics, field.name).ndim
    }
    line["forced"] = bool(line["forced"])
    line |= {"steps_per_second": round(line["sim_steps"] / seconds), "wall_s": round(seconds, 4)}
    line |= named("term", task.terms, metrics.best_terms)
    line |= named("outcome", task.outcomes, metrics.best_outcome)
    told = {key: value if np.isfinite(value) else None for key, value in line.items()}
    return told if metrics.mothers is None else told | {MOTHERS: metrics.mothers.tolist()}


def followed(numbers: Mapping[str, np.ndarray]) -> dict[str, float]:
    """Return best and mean of each quantity [P] of a population that is sorted, best first."""
    best = {f"{name}_best": float(values[0]) for name, values in numbers.items()}
    return best | {f"{name}_mean": float(values.mean()) for name, values in numbers.items()}


def named(kind: str, names: Sequence[str], values: jax.Array) -> dict[str, float]:
    """Return the numbers of a kind under their names in a log line."""
    return {f"{kind}_{name}": float(value) for name, value in zip(names, values, strict=True)}


@functools.cache
def versions() -> dict[str, str]:
    """Return the versions of Python and the packages that determine a run's results."""
    packages = ("mjxgait", "jax", "jaxlib", "mujoco", "mujoco-mjx")
    return {"python": platform.python_version()} | {
        name: importlib.metadata.version(name) for name in packages
    }


@contextmanager
def interruptible() -> Iterator[threading.Event]:
    """Yield an event that the first Ctrl-C sets; the second one interrupts at once."""
    event = threading.Event()
    if threading.current_thread() is not threading.main_thread():
        yield event
        return

    def on_interrupt(*_: object) -> None:
        if event.is_set():
            raise KeyboardInterrupt
        event.set()

    before = signal.signal(signal.SIGINT, on_interrupt)
    try:
        yield event
    finally:
        signal.signal(signal.SIGINT, before)
