"""A run as a notebook shows it: its result, and its champion walking."""

import base64
import html
import tempfile
from pathlib import Path

from mjxgait.api.films import Film, write_film
from mjxgait.api.run import Run
from mjxgait.errors import UserError
from mjxgait.training.folder import CHAMPION

SIZE, SECONDS, FPS = (420, 240), 3.0, 15


def shown(run: Run) -> str:
    """Return HTML with the result and the walk of a run; drawing takes a few seconds."""
    place = html.escape(str(run.folder))
    if not (run.folder / CHAMPION).exists():
        return f"<p><code>{place}</code>: no champion yet</p>"
    verdict = "certified" if run.certified else "not certified"
    words = f"{html.escape(run.creature.name)}, {verdict}, fitness {run.champion.fitness:.3f}"
    return f"<p><code>{place}</code>: {words}</p>{_film(run)}"


def _film(run: Run) -> str:
    """Return the walk as an image; a sentence if it cannot be drawn."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "walk.webp"
        film = Film((run.folder,), file, seconds=SECONDS, fps=FPS, size=SIZE, renderer="painter")
        try:
            write_film(film, None, lambda said: None)
        except UserError as error:
            return f"<p>{html.escape(str(error))}</p>"
        data = base64.b64encode(file.read_bytes()).decode("ascii")
    return f'<img alt="the champion" src="data:image/webp;base64,{data}">'
