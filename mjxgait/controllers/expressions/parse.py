"""Parser from text to arrays, for single expressions and for programs of one per joint.

An expression is a number, the name of an observation, or `(function argument ...)`. A program is
`(list EXPRESSION ...)`, one per joint in the order of the joints, or lines `JOINT = EXPRESSION`.
Comments run from `#` or `;` to the end of a line.
"""

import dataclasses
import re
from collections.abc import Sequence

import numpy as np

from mjxgait.controllers.expressions.config import FUNCTIONS
from mjxgait.controllers.expressions.text import (
    CONSTANT,
    FUNCTION_CODES,
    VALUE_LIMIT,
    Terminal,
)
from mjxgait.errors import UserError, did_you_mean

DEEPEST = 400
"""Most nested functions; limited because the parser recurses."""
SPELLINGS = {"%": "/"}
"""Other names of functions: Koza (1992) and many later authors write protected division as `%`."""


@dataclasses.dataclass(frozen=True)
class Vocabulary:
    """Allowed parts and size of expressions.

    known: existing observations. nodes: most per expression. senses, functions: names that the
    settings allow; None allows all. patterns: the setting that allows the observations. depth:
    most nested functions.
    """

    known: tuple[Terminal, ...]
    nodes: int
    senses: tuple[str, ...] | None = None
    functions: tuple[str, ...] | None = None
    patterns: tuple[str, ...] = ()
    depth: int = DEEPEST


@dataclasses.dataclass(frozen=True)
class Word:
    """Word of a text and its line number, from 1."""

    text: str
    line: int


def words_of(text: str) -> list[Word]:
    """Return the words of a text without comments; parentheses and equals signs are words."""
    return [
        Word(word, number)
        for number, line in enumerate(text.splitlines(), 1)
        for word in re.findall(r"[()=]|[^\s()=]+", re.split("[#;]", line, maxsplit=1)[0])
    ]


def to_arrays(
    text: str, known: Sequence[Terminal], nodes: int, where: str
) -> tuple[np.ndarray, np.ndarray]:
    """Return code and value [nodes] of one expression in text.

    Raises:
      UserError: names the mistake; `where` is the name of the expression in the message.
    """
    reader = Reader(text, Vocabulary(tuple(known), nodes), where, numbered=False)
    found = reader.expression()
    if reader.next:
        raise reader.wrong(f'more after its end: "{reader.next}"')
    return found


def read_programs(
    text: str, joints: Sequence[str], vocabulary: Vocabulary, where: str, numbered: bool = True
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return code and value [J, nodes] of each program in a text.

    Args:
      joints: J names. where: name of the text in errors. numbered: whether errors give the line.

    Raises:
      UserError: names the first mistake.
    """
    reader = Reader(text, vocabulary, where, numbered)
    programs = []
    while reader.next:
        rows = reader.listed(joints) if reader.next == "(" else reader.assigned(joints)
        code, value = (np.stack(column) for column in zip(*rows, strict=True))
        programs.append((code, value))
    if not programs:
        raise UserError(
            f"{where}: holds no program; write (list EXPRESSION ...), one expression for each of "
            f"{', '.join(joints)}"
        )
    return programs


class Reader:
    """Reader that takes the words of a text in order. place: index of the next one."""

    def __init__(self, text: str, vocabulary: Vocabulary, where: str, numbered: bool) -> None:
        self.words, self.place, self.vocabulary = words_of(text), 0, vocabulary
        self.where, self.numbered = where, numbered
        self.codes = {terminal.name: terminal.code for terminal in vocabulary.known}
        self.mentioned = {word.text for word in self.words}

    @property
    def next(self) -> str:
        """Text of the next word; empty at the end."""
        return self.words[self.place].text if self.place < len(self.words) else ""

    @property
    def last(self) -> Word:
        """Word taken last."""
        return self.words[self.place - 1] if self.place else Word("", 1)

    def wrong(self, said: str, word: Word | None = None) -> UserError:
        """Return the error for a mistake at a word, by default the one taken last."""
        line = f", line {(word or self.last).line}" if self.numbered else ""
        return UserError(f"{self.where}{line}: {said}")

    def listed(self, joints: Sequence[str]) -> list[tuple[np.ndarray, np.ndarray]]:
        """Read the expressions of `(list ...)`, one per joint."""
        self._take()
        if self.next != "list":
            raise self.wrong('a program begins with "(list" or with "JOINT ="')
        begin, rows = self._take(), []
        while self.next != ")":
            if not self.next:
                raise self.wrong('"(list" ends too early; its last parenthesis is missing', begin)
            rows.append(self.expression())
        self._take()
        if len(rows) != len(joints):
            raise self.wrong(
                f'"list" has {len(rows)} expressions; give {len(joints)}, one for each of '
                f"{', '.join(joints)}, in this order",
                begin,
            )
        return rows

    def assigned(self, joints: Sequence[str]) -> list[tuple[np.ndarray, np.ndarray]]:
        """Read the expressions of `JOINT = EXPRESSION`, one per joint in any order."""
        rows: dict[str, tuple[np.ndarray, np.ndarray]] = {}
        while len(rows) < len(joints):
            missing = next(name for name in joints if name not in rows)
            if self.next in ("", "("):
                raise self.wrong(f'no expression for joint "{missing}"')
            name = self._take().text
            if self.next != "=":
                raise self.wrong(
                    f'"{name}": a program begins with "(list" or with "JOINT =", such as '
                    f"{joints[0]} = 0.3"
                )
            self._take()
            if name not in joints:
                raise self.wrong(f'there is no joint "{name}"; {did_you_mean(name, joints)}')
            if name in rows:
                raise self.wrong(
                    f'a second expression for joint "{name}", and none yet for "{missing}"'
                )
            rows[name] = self.expression()
        return [rows[name] for name in joints]

    def expression(self) -> tuple[np.ndarray, np.ndarray]:
        """Read code and value [nodes] of the next expression."""
        limits, own = self.vocabulary, self.words[self.place : self._end()]
        count = sum(word.text not in "()" for word in own)
        if count > limits.nodes:
            raise self.wrong(
                f"{count:,} nodes; an expression may have {limits.nodes} (controller.nodes)", own[0]
            )
        found = self._nodes(0)
        code = np.zeros(limits.nodes, np.int32)
        value = np.zeros(limits.nodes, np.float32)
        code[: len(found)], value[: len(found)] = zip(*found, strict=True)
        return code, value

    def _end(self) -> int:
        """Return the place after the next expression, judging by its parentheses."""
        unclosed = 0
        for place in range(self.place, len(self.words)):
            word = self.words[place].text
            unclosed += (word == "(") - (word == ")")
            if unclosed <= 0 or word == "=":
                return place + 1
        return len(self.words)

    def _nodes(self, depth: int) -> list[tuple[int, float]]:
        """Read code and value of each node. depth: number of enclosing functions."""
        word = self._take().text
        if word == ")":
            raise self.wrong("a closing parenthesis too many")
        if word != "(":
            return [self._leaf(word)]
        if depth >= self.vocabulary.depth:
            raise self.wrong(
                f"more than {self.vocabulary.depth} functions within each other (controller.depth)"
            )
        begin, name = self.last, self._function()
        nodes, given = [(FUNCTION_CODES[name], 0.0)], 0
        while self.next != ")":
            if self._cut_off:
                raise self.wrong(
                    "ends too early; something is missing in an expression that begins here", begin
                )
            nodes += self._nodes(depth + 1)
            given += 1
        if given != FUNCTIONS[name]:
            raise self.wrong(f'"{name}" takes {FUNCTIONS[name]} arguments, not {given}', begin)
        self._take()
        return nodes

    @property
    def _cut_off(self) -> bool:
        """True at the end of the text and before the next `JOINT =`."""
        following = self.words[self.place : self.place + 2]
        return not following or "=" in [word.text for word in following]

    def _function(self) -> str:
        """Read the name of a function."""
        word = self._take().text
        name, allowed = SPELLINGS.get(word, word), self.vocabulary.functions
        if word in self.codes or _is_number(word):
            raise self.wrong(f'"{word}" stands where a function must: "(" is followed by its name')
        if name not in FUNCTIONS:
            raise self.wrong(f'there is no function "{word}"; {did_you_mean(word, FUNCTIONS)}')
        if allowed is not None and name not in allowed:
            more = [f for f in FUNCTIONS if f in self.mentioned and f not in allowed]
            given = " ".join(f"'{f}'" for f in dict.fromkeys((*allowed, *more, name)))
            raise self.wrong(
                f'"{word}" is not among controller.functions; add it: --controller.functions '
                f"{given}"
            )
        return name

    def _leaf(self, word: str) -> tuple[int, float]:
        allowed = self.vocabulary.senses
        if word in self.codes:
            if allowed is not None and word not in allowed:
                more = sorted(self.mentioned & set(self.codes) - set(allowed))
                given = " ".join(f"'{p}'" for p in (*self.vocabulary.patterns, *more))
                raise self.wrong(
                    f'"{word}" is not among controller.senses; add it: --controller.senses {given}'
                )
            return self.codes[word], 0.0
        if not _is_number(word):
            raise self.wrong(
                f'"{word}" is neither a sense nor a number; {did_you_mean(word, self.codes)}'
            )
        if not abs(float(word)) <= VALUE_LIMIT:
            raise self.wrong(f"{word}: a constant must be within ±{VALUE_LIMIT:g}")
        return CONSTANT, float(word)

    def _take(self) -> Word:
        if not self.next:
            raise self.wrong("ends too early; something is missing")
        self.place += 1
        return self.last


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True
