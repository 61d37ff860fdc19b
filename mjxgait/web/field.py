"""The best individuals of a run that may still learn, each simulated, side by side in a scene.

The champion is the best of the latest generation, the others those of the latest checkpoint, so a
training writes nothing more for them.
"""

import contextlib
import dataclasses
import itertools
from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np

from mjxgait.animation.export import WalkLoop
from mjxgait.champion import Champion
from mjxgait.creature import Creature
from mjxgait.errors import UserError
from mjxgait.inspect.snapshot import Snapshot, read_snapshot
from mjxgait.rendering.walk import record_walk
from mjxgait.training.folder import CHAMPION, kept_champion
from mjxgait.training.stored import stored_generations
from mjxgait.web.gallery import Words, looped, scene_of

COUNT = 9
"""Most individuals that are shown."""
SECONDS = 5.0
"""Duration of each walk."""


@dataclasses.dataclass(frozen=True, eq=False)
class Shown:
    """An individual and its motion. fell: s, infinite if it stayed up."""

    champion: Champion
    loop: WalkLoop
    fell: float

    @property
    def does(self) -> str:
        """What it does, in a few words."""
        if np.isfinite(self.fell):
            return f"falls after {self.fell:.1f} s"
        if self.loop.walk.creature.settings.creature.beside:
            return "a contest"
        if not self.loop.strides:
            return "completes no steady stride yet"
        return f"{self.loop.speed:.2f} m/s"

    def words(self, place: int) -> Words:
        """What the page says of it. place: among all shown, the best is 0."""
        name = f"number {place + 1}" if place else "the best"
        found = f"fitness {self.champion.fitness:.2f}, generation {_born(self.champion)}"
        return Words(name, self.does, found, "", not np.isfinite(self.fell))


def _born(champion: Champion) -> object:
    """Generation in which an individual was found last; "?" if it does not say."""
    return champion.origin.get("generation", "?")


class Field:
    """The individuals of a run folder. `advance` does one small piece of work at a time.

    shown: those of the scene, best first.
    """

    def __init__(self, run: Path, creature: Creature) -> None:
        self.run, self.creature = run, creature
        self.shown: tuple[Shown, ...] = ()
        self._best: Champion | None = None
        self._best_was_last = False
        self._front: list[Champion] = []
        self._next: list[Champion] = []
        self._seen: dict[str, int] = {}
        self._walks: dict[str, Shown | None] = {}

    def advance(self) -> bool:
        """Simulate at most one individual that is new; return whether `shown` has changed.

        Raises:
          UserError: the champion or the checkpoint cannot be read.
        """
        self._look()
        # A training may find champions faster than they are simulated: the first population has
        # precedence, later ones have turns.
        waits = self._next and (self._best_was_last or (self.shown and not self._front))
        if self._best is not None and not waits:
            self._best_was_last = self._simulated(self._best)
            if self._best_was_last:
                return self._show()
        self._best_was_last = False
        if any(self._simulated(one) for one in self._next):
            return False
        if self._next:
            self._front, self._next = self._next, []
            return self._show()
        return False

    @property
    def what(self) -> str:
        """What is shown, in a line. The best may be older than its latest generation."""
        best, *others = self.shown
        latest = best.champion
        if self._best is not None and self._best.fingerprint == latest.fingerprint:
            latest = self._best
        found = f"generation {_born(latest)}, fitness {latest.fitness:.2f}: {best.does}"
        if not others:
            return found
        return (
            f"{found}; beside it the best {len(others)} of generation {_born(others[-1].champion)}"
        )

    @property
    def idle(self) -> bool:
        """Whether all individuals known are shown."""
        return not self._next

    def scene(self) -> dict[str, object]:
        """Return the scene of those that are shown, for `school.js`."""
        words = [one.words(place) for place, one in enumerate(self.shown)]
        afloat = self.shown[0].loop.walk.afloat
        return scene_of([one.loop for one in self.shown], words, afloat)

    def _look(self) -> None:
        """Read the champion and the latest checkpoint if they are new."""
        with contextlib.suppress(FileNotFoundError):
            written = (self.run / CHAMPION).stat().st_mtime_ns
            if self._seen.get(CHAMPION) != written:
                self._seen[CHAMPION] = written
                # A partial file cannot occur: files are replaced atomically.
                self._best = kept_champion(self.run, self.creature)
        # The individuals of a checkpoint are shown before those of the next one are read.
        generations = [] if self._next else stored_generations(self.run)
        if generations and self._seen.get("generation") != generations[-1]:
            self._seen["generation"] = generations[-1]
            # The run may delete the checkpoint meanwhile; the next one comes soon.
            with contextlib.suppress(OSError):
                self._next = list(front_of(read_snapshot(self.run, generations[-1]), COUNT))

    def _simulated(self, champion: Champion) -> bool:
        """Simulate an individual; return False if that has been done before."""
        if champion.fingerprint in self._walks:
            return False
        self._walks[champion.fingerprint] = None
        # A graph of blocks may grow no body.
        with contextlib.suppress(UserError):
            walk = record_walk(champion.embodied(self.creature), champion, SECONDS)
            self._walks[champion.fingerprint] = Shown(champion, looped(walk), walk.fell)
        return True

    def _show(self) -> bool:
        """Show the champion and the front, and forget all others; return whether this changed."""
        champions = [*([self._best] if self._best else []), *self._front]
        found = (self._walks.get(one.fingerprint) for one in distinct(champions))
        before, self.shown = self.shown, tuple([one for one in found if one])[:COUNT]
        keep = {one.fingerprint for one in (*champions, *self._next)}
        self._walks = {name: one for name, one in self._walks.items() if name in keep}
        return bool(self.shown) and before != self.shown


def front_of(snapshot: Snapshot, count: int) -> Iterator[Champion]:
    """The first `count` different individuals of a checkpoint with a finite fitness, best first."""
    finite = int(np.isfinite(snapshot.fitness).sum())
    ranked = distinct(snapshot.champion(rank) for rank in range(1, finite + 1))
    return itertools.islice(ranked, count)


def distinct(champions: Iterable[Champion]) -> Iterator[Champion]:
    """The individuals without repetitions."""
    known: set[str] = set()
    for one in champions:
        if one.fingerprint not in known:
            known.add(one.fingerprint)
            yield one
