"""The program as a library: the same runs as the command line makes, from a script or a notebook.

import mjxgait

run = mjxgait.train("tall_quadruped", seed=0, out="runs/x", generations=20)
run.champion, run.certificate, run.metrics()
mjxgait.walk(run)["trunk_z"]
"""

import dataclasses
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mjxgait.certify import Certificate, CertificateConfig, certify, read_certificate
from mjxgait.champion import Champion
from mjxgait.creature import Creature
from mjxgait.creature import load_creature as load_folder
from mjxgait.creature.scale import load_files, scaled
from mjxgait.errors import UserError
from mjxgait.runs.exams import Exams
from mjxgait.runs.folder import (
    CERTIFICATE,
    CHAMPION,
    EXAMS,
    METRICS,
    create_run,
    open_champion,
    open_run,
    read_metrics,
)
from mjxgait.settings.config import Config
from mjxgait.settings.shipped import find_creature
from mjxgait.settings.tables import build, merge, read_toml

if TYPE_CHECKING:  # it leads to all that draws
    from mjxgait.keys.departure import Departure

Place = str | Path


@dataclasses.dataclass(frozen=True)
class Run:
    """A run folder.

    folder: where everything of it lies (the README says what).
    """

    folder: Path

    @property
    def creature(self) -> Creature:
        """The champion's body: where bodies evolve its own, else that which the run was given."""
        if (self.folder / CHAMPION).exists():
            return open_champion(self.folder)[0]
        return open_run(self.folder)[0]

    @property
    def config(self) -> Config:
        """The settings, every key."""
        return open_run(self.folder)[1]

    @property
    def champion(self) -> Champion:
        """The best individual: its genome by name, its settings, its fitness.

        Raises:
          UserError: there is none yet.
        """
        return open_champion(self.folder)[1]

    @property
    def certificate(self) -> dict[str, Any] | None:
        """What the examiner said, as `certificate.json` has it; None before an examination."""
        return read_certificate(self.folder / CERTIFICATE)

    @property
    def certified(self) -> bool:
        """Whether its champion has passed every criterion."""
        document = self.certificate
        return bool(document and document["passed"])

    @property
    def departure(self) -> "Departure":
        """How far the champion is from the cycle that the run stays near, in numbers and in words.

        Raises:
          UserError: the run was not made by `refine`, or has no champion.
        """
        from mjxgait.keys.departure import departure_of

        return departure_of(self.folder)

    def metrics(self) -> dict[str, np.ndarray]:
        """Each number of `metrics.jsonl` over generations [G], NaN where there was none."""
        lines = read_metrics(self.folder / METRICS)
        names = dict.fromkeys(name for line in lines for name in line)
        return {
            name: np.array([np.nan if line.get(name) is None else line[name] for line in lines])
            for name in names
        }


def load_creature(
    env: Place,
    scale: Mapping[str, float] | None = None,
    tell: Callable[[str], object] = lambda said: None,
) -> Creature:
    """A shipped creature by name, a creature folder, or a model file (MJCF, URDF) as it is.

    Args:
      scale: factors of the parts' size by pattern of their names (docs/creature.md).
      tell: called with what was found in a model file.

    Raises:
      UserError: there is none, or it cannot be used; says why.
    """
    path = Path(env)
    if not path.is_file():
        return scaled(load_folder(find_creature(str(env))), scale or {})
    from mjxgait.importing import import_model

    imported = import_model(path)
    tell(imported.notes.text())
    return scaled(load_files(imported.files), scale or {})


def train(
    env: Place = "tall_quadruped",
    *,
    out: Place | None = None,
    config: Place | None = None,
    controller: str | None = None,
    task: str | None = None,
    scale: Mapping[str, float] | None = None,
    speed: str | float | None = None,
    gait: str | None = None,
    turn: float | None = None,
    steer: float | None = None,
    style: Place | None = None,
    certificate: str | None = None,
    seed: int = 0,
    population: int | None = None,
    generations: int | None = None,
    settings: Mapping[str, Any] | None = None,
    quiet: bool = False,
) -> Run:
    """Evolves a creature, has its champion examined, and returns the run.

    It is what `mjxgait train` does, without plots: the same settings give the same champion.

    Args:
      env: shipped creature, creature folder, or model file. out: the run folder, which must not
        hold anything; by default a new one under runs/.
      config: file with settings, or the name of a shipped config such as wilson.
      controller, task: who moves the creature and what it is to do: a shipped name, or
        FILE.py:CLASS of your own (docs/extending.md).
      scale: factors of the parts' size, such as {"*_shin": 1.2} (docs/creature.md).
      speed, gait, turn, steer, style: what is asked of a walk (docs/wishes.md): m/s or text such as
        "0.4bl/s", a name, deg/s to the left, deg/s to either side, a name or a file.
      certificate: walks, or anywhere (docs/certificate.md).
      seed, population, generations: the settings that are changed most often.
      settings: any others, in tables as in a config file: {"rollout": {"seconds": 5.0}}.
      quiet: says nothing on the screen.

    Raises:
      UserError: one sentence that says what is wrong with what was given.
    """
    from mjxgait.parts import resolve_config
    from mjxgait.parts.wishes import Wishes, wished

    use = _use(controller=controller, task=task)
    creature = load_creature(env, scale)
    resolved = resolve_config(
        creature.settings.train, creature.name, Path(config) if config else None, use
    )
    asked = {
        "speed": speed,
        "gait": gait,
        "turn": turn,
        "steer": steer,
        "style": style,
        "certificate": certificate,
    }
    resolved = wished(resolved, creature, Wishes.of(asked))
    short = {"population": population, "generations": generations}
    evolution = {key: value for key, value in short.items() if value is not None}
    table = merge(dataclasses.asdict(resolved), {"seed": seed, "evolution": evolution})
    chosen = build(type(resolved), merge(table, settings or {}), "the settings given to train")
    folder = create_run(Path(out) if out else None, creature, chosen)
    return _evolved(folder, creature, chosen, quiet)


def refine(
    env: Place,
    keys: Place,
    *,
    out: Place | None = None,
    keep: float = 0.5,
    names: Mapping[str, str] | Place | None = None,
    begin: float | None = None,
    end: float | None = None,
    tolerance: float = 3.0,
    forward: str = "z",
    config: Place | None = None,
    seed: int = 0,
    population: int | None = None,
    generations: int | None = None,
    settings: Mapping[str, Any] | None = None,
    quiet: bool = False,
) -> Run:
    """Makes a hand-made or captured cycle walk, and returns the run (docs/refine.md).

    It is what `mjxgait refine` does; `Run.departure` says what physics changed.

    Args:
      env: as for `train`. keys: file with the cycle: GLB, BVH, CSV or JSON. out: as for `train`.
      keep: 1 leaves the poses as they are, 0 lets each joint depart by 30 degrees and the period by
        30 %.
      names: name in the file by part (of a CSV or JSON: joint), or a TOML file of these, where the
        guess is wrong.
      begin, end: s, of the cycle in the file. tolerance: degrees, root mean square, within which key
        poses reproduce it. forward: z, -z, x or -x, where the file's creature looks, Y being up.
      config, seed, population, generations, settings, quiet: as for `train`.

    Raises:
      UserError: one sentence that says what is wrong with what was given, or with the file.
    """
    from mjxgait.keys import bring
    from mjxgait.keys import refine as near

    creature, source = load_creature(env), Path(keys)
    base = near.base_settings(
        creature, Path(config) if config else None, seed, population, generations, settings
    )
    table = read_toml(Path(names)) if isinstance(names, str | Path) else names
    tell: Callable[[str], object] = (lambda said: None) if quiet else print
    brought = bring(creature, source, table, (begin, end), np.radians(tolerance), forward, tell)
    chosen = near.refining(base, brought, keep)
    folder = near.begin(Path(out) if out else None, creature, chosen, source, brought)
    return _evolved(folder, creature, chosen, quiet)


def _evolved(folder: Path, creature: Creature, config: Config, quiet: bool) -> Run:
    """The run in a new folder, evolved and examined."""
    from rich.console import Console

    from mjxgait.cluster.evolve import evolve
    from mjxgait.runs.devices import prepare_devices
    from mjxgait.runs.screen import Screen

    prepare_devices()
    evolve(folder, creature, config, Screen(Console(quiet=True)) if quiet else Screen())
    return Run(folder)


def open(folder: Place) -> Run:
    """A run that is there already.

    Raises:
      UserError: it is not a run folder.
    """
    run = Run(Path(folder))
    open_run(run.folder)
    return run


def examine(run: Run | Place, config: Place | None = None) -> Certificate:
    """Examines the champion of a run in C MuJoCo, criterion by criterion; writes nothing.

    Args:
      config: TOML file with other thresholds (configs/certificate/default.toml shows all).

    Raises:
      UserError: no run, no champion, or a bad file.
    """
    known = run if isinstance(run, Run) else open(run)
    table = read_toml(Path(config)) if config else {}
    champion = known.champion
    attempt = Exams(known.folder / EXAMS).attempt(
        champion.fingerprint, int(champion.origin.get("generation", 0))
    )
    return certify(
        known.creature, champion, build(CertificateConfig, table, str(config)), attempts=attempt
    )


def walk(run: Run | Place, seconds: float = 12.0) -> dict[str, np.ndarray]:
    """The champion's undisturbed motion in C MuJoCo, as columns [T] for pandas or a plot.

    `time` s; `trunk_x`, `trunk_y`, `trunk_z` m, forward, left and up from the start; `pitch`,
    `roll` rad; per joint `pos_NAME` rad, `vel_NAME` rad/s, `torque_NAME` N·m; per foot
    `height_NAME` m, `force_NAME` N. It ends soon after a fall.

    Raises:
      UserError: no run or no champion.
    """
    from mjxgait.viewing.walk import record_walk

    known = run if isinstance(run, Run) else open(run)
    if not seconds > 0:
        raise UserError(f"seconds = {seconds}: must be more than zero")
    creature = known.creature
    seen = record_walk(creature, known.champion, seconds).recording
    columns = {"time": np.arange(len(seen.pitch)) * seen.time_step}
    columns |= {f"trunk_{axis}": seen.trunk_pos[:, i] for i, axis in enumerate("xyz")}
    columns |= {"pitch": seen.pitch, "roll": seen.roll}
    joints = {"pos": seen.joint_pos, "vel": seen.joint_vel, "torque": seen.torque}
    feet = {"height": seen.foot_height, "force": seen.foot_force}
    for names, values in ((creature.joints.names, joints), (creature.feet.names, feet)):
        columns |= {
            f"{what}_{name}": array[:, i]
            for what, array in values.items()
            for i, name in enumerate(names)
        }
    return columns


def _use(**named: str | None) -> dict[str, str]:
    """Who takes part, the user's own code loaded."""
    given = {kind: text for kind, text in named.items() if text is not None}
    if not given:
        return {}
    from mjxgait.parts.own import load

    return {kind: load(kind, text) for kind, text in given.items()}
