"""`mjxgait certify`: examine the champion of a run, or a handwritten program, in C MuJoCo."""

import dataclasses
from collections.abc import Sequence
from pathlib import Path

import tyro

from mjxgait.cli.options import parsed
from mjxgait.errors import UserError
from mjxgait.files import write_text
from mjxgait.training.disk import disk_errors, require_writable


@dataclasses.dataclass(frozen=True)
class CertifyOptions:
    """Test each criterion on the champion of a run (docs/reference/certificate.md).

    Writes RUN/certificate.json. The exit code is 0 if the examination ran, even if the champion
    fails.

    With --env and --expressions a handwritten program is examined instead
    (docs/reference/expressions.md). Then nothing is written without --out, and the exit code is 0
    if the program passes, else 1.

    Other thresholds than the shipped ones (--config) certify nothing: every command shows such a
    certificate as "by other rules", with the differences.

    Attributes:
      run: Run folder.
      env: With --expressions: name of a shipped creature, path of a creature folder, or a model
        file.
      expressions: File with the program: (list EXPRESSION ...), or lines JOINT = EXPRESSION.
      task: With --expressions: the task; by default the creature's usual one (hop for luxo).
      config: TOML file with other thresholds; configs/certificate/default.toml lists all.
      out: With --expressions: file for the certificate, which must not exist.
    """

    run: tyro.conf.Positional[Path | None] = None
    env: str | None = None
    expressions: Path | None = None
    task: str | None = None
    config: Path | None = None
    out: Path | None = None


def certify_command(arguments: Sequence[str]) -> int:
    """Return the exit code."""
    options = parsed(CertifyOptions, "certify", arguments)
    if options.expressions is not None:
        return _certify_expressions(options, options.expressions)
    if options.run is None or options.env or options.out:
        raise UserError(
            "name the run to examine: mjxgait certify RUN; --env and --out are for a program: "
            "mjxgait certify --env luxo --expressions FILE"
        )
    from mjxgait.api import certify  # JAX takes a second to import

    certificate = certify(options.run, options.config)
    from mjxgait.training.screen import Screen  # rich is slow to import

    Screen().certificate(certificate)
    return 0


def _certify_expressions(options: CertifyOptions, file: Path) -> int:
    """Return 0 if the program in the file passes, else 1."""
    if options.run is not None or options.env is None:
        raise UserError(
            f"--expressions {file}: name the creature and no run: mjxgait certify --env luxo "
            "--expressions FILE"
        )
    if options.out is not None:
        if options.out.exists():
            raise UserError(f"--out {options.out}: exists already; name another file")
        require_writable(options.out)
    from mjxgait.api import examine_expressions

    certificate = examine_expressions(options.env, file, options.task, options.config)
    from mjxgait.training.screen import Screen

    if options.out is not None:
        with disk_errors(options.out, "nothing else was written", "examine again"):
            write_text(options.out, certificate.to_json())
    Screen().certificate(certificate)
    return 0 if certificate.passed else 1
