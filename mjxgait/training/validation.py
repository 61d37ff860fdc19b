"""Looks at the best of a generation while the generations after it evolve."""

import threading
from concurrent.futures import Future

from mjxgait.evolution.state import EvolutionState
from mjxgait.training.examination import Examined, Examiner, due


class Looks:
    """Of one run, one at a time.

    What comes of a look is what would have come had evolution waited for it: who is certified ends
    the run in the generation that was looked at, and what has been evolved since is forgotten.
    """

    def __init__(self, examiner: Examiner) -> None:
        self._examiner = examiner
        self._seen: Future[Examined | None] | None = None
        self._state: EvolutionState | None = None

    def due(self, state: EvolutionState) -> bool:
        """Whether it is time to look at the best of a generation that has not been looked at."""
        settings = self._examiner.experiment.config.examination
        return state is not self._state and due(settings, int(state.generation))

    def begin(self, state: EvolutionState) -> None:
        """Looks, if it is time to; before that all looks must have been `found`."""
        if not self.due(state):
            return
        self._state, self._seen = state, Future()
        self._examiner.examines.clear()
        # Two programs of all devices at once wait for each other.
        if self._examiner.tryout is not None:
            self._look(self._seen, state)
            return
        # Nobody who interrupts a second time waits for it.
        threading.Thread(target=self._look, args=(self._seen, state), daemon=True).start()

    def found(self, wait: bool) -> tuple[Examined, EvolutionState] | None:
        """Who was certified, and the state of that generation, once that is known.

        Args:
          wait: until it is. Where somebody is being examined it waits anyway: what evolved
            meanwhile would take the cores of the examination, and be forgotten if that ends well.
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
