"""The one error that a user's mistake raises, and the words it is made of."""

import difflib
from collections.abc import Iterable

INTERRUPTED = 130
"""Exit code of a run that the user interrupted."""


class UserError(Exception):
    """A mistake in what the user gave: one sentence that names the thing and the way out.

    The command line exits with code 2.
    """


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """` (did you mean "x"?)`, or the list of what is known when nothing is near."""
    names = sorted(known)
    near = difflib.get_close_matches(word, names, n=1, cutoff=0.6)
    if near:
        return f'did you mean "{near[0]}"?'
    return f"known: {', '.join(names)}" if names else "none is known"
