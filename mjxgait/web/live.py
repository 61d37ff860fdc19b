"""Local page that shows a run as it learns: its best individuals side by side, and the fitness.

A separate process only reads the run folder, so it cannot disturb a training and works on a
finished run as well. The browser plays the animation; the only cost here is one short simulation
of each new individual that is shown.
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
from pathlib import Path
from socket import socket
from typing import Any

from mjxgait.errors import UserError
from mjxgait.training.folder import METRICS, open_run
from mjxgait.training.lock import running
from mjxgait.training.logs import read_metrics
from mjxgait.web.field import Field
from mjxgait.web.templates import asset, style, viewer_script

HERE = "127.0.0.1"
PORTS = range(8765, 8785)
SHARE = 0.04
"""Largest average share of one core for simulations while the run is being trained."""
PATIENCE = 1.0
"""Time between checks of the folder, s."""
CONNECTIONS, IDLE = 32, 10.0
"""Largest number of connections, and s after which an idle one is closed."""


@dataclasses.dataclass(frozen=True)
class Served:
    """Content of the page.

    version: grows with each new scene; 0 while there is none. scene: JSON; see `gallery.scene_of`.
    """

    version: int
    scene: bytes


class Watcher:
    """Observer of a run folder. trains: whether a training on this machine is known to write it."""

    def __init__(self, run: Path, trains: bool = False) -> None:
        """Open the run; raise UserError if it is not a run folder."""
        self.run, self.trains = run, trains
        self.creature, _ = open_run(run)
        self.field = Field(run, self.creature)
        self.shown = Served(0, b"")

    def look(self) -> float:
        """Simulate a new individual, if any; return the time in s to wait before the next check."""
        began = time.process_time()
        # Other commands report foreign files.
        with contextlib.suppress(UserError):
            if self.field.advance():
                scene = json.dumps(self.field.scene()).encode()
                self.shown = Served(self.shown.version + 1, scene)
        if self.trains or running(self.run):
            return max(PATIENCE, (time.process_time() - began) * (1 / SHARE - 1))
        return PATIENCE if self.field.idle else 0.0

    def follow(self, ended: Callable[[], bool]) -> None:
        """Check repeatedly until `ended` returns true."""
        while not ended():
            time.sleep(self.look())

    def state(self) -> dict[str, object]:
        """Return the state that the page requests every second."""
        what = self.field.what if self.shown.version else "waiting for the first generation"
        try:
            lines = read_metrics(self.run / METRICS)
        except UserError as error:
            lines, what = [], str(error)
        history = [
            {key: line.get(key) for key in ("generation", "best", "mean", "forced")}
            for line in lines
        ]
        name = self.creature.title
        return {"name": name, "what": what, "version": self.shown.version, "history": history}


def serve(
    run: Path,
    port: int | None = None,
    ready: Callable[[str], None] = print,
    wait: Callable[[], object] | None = None,
) -> None:
    """Show a run until interrupted, or until `wait` returns.

    Args:
      port: on this machine; by default the first free one.
      ready: called with the address.
      wait: returns when the training that writes the run has ended.

    Raises:
      UserError: not a run folder, or the port is taken.
    """
    watcher = Watcher(run, trains=wait is not None)
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


Request = socket | tuple[bytes, socket]
"""As `socketserver` has it; the second form is UDP's."""


class _Server(ThreadingHTTPServer):
    """A server with at most `CONNECTIONS` connections; it closes any further one at once."""

    daemon_threads = True

    def __init__(self, *given: Any) -> None:
        self._free = threading.BoundedSemaphore(CONNECTIONS)
        super().__init__(*given)

    def process_request(self, request: Request, client_address: object) -> None:
        """Answer in a new thread if one is free."""
        if self._free.acquire(blocking=False):
            super().process_request(request, client_address)
        else:
            self.shutdown_request(request)

    def process_request_thread(self, request: Request, client_address: object) -> None:
        """Answer, and release the thread."""
        try:
            super().process_request_thread(request, client_address)
        finally:
            self._free.release()

    def handle_error(self, request: Request, client_address: object) -> None:
        """Ignore a browser that disconnected or timed out."""
        if not isinstance(sys.exception(), OSError):
            super().handle_error(request, client_address)


def open_server(watcher: Watcher, port: int | None = None) -> ThreadingHTTPServer:
    """Return a server, bound to this machine alone.

    Raises:
      UserError: the port is taken, or none that a server may have.
    """

    class Handler(_Handler):
        follows = watcher

    if port is not None:
        if not 0 <= port <= 65535:
            raise UserError(f"--port {port}: give a number from 0, for any free one, to 65535")
        try:
            return _Server((HERE, port), Handler)
        except OSError as error:
            raise UserError(
                f"--port {port}: cannot be used ({error.strerror}); name another"
            ) from None
    for candidate in PORTS:
        try:
            return _Server((HERE, candidate), Handler)
        except OSError:
            continue
    raise UserError(
        f"ports {PORTS.start} to {PORTS.stop - 1}: taken by other programs; name a free one with "
        "--port"
    )


class _Handler(BaseHTTPRequestHandler):
    follows: Watcher
    timeout = IDLE

    def do_GET(self) -> None:
        # DNS rebinding: a foreign host name that resolves to this machine must get nothing.
        if self.headers.get("Host", "").rsplit(":", 1)[0] not in (HERE, "localhost"):
            self.send_error(HTTPStatus.FORBIDDEN)
            return
        match self.path.split("?")[0]:
            case "/":
                self._send(asset("live.html").encode(), "text/html; charset=utf-8")
            case "/viewer.js":
                self._send(viewer_script().encode(), "text/javascript")
            case "/style.css":
                self._send(style().encode(), "text/css; charset=utf-8")
            case "/school.js":
                self._send(asset("school.js").encode(), "text/javascript; charset=utf-8")
            case "/state.json":
                self._send(json.dumps(self.follows.state()).encode(), "application/json")
            case "/scene.json" if self.follows.shown.version:
                self._send(self.follows.shown.scene, "application/json")
            case _:
                self.send_error(HTTPStatus.NOT_FOUND)

    def _send(self, content: bytes, kind: str) -> None:
        self.send_response(HTTPStatus.OK)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(len(content)))
        self.send_header("Cache-Control", "no-store")
        self.end_headers()
        # The browser may have dropped this request for the next one.
        with contextlib.suppress(ConnectionError, TimeoutError):
            self.wfile.write(content)

    def log_message(self, format: str, *args: object) -> None:
        """Log nothing."""
