"""Which bone moves which part of the creature, by a table or by the likeness of names."""

import difflib
import re
from collections.abc import Iterable, Mapping
from typing import Any

from mjxgait.errors import UserError, did_you_mean

LIKE = 0.6
"""Of two names, from which on they are taken for the same."""
SIDES = {"l": "left", "left": "left", "r": "right", "right": "right"}
SAME = {
    "upleg": "thigh",
    "upperleg": "thigh",
    "femur": "thigh",
    "upper": "thigh",
    "calf": "shin",
    "lowerleg": "shin",
    "shank": "shin",
    "tibia": "shin",
    "lower": "shin",
    "rear": "hind",
    "back": "hind",
    "fore": "front",
    "foreleg": "front",
    "hips": "pelvis",
    "pelvis": "pelvis",
    "torso": "trunk",
    "body": "trunk",
    "toe": "foot",
    "toes": "foot",
    "ankle": "foot",
}
"""What rigs call the parts of a leg, and one word for each."""


def matched(
    wanted: Iterable[str], found: Iterable[str], table: Mapping[str, Any] | None, where: str
) -> dict[str, str]:
    """For each wanted name the name in the file that means it, as far as there is one.

    Args:
      table: wanted name to name in the file, as the user says; it goes before all likeness.
      where: the table's file, for errors.

    Raises:
      UserError: the table names what is not there.
    """
    wanted, found = list(wanted), list(found)
    pairs = {}
    for own, other in (table or {}).items():
        for name, known in ((own, wanted), (str(other), found)):
            if name not in known:
                raise UserError(f'{where}: "{name}" is not there; {did_you_mean(name, known)}')
        pairs[own] = str(other)
    pairs |= {name: name for name in wanted if name in found and name not in pairs}
    words = {name: _words(name) for name in {*wanted, *found}}
    likely = sorted(
        ((_likeness(words[a], words[b]), a, b) for a in wanted for b in found), reverse=True
    )
    for likeness, own, other in likely:
        if likeness >= LIKE and own not in pairs and other not in pairs.values():
            pairs[own] = other
    return {name: pairs[name] for name in wanted if name in pairs}


def _words(name: str) -> tuple[frozenset[str], str]:
    """The side that a name says, and its other words in one order."""
    plain = re.sub(r"^.*:", "", name)
    plain = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", plain)
    words = [word for word in re.split(r"[^a-z]+", plain.lower()) if word]
    joined = re.sub(r"\b(up|upper|lower) leg\b", r"\1leg", " ".join(words)).split()
    sides = frozenset(SIDES[word] for word in joined if word in SIDES)
    return sides, " ".join(sorted(SAME.get(word, word) for word in joined if word not in SIDES))


def _likeness(one: tuple[frozenset[str], str], other: tuple[frozenset[str], str]) -> float:
    """From 0 to 1; of different sides 0."""
    if one[0] != other[0]:
        return 0.0
    return difflib.SequenceMatcher(None, one[1], other[1]).ratio()
