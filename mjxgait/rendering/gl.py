"""Pictures by MuJoCo's own renderer, on request, if GL works; a separate process tests that."""

import subprocess
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from mjxgait.errors import UserError
from mjxgait.processes import python_command
from mjxgait.rendering.floor import band_lines
from mjxgait.rendering.gl_probe import OFF, candidates, environment_of
from mjxgait.rendering.painter import lamp_direction
from mjxgait.rendering.stage import Stage
from mjxgait.rendering.surroundings import BANDS, write_marks

WORKER = "mjxgait.rendering.gl_worker"
GROUND_CELL = 0.08
"""Cell of the height field for uneven ground, in hip heights."""
PATIENCE = 60.0
"""Longest time for a first picture, s."""


def working_backend(stage: Stage, wanted: str | None = None) -> tuple[str | None, str]:
    """Return the GL backend that can draw this scene, and words on it; or None, and the reason.

    Args:
      wanted: the value of MUJOCO_GL: the only backend to try, or one of `OFF`.
    """
    if wanted and wanted.lower() in OFF:
        return None, f"MUJOCO_GL={wanted} forbids it"
    if not stage.alike:
        return None, "it draws several creatures of one kind only"
    reasons = []
    for backend in candidates(wanted):
        with tempfile.TemporaryDirectory() as folder:
            try:
                done = subprocess.run(
                    _command(stage, [0], Path(folder)),
                    env=environment_of(backend),
                    capture_output=True,
                    timeout=PATIENCE,
                )
            except subprocess.TimeoutExpired:
                reasons.append(f"{backend}: no picture in {PATIENCE:g} s")
                continue
        if (
            done.returncode == 0
            and len(done.stdout) == 3 * stage.width * stage.height
            and any(done.stdout)
        ):
            return backend, f"drawn by MuJoCo with {backend}"
        lines = done.stderr.decode(errors="replace").strip().splitlines()
        reasons.append(
            f"{backend}: {lines[-1][:100] if lines else f'ended with code {done.returncode}'}"
        )
    return None, f"it does not work here ({'; '.join(reasons)})"


def gl_pictures(stage: Stage, frames: Sequence[int], backend: str) -> Iterator[Image.Image]:
    """Draw these frames.

    Raises:
      UserError: the renderer stopped half way.
    """
    with tempfile.TemporaryDirectory() as folder:
        command = _command(stage, frames, Path(folder))
        worker = subprocess.Popen(
            command, env=environment_of(backend), stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
        )
        assert worker.stdout is not None
        try:
            for frame in frames:
                raw = worker.stdout.read(3 * stage.width * stage.height)
                if len(raw) < 3 * stage.width * stage.height:
                    raise UserError(
                        f"the GL renderer ({backend}) stopped in the middle; leave --renderer out"
                    )
                picture = Image.frombytes("RGB", (stage.width, stage.height), raw)
                camera = stage.camera(frame)
                write_marks(picture, camera, stage.origin, stage.relief, stage.around)
                yield picture
        finally:
            worker.kill()
            worker.wait()
            worker.stdout.close()


def scene_file(stage: Stage, frames: Sequence[int], path: Path) -> None:
    """Write the worker's input: poses [F, N, nq] with each creature in its lane, and the camera of
    every frame.
    """
    walk = stage.participants[0].walk
    spec, creature = walk.source, walk.creature
    cameras = [stage.camera(frame) for frame in frames]
    first = cameras[0]
    into = first.axes[2]
    times = [frame * stage.time_step for frame in frames]
    poses = np.array([stage.root_poses(time) for time in times])
    numbers = {
        int(n) for camera in (first, cameras[-1]) for n in band_lines(camera, stage.origin)[0]
    }
    step = band_lines(first, stage.origin)[1]
    plain = stage.relief is not None or stage.around.water
    dark = [n for n in range(min(numbers), max(numbers)) if n % 2 and not plain]
    np.savez(
        path,
        xml=np.array(spec.to_xml() if spec else creature.files["creature.xml"]),
        size=np.array([stage.width, stage.height]),
        extent=np.array(stage.height / first.scale),
        view=np.array(
            [
                np.degrees(np.arctan2(into[1], into[0])),
                -np.degrees(first.elevation),
                20 * creature.frame.body_length,
            ]
        ),
        centre=np.array([camera.centre for camera in cameras]),
        qpos=poses,
        bands=np.array([stage.origin + (n + 0.5) * step * stage.forward for n in dark]),
        band_width=np.array(step),
        forward=stage.forward,
        lamp=lamp_direction(stage.forward),
        water=np.array(stage.around.water),
        angles=np.array([first.scale, first.azimuth, first.elevation]),
        tint=np.array(stage.around.bands) / np.array(BANDS),
        **_ground(stage),
    )


def _ground(stage: Stage) -> dict[str, Any]:
    """Uneven ground as a height field around the visible area; empty for the plane.

    heights: [rows, columns] m, rows to the left. ground_at: [2] m, its middle. ground_half: [2] m,
    half its size.
    """
    if stage.relief is None:
        return {}
    room = 2.5 * stage.width / stage.camera(0).scale
    hip_height = stage.participants[0].walk.creature.frame.hip_height
    cell, lanes = GROUND_CELL * hip_height, stage.lanes @ stage.left
    ahead = np.arange(stage.way[:, 0].min() - room, stage.way[:, 0].max() + room, cell)
    aside = stage.way[:, 1]
    left = np.arange(aside.min() + lanes.min() - room, aside.max() + lanes.max() + 2 * room, cell)
    x, y = (
        stage.origin[i] + ahead[None, :] * stage.forward[i] + left[:, None] * stage.left[i]
        for i in range(2)
    )
    middle = (ahead[0] + ahead[-1]) / 2 * stage.forward + (left[0] + left[-1]) / 2 * stage.left[:2]
    return {
        "heights": stage.relief(x, y),
        "ground_at": stage.origin + middle,
        "ground_half": np.array([np.ptp(ahead), np.ptp(left)]) / 2,
    }


def _command(stage: Stage, frames: Sequence[int], folder: Path) -> list[str]:
    path = folder / "scene.npz"
    scene_file(stage, frames, path)
    return python_command(WORKER, str(path))
