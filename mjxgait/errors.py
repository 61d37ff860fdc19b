"""Error for a user's mistake, and helpers for messages."""

import difflib
import fnmatch
from collections.abc import Iterable, Sequence

INTERRUPTED = 130
"""Exit code of a run interrupted by the user."""


class UserError(Exception):
    """Mistake in the user's input: one sentence that names the thing and the way out.

    The command line exits with code 2.
    """


class NotLoaded(UserError):
    """User-defined controller or task that was not named on the command line.

    options: words that name all such code of a run; empty where no run is known.
    """

    def __init__(self, said: str, options: Sequence[str] = ()) -> None:
        super().__init__(said)
        self.options = tuple(options)


def not_loaded(kind: str, name: str) -> NotLoaded:
    """Return the error for a controller or a task that was not named."""
    return NotLoaded(
        f'the {kind} is "{name}", which is no part of this program; code is never loaded from a '
        f"run folder or a settings file: name it with --{kind} FILE.py:CLASS"
    )


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """Return `did you mean "x"?`; else the known words, or that none is known."""
    names = sorted(known)
    near = difflib.get_close_matches(word, names, n=1, cutoff=0.6)
    if near:
        return f'did you mean "{near[0]}"?'
    return f"known: {', '.join(names)}" if names else "none is known"


def matching(pattern: str, names: Sequence[str], what: str, where: str) -> list[int]:
    """Return the places of the names that match a shell pattern.

    Args:
      what: the kind of thing that the names belong to, such as joint. where: the option or key that
        holds the pattern.

    Raises:
      UserError: none matches, so the pattern would do nothing.
    """
    found = [i for i, name in enumerate(names) if fnmatch.fnmatchcase(name, pattern)]
    if not found:
        raise UserError(f'{where}: no {what} matches "{pattern}"; {did_you_mean(pattern, names)}')
    return found


def matches(name: str, patterns: Iterable[str]) -> bool:
    """Return whether a name matches one of several shell patterns."""
    return any(fnmatch.fnmatchcase(name, pattern) for pattern in patterns)


def clause(sentence: str) -> str:
    """Return a sentence as a part of another: with a small letter, and without its full stop."""
    return sentence[0].lower() + sentence[1:].rstrip(".")


def listed(names: Sequence[str], most: int = 6) -> str:
    """Return `a, b, c` or `a, b, c and 7 more`."""
    return ", ".join(names[:most]) + (f" and {len(names) - most} more" if len(names) > most else "")
