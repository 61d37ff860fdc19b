"""Host loop around the jitted generation: it counts, logs, checkpoints and stops."""

import signal
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from mjxgait.champion import write_champion
from mjxgait.config.schema import Config
from mjxgait.creature import Creature
from mjxgait.errors import UserError
from mjxgait.evolution.state import EvolutionState, stop_reason
from mjxgait.files import write_text
from mjxgait.lru import LruCache
from mjxgait.simulation.evaluator import Evaluator
from mjxgait.training.advance import Generations, versions
from mjxgait.training.checkpoint import Checkpoints
from mjxgait.training.disk import disk_errors
from mjxgait.training.examination import Examined, Examiner, Validation, why_ended
from mjxgait.training.exams import Exams
from mjxgait.training.experiment import Batch, Experiment, Step, build_experiment, one_row
from mjxgait.training.family import drop_newborns, keep_newborns
from mjxgait.training.folder import (
    BODY,
    CERTIFICATE,
    CHAMPION,
    EXAMS,
    METRICS,
    STRESS,
    command,
    kept_champion,
    write_creature,
)
from mjxgait.training.initial import (
    Genomes,
    Initial,
    check_initial,
    has_begun,
    keep_initial,
    planted,
    read_initial,
)
from mjxgait.training.lock import locked_run
from mjxgait.training.logs import MOTHERS, append_lines, read_metrics, truncate_metrics
from mjxgait.training.prescreen import prescreen_of
from mjxgait.training.screen import Screen
from mjxgait.training.skill_runs import write_skill_runs
from mjxgait.training.stages import CompiledGeneration


def train(
    folder: Path,
    creature: Creature,
    config: Config,
    screen: Screen,
    resume: bool = False,
    generation: int | None = None,
    evaluator: Evaluator | None = None,
    begin: Callable[[], object] = lambda: None,
    initial: Initial | None = None,
    ancestors: Callable[[], Initial | None] | None = None,
) -> bool:
    """Run or resume the evolution in a run folder; return whether it came to its end.

    Args:
      resume: go on from a checkpoint, the latest or that of `generation`.
      evaluator: evaluates the individuals instead of this machine.
      begin: creates the folder of a new run; called after the last check.
      initial: first individuals of a new run.
      ancestors: evolves the first individuals of a run that has none yet; None: interrupted.

    Raises:
      UserError: the physics does not support the creature's model, the first individuals do not
        fit, or another process works on the run.
    """
    experiment = build_experiment(creature, config)
    if initial:
        check_initial(initial, experiment)
    with locked_run(folder, resume, begin):
        if ancestors and not initial and not has_begun(folder):
            initial = ancestors()
            if initial is None:
                again = command("train", "--resume", folder, run=folder)
                screen.say(f"interrupted; go on with: {again}")
                return False
            check_initial(initial, experiment)
        if initial:
            keep_initial(folder, initial)
        return _train(folder, experiment, screen, resume, generation, evaluator)


def _train(
    folder: Path,
    experiment: Experiment,
    screen: Screen,
    resume: bool,
    generation: int | None,
    evaluator: Evaluator | None,
) -> bool:
    creature, checkpoints = experiment.creature, Checkpoints(folder, experiment.config.keep_every)
    restored = None
    # A run that was killed before its first checkpoint starts again, with the same results.
    if resume and (checkpoints.generations() or generation is not None):
        restored = checkpoints.restore(experiment.abstract(), creature.digest, generation)
        mend_champion(folder, experiment, restored)
    _drop_after(-1 if restored is None else int(restored.generation), folder, checkpoints, screen)
    if experiment.plant_note:
        screen.say(experiment.plant_note)
    if prescreen := prescreen_of(experiment):
        prescreen.begin()
    with screen.compiling(creature.name, experiment.config):
        generations = _compiled(Batch((experiment,)), evaluator, restored, read_initial(folder))
    began = time.perf_counter()
    examiner = Examiner(experiment, versions(), screen.say, Exams(folder / EXAMS), prescreen)
    try:
        with interruptible() as interrupted:
            state, reason, examined = _evolve(
                folder, examiner, generations, checkpoints, screen, interrupted
            )
    finally:
        screen.close()
        checkpoints.close()
    if reason is not None:
        conclude(folder, creature, screen, examined or examiner.best(state))
    report(folder, screen, reason, time.perf_counter() - began)
    return reason is not None


def _drop_after(begun: int, folder: Path, checkpoints: Checkpoints, screen: Screen) -> None:
    """Drop what a run has stored after the generation that it continues from.

    Checkpoints first: a kill in between leaves extra log lines, never a gap in the log.
    """
    if later := checkpoints.drop_after(begun):
        names = ", ".join(map(str, later))
        screen.say(f"Dropped the checkpoints after generation {begun}: {names}; they come anew.")
    _forget(folder, begun)


def _forget(folder: Path, generation: int) -> None:
    """Remove what the logs and the family record hold of later generations."""
    with disk_errors(folder):
        truncate_metrics(folder / METRICS, generation)
        drop_newborns(folder, generation)


def mend_champion(folder: Path, experiment: Experiment, state: EvolutionState) -> None:
    """Write the best of a state as the run's champion if the run has no readable one."""
    try:
        kept_champion(folder, experiment.creature)
    except UserError:
        keep_best(folder, experiment, state)


def keep_best(folder: Path, experiment: Experiment, state: EvolutionState) -> None:
    """Write the best of a state as the run's champion if its fitness is finite."""
    if np.isfinite(state.fitness[0]):
        with disk_errors(folder):
            champion = experiment.champion(state, versions())
            write_champion(champion, experiment.creature, folder / CHAMPION)


def _compiled(
    run: Batch,
    evaluator: Evaluator | None,
    restored: EvolutionState | None,
    initial: Genomes | None,
) -> Generations:
    """Return the generations of one run, from the restored or the first state.

    The first state has its own program. It is compiled in parallel, because the compiler uses one
    core in its first seconds on the large program.
    """

    def begun() -> EvolutionState:
        if restored is not None:
            return one_row(restored)
        one = run.experiments[0]
        drawn, controller = one.init(), one.simulator.controller
        return one_row(drawn if initial is None else planted(drawn, initial, controller))

    with ThreadPoolExecutor(1) as aside:
        first = aside.submit(begun)
        return Generations(_step(run, evaluator), run, first.result())


_COMPILED: LruCache[CompiledGeneration] = LruCache(2)
"""Programs of this process's runs, so that the next seed in a notebook is not traced again."""


def _step(run: Batch, evaluator: Evaluator | None) -> Step:
    shape, evaluates = run.experiments[0].shape, evaluator is None
    stages = _COMPILED.find((shape, evaluates), lambda: run.stages(evaluates))
    return run.bound(stages, evaluator)


def conclude(folder: Path, creature: Creature, screen: Screen, examined: Examined | None) -> None:
    """Write the champion of a run that has ended, its body and its certificate."""
    if examined is None:
        return
    with disk_errors(folder):
        write_champion(examined.champion, creature, folder / CHAMPION)
        body = examined.champion.embodied(creature)
        if body.digest != creature.digest:
            write_creature(folder / BODY, body.files)
        skills = write_skill_runs(folder, examined.champion, examined.certificate)
        write_text(folder / CERTIFICATE, examined.certificate.to_json())
        if examined.beyond:
            write_text(folder / STRESS, examined.beyond.to_json())
    screen.certificate(examined.certificate)
    if skills:
        screen.say(f"Each skill can be shown alone: {', '.join(map(str, skills))}.")


def report(folder: Path, screen: Screen, reason: str | None, seconds: float) -> None:
    """Print a summary of a run; reason: why it ended, None when the user interrupted it."""
    if lines := read_metrics(folder / METRICS):
        screen.report(
            folder, reason or "interrupted", lines[-1], seconds, interrupted=reason is None
        )


def _evolve(
    folder: Path,
    examiner: Examiner,
    generations: Generations,
    checkpoints: Checkpoints,
    screen: Screen,
    interrupted: threading.Event,
) -> tuple[EvolutionState, str | None, Examined | None]:
    """Run generations until the end of the run.

    Returns the last state, why the run ended (None when the user interrupted it), and the certified
    individual that ended it, if any.
    """
    config, creature = examiner.experiment.config, examiner.experiment.creature
    validation, saved, examined = Validation(examiner), generations.generation, None
    state = generations.row()
    while True:
        reason, generation = stop_reason(state, config.evolution), int(state.generation)
        over = reason is not None or interrupted.is_set()
        saves = generation > saved and generation % config.checkpoint_every == 0
        # No checkpoint may be of a generation that validation may still discard.
        if found := validation.found(wait=over or saves or validation.due(state)):
            examined, state = found
            later, generation = generation, int(state.generation)
            if later > generation:
                screen.say(
                    f"Generation {generation} is what the run ends with; what evolved beside its "
                    f"examination, up to generation {later}, is forgotten."
                )
            _forget(folder, generation)
            reason = why_ended(generation, examined.certificate.margin)
            break
        if saves:
            checkpoints.save(state, creature.name, creature.digest)
            saved = generation
        if over:
            break
        validation.begin(state)
        state = _generation(folder, examiner.experiment, generations, screen)
    if generation > saved:
        checkpoints.save(state, creature.name, creature.digest)
    return state, reason, examined


def _generation(
    folder: Path, experiment: Experiment, generations: Generations, screen: Screen
) -> EvolutionState:
    """Run one generation, append it to the log and write its best as champion; return the state."""
    lines, state = generations.advance(), generations.row()
    for line in lines:
        append_lines(folder / METRICS, [line])
        if MOTHERS in line:
            keep_newborns(folder, state)
        keep_best(folder, experiment, state)
        screen.generation(line, experiment.config)
    if lines and not state.seeded:
        screen.say(
            f"The best fitness, {state.fitness[0]:.3f}, earns nothing: the population is drawn "
            "anew."
        )
    return state


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
