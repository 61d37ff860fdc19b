"""One HTML file in which MuJoCo's WebAssembly build simulates a champion, without any network."""

import base64
import gzip
import html
import re
from pathlib import Path

import mujoco
import numpy as np

from mjxgait.animation.export.bodies import build_bodies, shown_bodies
from mjxgait.certification import CertificateConfig
from mjxgait.creature import Creature
from mjxgait.creature.geometry import posed
from mjxgait.rendering.painter import seen_geoms
from mjxgait.rendering.walk import doubt, record_walk
from mjxgait.training.folder import open_champion
from mjxgait.web.facts import ROUGHEST, Facts, facts_of
from mjxgait.web.page import save_page
from mjxgait.web.templates import asset, embedded, embedded_json, style, template, viewer_script
from mjxgait.web.wasm import PACKAGE, VERSION, Engine, engine_from

SECONDS = 5.0
"""s of the champion's walk that are simulated for the notice on its certificate."""
MODULES = (
    "vectors.js",
    "key_poses.js",
    "expressions.js",
    "network.js",
    "brain.js",
    "water.js",
    "ground.js",
    "senses.js",
    "motors.js",
    "hand.js",
    "simulation.js",
    "view.js",
)
"""Modules of the page's own script, `physics.js`; each comes after those that it imports."""
IMPORT = re.compile(r'^import (\{[^}]*\}) from "\./\w+\.js";$', re.MULTILINE)
EXPORTED = re.compile(r"^export (?:class|const|function) (\w+)", re.MULTILINE)
WIDE, FARTHEST = np.radians(30.0), 3.0
"""Camera's field of view in rad, and its largest distance in units of the first, from which it
shows all of the creature.
"""
PUSH = 2.0
"""Size of a visitor's push over that of the certificate."""
EXPORT = "export default loadMujoco;"
"""Last line of the engine's script, which an inline script needs otherwise."""


def write_physics_page(run: Path, out: Path, wasm: Path | None = None) -> str:
    """Write the page of a run's champion; return the notice of `doubt`.

    wasm: folder of MuJoCo's WebAssembly build; see `engine_from`.

    Raises:
      UserError: no run, no champion, one that a page cannot simulate, no WebAssembly build, or the
        file cannot be written.
    """
    creature, champion = open_champion(run)
    facts, walk = facts_of(creature, champion), record_walk(creature, champion, SECONDS)
    said = doubt(run, walk)
    page = build_physics_page(creature, facts, engine_from(wasm), walk.dressed, said)
    save_page(out, page)
    return said


LEAD = (
    "This is physics, not animation: MuJoCo runs in this page, and the evolved controller moves "
    "the "
    "joints."
)
CONTENTS = (
    f"MuJoCo {VERSION} (npm package {PACKAGE}, Google DeepMind) and model-viewer (Google), both "
    "under the Apache License 2.0; the creature and its controller, by mjxgait. The page asks for "
    "no "
    "other file and no network."
)


def build_physics_page(
    creature: Creature,
    facts: Facts,
    engine: Engine,
    shown: mujoco.MjModel | None = None,
    said: str = "",
) -> str:
    """Return the text of the page.

    shown: the creature's model with its looks, if it has others. said: the notice of `doubt`;
    empty if it is certified.
    """
    shown = shown or creature.model
    height, radius = _extent(shown, creature.stand_qpos)
    far = radius / np.sin(WIDE / 2)
    extent = float(creature.model.stat.extent)
    afloat = facts["water"] is not None
    glb, apart = build_bodies(creature, shown, afloat)
    speed = CertificateConfig().pushes.speed * PUSH
    page = {
        "bodies": shown_bodies(shown),
        "apart": apart,
        "extent": extent,
        "water": afloat,
        "push": speed * (creature.gravity * creature.frame.hip_height) ** 0.5,
    }
    lead = f"{LEAD} {said or 'Undisturbed, it is certified'}."
    script = engine.script.replace(EXPORT, "globalThis.loadMujoco = loadMujoco;")
    return template("physics.html").substitute(
        title=html.escape(creature.title),
        style=style(),
        lead=html.escape(lead),
        contents=html.escape(CONTENTS),
        licence=html.escape(asset("model-viewer.LICENSE")),
        glb=base64.b64encode(glb).decode("ascii"),
        target=f"0m {height:.3f}m 0m",
        wide=f"{np.degrees(WIDE):g}deg",
        far=f"{far:.3f}m",
        farthest=f"{FARTHEST * far:.3f}m",
        roughest=f"{100 * ROUGHEST:g}",
        facts=embedded_json(facts),
        page=embedded_json(page),
        # The same bytes on every day and machine.
        binary=base64.b64encode(gzip.compress(engine.binary, 6, mtime=0)).decode("ascii"),
        viewer=embedded(viewer_script()),
        engine=embedded(script),
        modules="\n".join(map(_module, MODULES)),
        code=asset("physics.js"),
    )


def _extent(model: mujoco.MjModel, qpos: np.ndarray) -> tuple[float, float]:
    """Height of a body's middle, and radius of a ball about it in which all of it is, in m."""
    data = posed(model, qpos)
    seen = [geom for geom in seen_geoms(model) if model.geom_bodyid[geom]]
    places, radii = data.geom_xpos[seen], model.geom_rbound[seen][:, None]
    low, high = (places - radii).min(0), (places + radii).max(0)
    return float((low + high)[2] / 2), float(np.linalg.norm(high - low) / 2)


def _module(name: str) -> str:
    """Script element with a module. In one file none can import another: the exports are global."""
    code = asset(name)
    exported = f"Object.assign(globalThis, {{ {', '.join(EXPORTED.findall(code))} }});"
    imported = IMPORT.sub(r"const \1 = globalThis;", code)
    return f'<script type="module">\n{imported}\n{exported}\n</script>'
