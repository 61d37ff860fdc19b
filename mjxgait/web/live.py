"""A page on this machine that shows a run as it learns: the best so far walking, and the curve
growing.

It only reads the run folder, in a process of its own, so it cannot disturb a training and works on
a finished run as well. The browser plays the animation; all that costs time here is one short
simulation when the champion has changed.
"""

import contextlib
import dataclasses
import json
import os
import sys
import threading
import time
from collections.abc import Callable
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np

from mjxgait.animation.export import build_glb, walk_loop, walk_take
from mjxgait.errors import UserError
from mjxgait.rendering.walk import record_walk
from mjxgait.training.folder import (
    CHAMPION,
    METRICS,
    open_champion,
    open_run,
    read_metrics,
)

HERE = "127.0.0.1"
PORTS = range(8765, 8785)
SECONDS = 5.0
"""Of the walk that is shown."""
SHARE = 0.04
"""Of one core that looking at new champions may take on average."""
PATIENCE = 1.0
"""s between looks at the folder."""
CONNECTIONS, IDLE = 32, 10.0
"""Connections at once, and s after which one that neither asks nor takes an answer is closed."""


@dataclasses.dataclass(frozen=True)
class Shown:
    """What the page shows. version: grows with each new animation; 0 while there is none."""

    version: int
    what: str
    glb: bytes


class Watcher:
    """Follows a run folder."""

    def __init__(self, run: Path) -> None:
        """Raises UserError when it is not a run folder."""
        self.run = run
        self.creature, _ = open_run(run)
        self.shown = Shown(0, "waiting for the first generation", b"")
        self._seen = 0

    def look(self) -> float:
        """Takes a new champion in, if there is one; returns s to wait before the next look."""
        began = time.process_time()
        try:
            changed = (self.run / CHAMPION).stat().st_mtime_ns
        except FileNotFoundError:
            return PATIENCE
        if changed != self._seen:
            self._seen = changed
            # Half a file cannot be met with: it is replaced in one go. A foreign one is left to the
            # other commands to report.
            with contextlib.suppress(UserError):
                self.shown = self._shown()
        return max(PATIENCE, (time.process_time() - began) * (1 / SHARE - 1))

    def follow(self, ended: Callable[[], bool]) -> None:
        """Looks again and again."""
        while not ended():
            time.sleep(self.look())

    def state(self) -> dict[str, Any]:
        """What the page asks for every second."""
        what = self.shown.what
        try:
            lines = read_metrics(self.run / METRICS)
        except UserError as error:
            lines, what = [], str(error)
        history = [
            {key: line.get(key) for key in ("generation", "best", "mean", "forced")}
            for line in lines
        ]
        name = self.creature.name.replace("_", " ")
        return {"name": name, "what": what, "version": self.shown.version, "history": history}

    def _shown(self) -> Shown:
        creature, champion = open_champion(self.run)
        walk = record_walk(creature, champion, SECONDS)
        found = (
            f"generation {champion.origin.get('generation', '?')}, fitness {champion.fitness:.2f}"
        )
        try:
            if np.isfinite(walk.fell):
                loop, gait = walk_take(walk), f"falls after {walk.fell:.1f} s"
            else:
                loop = walk_loop(walk)
                gait = f"{loop.speed:.2f} m/s"
        except UserError:
            loop, gait = walk_take(walk), "completes no steady stride yet"
        return Shown(self.shown.version + 1, f"{found}: {gait}", build_glb(loop))


def serve(
    run: Path,
    port: int | None = None,
    ready: Callable[[str], None] = print,
    wait: Callable[[], object] | None = None,
) -> None:
    """Shows a run until interrupted, or until `wait` returns.

    Args:
      port: on this machine; by default the first free one.
      ready: is told the address.

    Raises:
      UserError: not a run folder, or the port is taken.
    """
    watcher = Watcher(run)
    if hasattr(os, "nice"):
        os.nice(5)
    server = open_server(watcher, port)
    ended = threading.Event()
    threading.Thread(target=watcher.follow, args=(ended.is_set,), daemon=True).start()
    if wait is not None:
        threading.Thread(target=_shut_after, args=(server, wait), daemon=True).start()
    ready(f"http://{HERE}:{server.server_port}")
    try:
        server.serve_forever()
    finally:
        ended.set()
        server.server_close()


def _shut_after(server: ThreadingHTTPServer, wait: Callable[[], object]) -> None:
    wait()
    server.shutdown()


class _Server(ThreadingHTTPServer):
    """A server that has so many connections at once; a further one is closed at once."""

    daemon_threads = True

    def __init__(self, *given: Any) -> None:
        self._free = threading.BoundedSemaphore(CONNECTIONS)
        super().__init__(*given)

    def process_request(self, request: Any, client_address: Any) -> None:
        """Answer in a thread of its own where there is one free."""
        if self._free.acquire(blocking=False):
            super().process_request(request, client_address)
        else:
            self.shutdown_request(request)

    def process_request_thread(self, request: Any, client_address: Any) -> None:
        """Answer, and give the thread back."""
        try:
            super().process_request_thread(request, client_address)
        finally:
            self._free.release()

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Say nothing of a browser that has gone or has waited too long."""
        if not isinstance(sys.exception(), OSError):
            super().handle_error(request, client_address)


def open_server(watcher: Watcher, port: int | None = None) -> ThreadingHTTPServer:
    """The server, bound to this machine alone.

    Raises:
      UserError: the port is taken.
    """

    class Handler(_Handler):
        follows = watcher

    for candidate in PORTS if port is None else [port]:
        try:
            return _Server((HERE, candidate), Handler)
        except OSError:
            continue
    raise UserError(
        f"port {port or f'{PORTS.start} to {PORTS.stop - 1}'}: taken by another program; name a "
        "free one with --port"
    )


class _Handler(BaseHTTPRequestHandler):
    follows: Watcher
    timeout = IDLE

    def do_GET(self) -> None:
        # A page from elsewhere whose name has been made to point here must get nothing.
        if self.headers.get("Host", "").rsplit(":", 1)[0] not in (HERE, "localhost"):
            self.send_error(HTTPStatus.FORBIDDEN)
            return
        web = resources.files("mjxgait.web") / "assets"
        match self.path.split("?")[0]:
            case "/":
                self._send((web / "live.html").read_bytes(), "text/html; charset=utf-8")
            case "/viewer.js":
                # Without the reference to a source map, which is not here.
                self._send(
                    (web / "model-viewer.min.js")
                    .read_bytes()
                    .rsplit(b"//# sourceMappingURL", 1)[0],
                    "text/javascript",
                )
            case "/state.json":
                self._send(json.dumps(self.follows.state()).encode(), "application/json")
            case "/walk.glb" if self.follows.shown.version:
                self._send(self.follows.shown.glb, "model/gltf-binary")
            case _:
                self.send_error(HTTPStatus.NOT_FOUND)

    def _send(self, content: bytes, kind: str) -> None:
        self.send_response(HTTPStatus.OK)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(len(content)))
        self.send_header("Cache-Control", "no-store")
        self.end_headers()
        # The browser may have gone on to the next one.
        with contextlib.suppress(ConnectionError, TimeoutError):
            self.wfile.write(content)

    def log_message(self, format: str, *args: Any) -> None:
        """Says nothing."""
