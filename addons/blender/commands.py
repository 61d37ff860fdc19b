"""Command lines of `mjxgait`, and its progress read from what it prints. Runs without Blender."""

import dataclasses
import re
import shlex
import shutil
from pathlib import Path

PROGRAM = "mjxgait"
ABSENT = (
    "The program mjxgait was not found. Install it in a terminal (its README says how), then name "
    "its path in Preferences > Add-ons > mjxgait."
)
CHARACTER, CYCLE, CREATURE, RUN, WALK = "character.glb", "cycle.glb", "creature", "run", "walk.glb"
"""Names in the folder of a job: the character at rest and its cycle as Blender exports them, what
`import` and `train` or `refine` make of them, and the character with its walk.
"""
RATES = (24, 30, 60)
GAITS = (
    *("natural", "walk", "amble", "trot", "pace", "canter", "bound", "gallop", "hop"),
    *("tripod", "wave", "alternating", "waddle"),
)
STYLES = ("calm", "sneaky", "heavy", "proud", "tired", "hurried")


class NotStarted(Exception):
    """Reason in one sentence for which a job cannot begin."""


@dataclasses.dataclass(frozen=True)
class Choices:
    """What the panel asks.

    speed: body lengths per second; zero, as the empty gait and style, leaves it to evolution. turn:
    deg/s to the left. keep_movable, freeze: patterns of bones, separated by blanks. height: m; zero
    guesses it. keep: share of a cycle that `refine` keeps. population, generations: zero for the
    program's own. more: further options of `train` or `refine`.
    """

    speed: float = 0.0
    gait: str = ""
    style: str = ""
    turn: float = 0.0
    keep_movable: str = ""
    freeze: str = ""
    height: float = 0.0
    keep: float = 0.5
    travelling: bool = False
    population: int = 0
    generations: int = 0
    seed: int = 0
    more: str = ""


@dataclasses.dataclass(frozen=True)
class Step:
    """One command of a job. begins, ends: share of the job before it and after it."""

    title: str
    words: tuple[str, ...]
    begins: float
    ends: float


def find_program(named: str) -> str:
    """Return the path of `mjxgait`: the one that is named, or the one on the search path.

    Raises:
      NotStarted: there is none.
    """
    if found := shutil.which(named or PROGRAM):
        return found
    raise NotStarted(f"{named}: no such program. {ABSENT}" if named else ABSENT)


def nearest_rate(frames_per_s: float) -> int:
    """Return the rate of key frames for a scene: its own where `export` writes it, else 30."""
    return next((rate for rate in RATES if abs(rate - frames_per_s) < 0.5), 30)


def walk_steps(program: str, folder: Path, choices: Choices, rate: int) -> tuple[Step, ...]:
    """Return the commands that make the character in the folder walk."""
    options = _options(
        {
            "--speed": f"{choices.speed:.4g}bl/s" if choices.speed else "",
            "--gait": choices.gait,
            "--style": choices.style,
            "--turn": f"{choices.turn:.4g}" if choices.turn else "",
        }
    )
    words = ["train", "--env", str(folder / CREATURE), "--no-plots", *options]
    return _steps(program, folder, choices, rate, ("Evolving a walk", words))


def refine_steps(program: str, folder: Path, choices: Choices, rate: int) -> tuple[Step, ...]:
    """Return the commands that make the cycle in the folder walk."""
    words = ["refine", "--env", str(folder / CREATURE), "--keys", str(folder / CYCLE)]
    words += ["--keep", f"{choices.keep:.4g}"]
    return _steps(program, folder, choices, rate, ("Fixing the cycle", words))


def _steps(
    program: str, folder: Path, choices: Choices, rate: int, evolving: tuple[str, list[str]]
) -> tuple[Step, ...]:
    title, words = evolving
    character, run = folder / CHARACTER, folder / RUN
    importing = ["import", str(character), "--out", str(folder / CREATURE)]
    importing += _options({"--height": f"{choices.height:.4g}" if choices.height else ""})
    for option, patterns in (("--keep", choices.keep_movable), ("--freeze", choices.freeze)):
        importing += [word for pattern in _split(patterns) for word in (option, pattern)]
    search = _options(
        {
            "--population": str(choices.population or ""),
            "--generations": str(choices.generations or ""),
        }
    )
    words = [*words, "--out", str(run), "--seed", str(choices.seed), *search]
    words += _split(choices.more)
    exporting = ["export", str(run), "--onto", str(character), "--out", str(folder / WALK)]
    exporting += ["--rate", str(rate), *(["--travelling"] if choices.travelling else [])]
    return (
        Step("Reading the armature", (program, *importing), 0.0, 0.05),
        Step(title, (program, *words), 0.05, 0.97),
        Step("Writing the action", (program, *exporting), 0.97, 1.0),
    )


def _options(values: dict[str, str]) -> list[str]:
    """Return the options that have a value."""
    return [word for option, value in values.items() if value for word in (option, value)]


def _split(text: str) -> list[str]:
    """Return the words of a line.

    Raises:
      NotStarted: a quotation mark is left open.
    """
    try:
        return shlex.split(text)
    except ValueError as error:
        raise NotStarted(f"{text}: cannot be read as options ({error})") from None


@dataclasses.dataclass(frozen=True)
class Progress:
    """How far a job is. share: 0 to 1. text: for people. verdict: of the certificate, once known."""

    share: float = 0.0
    text: str = ""
    verdict: str = ""


GENERATION = re.compile(r"generation\s+(\d+)/(\d+)\s.*alive\s+(\d+)%.*steps/s\s+(.+) left")
VERDICT = re.compile(r"(?:Certified|Not certified)\b.*")
UNDER_WAY = ("Compiling", "Compiled", "Generation ")


def progress_after(before: Progress, step: Step, line: str) -> Progress:
    """Return the progress after a line that a step printed."""
    if found := GENERATION.match(line):
        done, last, alive, left = found.groups()
        share = step.begins + (step.ends - step.begins) * int(done) / max(int(last), 1)
        text = f"{step.title}: generation {done} of {last}, {alive} % stay up, {left} left"
        return dataclasses.replace(before, share=share, text=text)
    if VERDICT.match(line):
        return dataclasses.replace(before, verdict=line.strip())
    if line.startswith(UNDER_WAY):
        return dataclasses.replace(before, text=f"{step.title}: {line.strip()}")
    return before


def began(before: Progress, step: Step) -> Progress:
    """Return the progress as a step begins."""
    return dataclasses.replace(before, share=step.begins, text=f"{step.title}…")
