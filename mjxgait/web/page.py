"""One HTML file that plays a walk in 3D on a double click, without any network request."""

import base64
import html
import json
from collections.abc import Iterable, Mapping, Sequence
from io import BytesIO
from pathlib import Path

from mjxgait import files
from mjxgait.animation.export import WalkLoop, build_driven, build_glb, viewpoint, walk_loop
from mjxgait.champion import Champion
from mjxgait.creature import Creature
from mjxgait.rendering.curves import Figures, draw_fitness, figure
from mjxgait.rendering.gaitplots import gait_figures
from mjxgait.rendering.video import LOOP_SECONDS
from mjxgait.rendering.walk import Walk, doubt, record_walk
from mjxgait.training.folder import METRICS, open_champion
from mjxgait.training.logs import read_metrics
from mjxgait.web.certificate import certificate_summary, certificate_table, table
from mjxgait.web.templates import embedded, style, template, viewer_script

RATE = 30
FARTHEST = 3.0
"""Largest distance to which a reader can move the camera, in units of the first."""
SHADOW = 0.9
"""Darkness of the shadow."""


def write_page(run: Path, out: Path) -> str:
    """Write the page of a run's champion; return the notice of `doubt`.

    Raises:
      UserError: no run, no champion, no steady stride, or the file cannot be written.
    """
    creature, champion = open_champion(run)
    walk = record_walk(creature, champion, LOOP_SECONDS)
    verdict = certificate_summary(run, creature, champion, walk.fell)
    sections = _sections(run, creature, champion, walk)
    page = build_page(walk, walk_loop(walk, RATE), verdict, sections)
    save_page(out, page)
    return doubt(run, walk)


def save_page(out: Path, page: str) -> None:
    """Write a page.

    Raises:
      UserError: the file cannot be written.
    """
    with files.writing(out):
        files.write_text(out, page)


def build_page(walk: Walk, loop: WalkLoop, verdict: str, sections: str) -> str:
    """Return the text of the page. verdict, sections: HTML above and below the walk."""
    target, far = viewpoint(loop)
    return template("page.html").substitute(
        title=html.escape(walk.creature.title),
        style=style(),
        lead=html.escape(_lead(walk, loop)),
        around="water" if walk.afloat else "sand" if walk.grown else "",
        shadow=0.0 if walk.afloat else SHADOW,
        verdict=verdict,
        file=html.escape(f"{walk.creature.name}.glb"),
        glb=base64.b64encode(build_glb(loop, floor=True)).decode("ascii"),
        target=" ".join(f"{place:.3f}m" for place in target),
        far=f"{far:.3f}m",
        farthest=f"{FARTHEST * far:.3f}m",
        frames=len(loop.times) - 1,
        viewer=embedded(viewer_script()),
        sections=sections,
    )


def _lead(walk: Walk, loop: WalkLoop) -> str:
    """The motion in numbers."""
    if not loop.strides:
        return (
            f"A contest of {loop.times[-1]:.0f} s for the cube, which the page repeats. The "
            "champion is bright, its opponent dark."
        )
    seconds = loop.times[-1] / loop.strides
    if walk.grown:
        return (
            f"{loop.speed:.2f} m/s. The page repeats the {seconds:.1f} s after which the creature "
            "is most like it was."
        )
    return (
        f"{loop.speed:.2f} m/s, {loop.speed / walk.creature.frame.body_length:.2f} body lengths "
        f"per second; a stride takes {seconds:.2f} s and leads {loop.advance / loop.strides:.2f} m "
        "forward."
    )


def _sections(run: Path, creature: Creature, champion: Champion, walk: Walk) -> str:
    lines = read_metrics(run / METRICS)
    fitness: Figures = (
        {"fitness": ((8, 4.0), lambda drawing: draw_fitness(drawing.subplots(), lines))}
        if lines
        else {}
    )
    parts = ["<h2>The walk</h2>", *_images(gait_figures(walk), creature)]
    if fitness:
        parts += ["<h2>How it was learnt</h2>", *_images(fitness, creature)]
    parts += ["<h2>Certificate</h2>", certificate_table(run, creature, champion)]
    parts += ["<h2>Where it comes from</h2>", _origin(creature, champion)]
    return "\n".join(parts)


def _images(figures: Figures, creature: Creature) -> Iterable[str]:
    for name, (size, compose) in figures.items():
        with figure(size) as drawing:
            compose(drawing)
            file = BytesIO()
            drawing.savefig(file, format="svg", metadata={"Date": None})
        data = base64.b64encode(file.getvalue()).decode("ascii")
        alt = f"{html.escape(name)} of the {html.escape(creature.name)}"
        yield f'<div class="wide"><img alt="{alt}" src="data:image/svg+xml;base64,{data}"></div>'


def _origin(creature: Creature, champion: Champion) -> str:
    origin = champion.origin
    rows = [
        [
            "creature",
            f"{creature.name} (body {creature.digest}), {creature.frame.mass:.1f} kg, "
            f"{len(creature.joints.names)} joints",
        ],
        ["fitness", f"{champion.fitness:.3f}"],
        ["found in generation", str(origin.get("born", "unknown"))],
        ["seed", str(origin.get("seed", "unknown"))],
        [
            "versions",
            ", ".join(f"{name} {version}" for name, version in origin.get("versions", {}).items())
            or "unknown",
        ],
    ]
    return table((), rows)


DRIVE_FAR = 3.2
"""Camera distance in units of the creature's size."""
KEPT = ("name", "speed", "turn", "duration")


def driven_page(
    loops: Mapping[str, WalkLoop], clips: Sequence[Mapping[str, object]], of: int, blends: str
) -> str:
    """Return the text of the page.

    Args:
      loops: of one creature, by name; the first stands.
      clips: for each its name, `speed` in m/s, `turn` in deg/s and `duration` in s.
      of: number of walks requested.
      blends: physical validity of the blends, in words.
    """
    creature = next(iter(loops.values())).walk.creature
    glb, apart = build_driven(loops)
    return template("drive.html").substitute(
        title=html.escape(creature.title),
        style=style(),
        walks=len(clips) - 1,
        of=of,
        blends=html.escape(blends),
        clips=json.dumps([{key: clip[key] for key in KEPT} for clip in clips]),
        apart=apart,
        glb=base64.b64encode(glb).decode("ascii"),
        target=f"0m {0.6 * creature.frame.stand_pos[2]:.3f}m 0m",
        far=f"{DRIVE_FAR * creature.model.stat.extent:.3f}m",
        viewer=embedded(viewer_script()),
    )
