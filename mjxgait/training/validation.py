"""Asynchronous validation of a generation's best while later generations evolve."""

import threading
from concurrent.futures import Future

from mjxgait.evolution.state import EvolutionState
from mjxgait.training.examination import Examined, Examiner, due


class Looks:
    """Asynchronous validations of one run, one at a time.

    The result is the same as if evolution had waited: a certified individual ends the run in the
    validated generation, and later generations are discarded.
    """

    def __init__(self, examiner: Examiner) -> None:
        self._examiner = examiner
        self._seen: Future[Examined | None] | None = None
        self._state: EvolutionState | None = None

    def due(self, state: EvolutionState) -> bool:
        """Return whether validation of this generation is due and has not begun."""
        settings = self._examiner.experiment.config.examination
        return state is not self._state and due(settings, int(state.generation))

    def begin(self, state: EvolutionState) -> None:
        """Start a validation if it is due; all earlier results must have been `found`."""
        if not self.due(state):
            return
        self._state, self._seen = state, Future()
        self._examiner.examines.clear()
        # Two programs that use all devices would block each other, so pre-screening waits here.
        if self._examiner.tryout is not None:
            self._look(self._seen, state)
            return
        # A daemon thread: a second Ctrl-C does not wait for it.
        threading.Thread(target=self._look, args=(self._seen, state), daemon=True).start()

    def found(self, wait: bool) -> tuple[Examined, EvolutionState] | None:
        """Return the certified individual and the state of its generation, once known; else None.

        Args:
          wait: wait for the result. During an examination it waits anyway: evolution would compete
            for its cores, and its generations would be discarded if the examination passes.
        """
        if self._seen is None or self._state is None:
            return None
        if not (wait or self._seen.done() or self._examiner.examines.is_set()):
            return None
        examined, self._seen = self._seen.result(), None
        return None if examined is None else (examined, self._state)

    def _look(self, seen: Future[Examined | None], state: EvolutionState) -> None:
        try:
            seen.set_result(self._examiner.early(state))
        except BaseException as error:
            seen.set_exception(error)
