"""Bones matched to the creature's parts, by a table or by similar names."""

import difflib
import re
from collections.abc import Iterable, Mapping
from typing import Any

from mjxgait.errors import UserError, did_you_mean

LIKE = 0.6
"""Likeness from which two names count as the same."""
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
"""Names of body parts in rigs, and one common word for each."""


def matched(
    wanted: Iterable[str], found: Iterable[str], table: Mapping[str, Any] | None, where: str
) -> dict[str, str]:
    """Name in the file by wanted name, for those with a match.

    Args:
      table: the user's names in the file by wanted name; it takes precedence over likeness.
      where: the table's file, for errors.

    Raises:
      UserError: the table has an unknown name.
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
    """Side in a name, and its other words in sorted order."""
    plain = re.sub(r"^.*:", "", name)
    plain = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", plain)
    words = [word for word in re.split(r"[^a-z]+", plain.lower()) if word]
    joined = re.sub(r"\b(up|upper|lower) leg\b", r"\1leg", " ".join(words)).split()
    sides = frozenset(SIDES[word] for word in joined if word in SIDES)
    return sides, " ".join(sorted(SAME.get(word, word) for word in joined if word not in SIDES))


def _likeness(one: tuple[frozenset[str], str], other: tuple[frozenset[str], str]) -> float:
    """Likeness of two names from 0 to 1; 0 for different sides."""
    if one[0] != other[0]:
        return 0.0
    return difflib.SequenceMatcher(None, one[1], other[1]).ratio()
