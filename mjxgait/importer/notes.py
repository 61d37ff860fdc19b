"""Import report: each change with its reason, each guess with its confidence."""

import dataclasses
from typing import Literal

Confidence = Literal["high", "medium", "low"]


@dataclasses.dataclass(frozen=True)
class Change:
    """A difference from the file, and its reason."""

    what: str
    why: str


@dataclasses.dataclass(frozen=True)
class Guess:
    """A value that the file does not state. reason: the evidence for the guess."""

    what: str
    value: str
    confidence: Confidence
    reason: str


class Notes:
    """Changes and guesses of one import; each change is reported once."""

    def __init__(self) -> None:
        self.changes: list[Change] = []
        self.guesses: list[Guess] = []

    def change(self, what: str, why: str) -> None:
        """Report a change."""
        change = Change(what, why)
        if change not in self.changes:
            self.changes.append(change)

    def guess(self, what: str, value: str, confidence: Confidence, reason: str) -> None:
        """Report a guess; a later guess of the same thing replaces the earlier."""
        self.guesses = [g for g in self.guesses if g.what != what]
        self.guesses.append(Guess(what, value, confidence, reason))

    def text(self) -> str:
        """Return the report in plain lines."""
        lines = (
            ["Changes:"] + [f"  - {c.what}: {c.why}" for c in self.changes] if self.changes else []
        )
        lines += ["Guesses (change them in creature.toml):"]
        lines += [f"  - {g.what} = {g.value}  [{g.confidence}] {g.reason}" for g in self.guesses]
        return "\n".join(lines)


def listed(names: list[str], most: int = 6) -> str:
    """`a, b, c` or `a, b, c and 7 more`."""
    return ", ".join(names[:most]) + (f" and {len(names) - most} more" if len(names) > most else "")
