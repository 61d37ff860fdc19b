"""Evolve a stable walk for any creature.

Give it a body and it returns a walk that holds up in physics, tested in a second simulator.

    import mjxgait

    run = mjxgait.train("tall_quadruped", seed=0, out="runs/x")
    run.certified, run.certificate["margin"], run.champion.genome["key_poses"]

    mjxgait.refine("crab", "walk.glb", keep=0.5).departure.words   # a hand-made cycle, made to walk

    run = mjxgait.train("duck", quiet=True, on_generation=lambda line: print(line["best"]))
    mjxgait.render(run, "walk.webp")      # also export, share, plot; `run` alone in a notebook
    mjxgait.build("runs/walker", "robot")   # a body of blocks as printed parts and servos
    mjxgait.gallery(["runs/x", "runs/y"], "all.html")    # several champions on one page
    mjxgait.repertoire("tall_quadruped"); mjxgait.ablate("forced_evolution")   # many runs
    mjxgait.walk(run)                     # columns for pandas: joints, feet, trunk over time
    mjxgait.examine(run)                  # the certificate again, criterion by criterion
    mjxgait.open("runs/x").metrics()      # fitness over generations
    mjxgait.frames(["runs/x", "runs/y"])  # the same of several runs, for pandas
    mjxgait.environment("duck")           # reset and step in JAX, for algorithms of your own
    mjxgait.import_model("my_dog.urdf", "envs/my_dog")   # a creature folder
    mjxgait.load_creature("my_dog.xml")   # a body: shipped, a folder, MJCF or URDF

On the command line: `mjxgait --help`.
"""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from mjxgait.api import (
        Run,
        UserError,
        ablate,
        build,
        certify,
        environment,
        examine,
        export,
        frames,
        gallery,
        import_model,
        load_creature,
        open,
        plot,
        refine,
        render,
        repertoire,
        share,
        train,
        walk,
    )

__version__ = "0.1.0"
__all__ = [
    "Run",
    "UserError",
    "ablate",
    "build",
    "certify",
    "environment",
    "examine",
    "export",
    "frames",
    "gallery",
    "import_model",
    "load_creature",
    "open",
    "plot",
    "refine",
    "render",
    "repertoire",
    "share",
    "train",
    "walk",
]


def __getattr__(name: str) -> object:
    """Import a public name on first use: the command line must not wait for it."""
    if name in __all__:
        from mjxgait import api as library

        return getattr(library, name)
    raise AttributeError(f"module 'mjxgait' has no attribute {name!r}")


def __dir__() -> list[str]:
    """List the public names too, for `help(mjxgait)` and completion, which read only this list."""
    return sorted({*globals(), *__all__})
