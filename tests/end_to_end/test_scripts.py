"""Every script and every benchmark, in its smallest form, succeeds."""

import importlib.util
import json
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import jax
import pytest
from end_to_end.shipped import BENCHMARKS, FEW_BLOCKS, ROOT, SCRIPTS, TINY, settled_soon
from end_to_end.walks import faller, short_examination, trained, walker
from helpers import STOOL

from mjxgait.animation.export.motion import export_motion
from mjxgait.processes import python_command
from mjxgait.rendering.walk import record_walk
from mjxgait.training import (
    checkpoint,
    examination,
    experiment,
    loop,
    stages,
)
from mjxgait.training import examination as looks
from mjxgait.training.folder import open_champion

BLENDER = "needs Blender as a module of Python"
RAY = "needs Ray; tests/distributed/test_ray.py runs what it measures, where Ray is installed"
ELSEWHERE = {
    "in_blender.py": BLENDER,
    "strip_in_blender.py": BLENDER,
    "rig_of_blender.py": BLENDER,
    "blender.py": BLENDER,
    "cluster.py": RAY,
    "cluster_faults.py": RAY,
    "speed.py": "tests/benchmarks/test_bench.py",
    "fuzz_readers.py": "needs atheris; tests/animation/keys/test_hostile_keys.py and "
    "tests/importer/test_fuzz.py change files too",
    "build_addons.py": "tests/addons/test_blender.py runs it in the checkout that has the add-ons",
    "plant_faults.py": "tests/test_faults.py runs it on a tree of its own",
}
"""Scripts not run here, and why."""

Given = Callable[[Path], list[str]]
STOOLS = ["--env", str(STOOL)]
COSTS = {
    "calls": {
        "ms of this process per piece, 100 bytes": 1.0,
        "ms of this process per piece, 1000000 bytes": 3.0,
        "µs per piece under way and look": 1.0,
        "ms there and back": 2.0,
        "bytes per genome": 100,
        "bytes per verdict": 100,
        "ms to put a row's state on disk": 10.0,
    },
    "rows": {"processor_s": {"one": [10.0, 12.0]}, "runs": 8, "generations": 4},
    "blocks": {"s of a processor per block": 1.0},
}


def on_paper(folder: Path) -> list[str]:
    (folder / "costs.json").write_text(json.dumps(COSTS))
    return ["costs.json"]


def played(folder: Path) -> list[str]:
    run = ROOT / "docs" / "data" / "walk"
    export_motion(record_walk(*open_champion(run), 1.0), folder / "motion.json")
    return [
        str(folder / "motion.json"),
        str(run / "creature" / "creature.xml"),
        "--seconds",
        "0.5",
    ]


FORMS: dict[str, Given] = {
    "animals.py": lambda to: [str(to / "animals")],
    "accelerator.py": lambda folder: [
        *(*STOOLS, "--out", "out", "--engines", "ours", "--lanes", "2"),
        *("--seconds", "0.1", "--passes", "0.1"),
    ],
    "blocks.py": lambda folder: ["--rounds", "1", "--links", "4"],
    "bodies.py": lambda folder: [*STOOLS, "--rounds", "1"],
    "cluster_paper.py": on_paper,
    "contacts.py": lambda folder: [*STOOLS, "--points", "4", "--rounds", "1"],
    "diversity.py": lambda folder: [
        str(trained(folder / "run", "--env", "blocks", *FEW_BLOCKS, *settled_soon("swim")))
    ],
    "tournament.py": lambda folder: [
        str(
            trained(
                folder / "run",
                "--env",
                "blocks",
                "--task",
                "compete",
                *FEW_BLOCKS,
                *settled_soon("compete"),
            )
        ),
        *("--generations", "1"),
    ],
    "every_creature.py": lambda folder: [*STOOLS, "--seeds", "7", "--out", "out", "--", *TINY],
    "ground.py": lambda folder: [*STOOLS, "--rounds", "1"],
    "imported.py": lambda folder: [
        *("--files", str(STOOL / "creature.xml"), "--out", "out", "--", *TINY)
    ],
    "inspect_seconds.py": lambda folder: [str(trained(folder / "run")), "--times", "1"],
    "interruptions.py": lambda folder: [
        *("--commands", "certify", "--kills", "1", "--stops", "0", "--no-conditions")
    ],
    "islands.py": lambda folder: [
        *("islands.json", *STOOLS, "--seeds", "2", "--population", "16"),
        *("--generations", "2", "--seconds", "0.3"),
    ],
    "keyed.py": lambda folder: [
        *("keyed", "--only", "short trot", "--population", "4", "--generations", "1")
    ],
    "ppo.py": lambda folder: [
        *(*STOOLS, "--out", "out", "--envs", "4", "--unroll", "2", "--minibatches", "1"),
        *("--hidden", "4", "--every", "1", "--iterations", "1"),
    ],
    "overlap.py": lambda folder: [str(walker(folder / "run"))],
    "raise.py": lambda folder: [str(faller(folder / "run")), "--starts", "4"],
    "rows.py": lambda folder: [
        *(*STOOLS, "--variants", "2", "--seeds", "1", "--generations", "1"),
        *("--population", "4", "--seconds", "0.3"),
    ],
    "stopwatch.py": lambda folder: ["parts.json", *STOOLS, *TINY, "--out", "run"],
    "time_to_walk.py": lambda folder: [
        *("--json", "times.json", *STOOLS, "--seeds", "1", "--", *TINY)
    ],
    "wishes.py": lambda folder: [
        *(*STOOLS, "--speeds", "0.25", "--gaits", "walk", "--json", "found.json", "--", *TINY)
    ],
    "ablate.py": lambda folder: ["null", "--dry-run"],
    "filmstrips.py": lambda folder: [str(certified(folder / "run"))],
    "inspect_checkpoint.py": lambda folder: [str(trained(folder / "run"))],
    "play_motion.py": played,
    "portraits.py": lambda folder: [str(walker(folder / "run"))],
    "store_walk.py": lambda folder: [str(ROOT / "docs" / "data" / "walk")],
    "train.py": lambda folder: [*STOOLS, *TINY, "--out", "run"],
}

LONG = (
    "accelerator.py",
    "blocks.py",
    "bodies.py",
    "contacts.py",
    "ground.py",
    "interruptions.py",
    "islands.py",
    "keyed.py",
    "ppo.py",
    "raise.py",
    "rows.py",
    "store_walk.py",
)


def certified(folder: Path) -> Path:
    """A run with a champion that treads on the spot, and its certificate."""
    run = walker(folder)
    given = ["certify", str(run), "--config", short_examination(folder.parent)]
    subprocess.run(python_command("mjxgait", *given), check=True)
    return run


@pytest.fixture
def as_it_was():
    """Undo a benchmark's changes to this process."""
    watched = (
        loop,
        stages,
        experiment,
        looks.Validation,
        examination.Examiner,
        checkpoint.Checkpoints,
    )
    before = [dict(vars(place)) for place in watched]
    cached, path = jax.config.jax_enable_compilation_cache, list(sys.path)
    yield
    jax.config.update("jax_enable_compilation_cache", cached)
    sys.path[:] = path
    for place, names in zip(watched, before, strict=True):
        for name, value in names.items():
            if vars(place)[name] is not value:
                setattr(place, name, value)


COMPILES = pytest.mark.thorough("compiles for up to half a minute; what it runs has own tests")


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=COMPILES) if n in LONG else n for n in FORMS]
)
def test_a_script_succeeds(name: str, tmp_path: Path, as_it_was, request):
    """In a copy of its folder, because some scripts write into `docs/` beside it."""
    if name == "store_walk.py":
        request.getfixturevalue("examined_in_full")
    where = "scripts" if name in SCRIPTS else "benchmarks"
    shutil.copytree(ROOT / where, tmp_path / where)
    (tmp_path / "tests").symlink_to(ROOT / "tests")
    (tmp_path / "docs" / "images").mkdir(parents=True)
    (tmp_path / "docs" / "research").mkdir()
    shutil.copy(ROOT / "docs/research/worked-example.md", tmp_path / "docs" / "research")
    given = [sys.executable, str(tmp_path / where / name), *FORMS[name](tmp_path)]
    done = subprocess.run(given, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout
    assert "Traceback" not in done.stdout


@pytest.mark.parametrize("name", ELSEWHERE)
def test_scripts_left_out_have_a_reason(name: str):
    if ELSEWHERE[name] is BLENDER and importlib.util.find_spec("bpy") is None:
        pytest.skip(BLENDER)
    if ELSEWHERE[name] is RAY and importlib.util.find_spec("ray") is None:
        pytest.skip(RAY)


def test_every_script_is_tested():
    assert FORMS.keys() | ELSEWHERE.keys() == {*BENCHMARKS, *SCRIPTS}
    assert not FORMS.keys() & ELSEWHERE.keys()
    assert not {*BENCHMARKS} & {*SCRIPTS}
