"""One HTML file that plays a walk in 3D on a double click, without any network request."""

import base64
import html
import json
import math
import string
from collections.abc import Iterable, Mapping, Sequence
from importlib import resources
from io import BytesIO
from pathlib import Path

from mjxgait import files
from mjxgait.animation.export import WalkLoop, build_driven, build_glb, viewpoint, walk_loop
from mjxgait.certification import (
    Verdict,
    criteria_of,
    outdated,
    read_certificate,
    read_stress,
    verdict_of,
)
from mjxgait.champion import Champion
from mjxgait.creature import Creature
from mjxgait.rendering.curves import Figures, draw_fitness, figure
from mjxgait.rendering.gaitplots import gait_figures
from mjxgait.rendering.video import LOOP_SECONDS
from mjxgait.rendering.walk import Walk, doubt, record_walk
from mjxgait.training.folder import CERTIFICATE, METRICS, STRESS, open_champion, read_metrics

RATE = 30
FARTHEST = 3.0
"""Largest distance to which a reader can move the camera, in units of the first."""
CHECK = (
    "This page proves nothing by itself. Whoever has the run folder can have the champion examined "
    "again: <code>mjxgait inspect RUN --verify</code> compares every measure with the certificate "
    "and ends with exit code 0 only if all are equal."
)
FAR = 1.7
"""Camera distance in units of the creature's size, or farther where a loop needs more room."""


def write_page(run: Path, out: Path) -> str:
    """Write the page of a run's champion; return the notice of `doubt`.

    Raises:
      UserError: no run, no champion, no steady stride, or the file cannot be written.
    """
    creature, champion = open_champion(run)
    walk = record_walk(creature, champion, LOOP_SECONDS)
    page = build_page(walk, walk_loop(walk, RATE), _sections(run, creature, champion, walk))
    save_page(out, page)
    return doubt(run, walk)


def save_page(out: Path, page: str) -> None:
    """Write a page.

    Raises:
      UserError: the file cannot be written.
    """
    with files.writing(out):
        files.write_text(out, page)


def viewer_script() -> str:
    """Return the viewer's script, ready to be embedded in a page."""
    script = resources.files("mjxgait.web") / "assets" / "model-viewer.min.js"
    # Browser tools would request the source map.
    text = script.read_text(encoding="utf-8").rsplit("//# sourceMappingURL", 1)[0]
    return text.replace("</script", "<\\/script")


def build_page(walk: Walk, loop: WalkLoop, sections: str) -> str:
    """Return the text of the page. sections: HTML below the walk."""
    web = resources.files("mjxgait.web") / "assets"
    target, far = viewpoint(loop, FAR)
    stride = loop.times[-1] / loop.strides
    lead = (
        f"{loop.speed:.2f} m/s, {loop.speed / walk.creature.frame.body_length:.2f} body lengths per "
        f"second; a stride takes {stride:.2f} s and leads {loop.advance / loop.strides:.2f} m "
        "forward."
    )
    return string.Template((web / "page.html").read_text(encoding="utf-8")).substitute(
        title=html.escape(walk.creature.name.replace("_", " ")),
        lead=html.escape(lead),
        glb=base64.b64encode(build_glb(loop, floor=True)).decode("ascii"),
        target=" ".join(f"{place:.3f}m" for place in target),
        far=f"{far:.3f}m",
        farthest=f"{FARTHEST * far:.3f}m",
        frames=len(loop.times) - 1,
        viewer=viewer_script(),
        sections=sections,
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


def certificate_table(run: Path, creature: Creature, champion: Champion) -> str:
    """Return the criteria as a table, or the reason why there is none."""
    document = read_certificate(run / CERTIFICATE)
    if document is None:
        return "<p>Not examined: <code>mjxgait certify</code> does it.</p>"
    if reason := outdated(document, champion, creature):
        return f"<p>{html.escape(reason)} <code>mjxgait certify</code> examines this one.</p>"
    rows = [
        [
            f"{c.number} {c.name}",
            m.name,
            _show(m.value),
            f"{m.sense} {m.threshold:g}",
            "pass" if m.passed else "fails",
        ]
        for c in criteria_of(document)
        for m in c.measures
    ]
    table = _table(("criterion", "measure", "value", "wanted", "verdict"), rows)
    said = html.escape(_said(verdict_of(document)))
    return f"<p>{said}</p>{table}{_anywhere(run, champion)}<p>{CHECK}</p>"


def _said(verdict: Verdict) -> str:
    """Verdict in one or two sentences."""
    said = "All criteria pass" if verdict.passed else "Not all criteria pass"
    if verdict.reservation:
        return f"Not certified. {said}, but {verdict.reservation}."
    return f"{said}."


def _anywhere(run: Path, champion: Champion) -> str:
    """Table of the stress tests; empty if the champion has not taken them."""
    document = read_stress(run / STRESS, champion)
    if document is None:
        return ""
    verdict = "It walks anywhere." if document["passed"] else "It does not walk anywhere."
    if document["reservation"]:
        verdict = f"It is not known to walk anywhere: {html.escape(document['reservation'])}."
    rows = [
        [t["name"], f"{t['share']:.0%}", "pass" if t["passed"] else "fails"]
        for t in document["trials"]
    ]
    return f"<p>{verdict}</p>" + _table(("stress test", "of the starts", "verdict"), rows)


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
    return _table((), rows)


def _table(heading: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    def cell(text: str) -> str:
        # Numbers align only in a table with a heading.
        kind = (
            ' class="fails"'
            if text == "fails"
            else ' class="number"'
            if heading and _is_number(text)
            else ""
        )
        return f"<td{kind}>{html.escape(text)}</td>"

    head = f"<tr>{''.join(f'<th>{html.escape(h)}</th>' for h in heading)}</tr>" if heading else ""
    body = "".join("<tr>" + "".join(map(cell, row)) + "</tr>" for row in rows)
    return f'<div class="wide"><table>{head}{body}</table></div>'


def _is_number(text: str) -> bool:
    try:
        return math.isfinite(float(text))
    except ValueError:
        return False


def _show(value: float) -> str:
    return "none" if math.isnan(value) else f"{value:.3g}"


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
    page = resources.files("mjxgait.web") / "assets" / "drive.html"
    return string.Template(page.read_text(encoding="utf-8")).substitute(
        title=html.escape(creature.name.replace("_", " ")),
        walks=len(clips) - 1,
        of=of,
        blends=html.escape(blends),
        clips=json.dumps([{key: clip[key] for key in KEPT} for clip in clips]),
        apart=apart,
        glb=base64.b64encode(glb).decode("ascii"),
        target=f"0m {0.6 * creature.frame.stand_pos[2]:.3f}m 0m",
        far=f"{DRIVE_FAR * creature.model.stat.extent:.3f}m",
        viewer=viewer_script(),
    )
