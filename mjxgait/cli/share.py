"""`mjxgait share`: one offline page with a run's champion, recorded or simulated, or a repertoire."""

import dataclasses
from collections.abc import Sequence
from pathlib import Path

import tyro

from mjxgait.errors import UserError


@dataclasses.dataclass(frozen=True)
class ShareOptions:
    """Write one HTML file with the 3D walk, the curves and the certificate.

    It plays by double click, without a network. The page of a repertoire is steered with arrow keys
    or a stick.

    Attributes:
      run: Run folder, or the folder of a repertoire.
      out: File to write, ending with .html.
      physics: A page that simulates the champion instead of playing its walk: pull it, push it, tilt
        the floor. For key poses and expressions. It contains MuJoCo's WebAssembly build, which npm
        fetches once.
      wasm: Folder of the unpacked npm package @mujoco/mujoco, instead of npm.
    """

    run: tyro.conf.Positional[Path]
    out: Path
    physics: bool = False
    wasm: Path | None = None


def share_command(arguments: Sequence[str]) -> int:
    """Return the exit code."""
    options = tyro.cli(ShareOptions, args=list(arguments), prog="mjxgait share")
    if options.out.suffix.lower() not in (".html", ".htm"):
        raise UserError(
            f'{options.out}: cannot write "{options.out.suffix}"; end the name with .html'
        )
    if options.wasm and not options.physics:
        raise UserError(
            "--wasm names what --physics puts into the page; add --physics, or leave it out"
        )
    from mjxgait.training.stored import require_writable

    require_writable(options.out)
    said = _write(options)
    print(f"{options.out} ({options.out.stat().st_size / 1024:,.0f} KiB)")
    if said:
        print(said)
    return 0


def _write(options: ShareOptions) -> str:
    """Write the page; return a notice for the screen, or nothing."""
    from mjxgait.experiments.repertoire.clips import write_driven
    from mjxgait.experiments.repertoire.grid import GRID
    from mjxgait.web.page import write_page
    from mjxgait.web.physics import write_physics_page

    repertoire = (options.run / GRID).is_file()
    if options.physics and repertoire:
        raise UserError(
            f"{options.run}: a repertoire, whose page plays animation; name one of its runs for "
            "--physics"
        )
    if options.physics:
        return write_physics_page(options.run, options.out, options.wasm)
    return (write_driven if repertoire else write_page)(options.run, options.out)
