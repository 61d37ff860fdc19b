"""What an import tells the user: each change with its reason, each guess with its confidence."""

import dataclasses
from typing import Literal

Confidence = Literal["high", "medium", "low"]


@dataclasses.dataclass(frozen=True)
class Change:
    """Something that is different from the file, and why."""

    what: str
    why: str


@dataclasses.dataclass(frozen=True)
class Guess:
    """Something that the file does not say. reason: what it was guessed from."""

    what: str
    value: str
    confidence: Confidence
    reason: str


class Notes:
    """Collects the changes and guesses of one import; the same change is told once."""

    def __init__(self) -> None:
        self.changes: list[Change] = []
        self.guesses: list[Guess] = []

    def change(self, what: str, why: str) -> None:
        """Tells of a change."""
        change = Change(what, why)
        if change not in self.changes:
            self.changes.append(change)

    def guess(self, what: str, value: str, confidence: Confidence, reason: str) -> None:
        """Tells of a guess; a later guess of the same thing replaces the earlier."""
        self.guesses = [g for g in self.guesses if g.what != what]
        self.guesses.append(Guess(what, value, confidence, reason))

    def text(self) -> str:
        """The report in plain lines."""
        lines = (
            ["Changes:"] + [f"  - {c.what}: {c.why}" for c in self.changes] if self.changes else []
        )
        lines += ["Guesses (change them in creature.toml):"]
        lines += [f"  - {g.what} = {g.value}  [{g.confidence}] {g.reason}" for g in self.guesses]
        return "\n".join(lines)


def listed(names: list[str], most: int = 6) -> str:
    """`a, b, c` or `a, b, c and 7 more`."""
    return ", ".join(names[:most]) + (f" and {len(names) - most} more" if len(names) > most else "")
