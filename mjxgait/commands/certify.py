"""`mjxgait certify`: examine the champion of a run in C MuJoCo."""

import dataclasses
from collections.abc import Sequence
from pathlib import Path

import tyro

from mjxgait.certify import CertificateConfig, certify
from mjxgait.champion import read_champion
from mjxgait.runs.exams import Exams
from mjxgait.runs.folder import CERTIFICATE, CHAMPION, EXAMS, open_run
from mjxgait.settings.tables import build, read_toml


@dataclasses.dataclass(frozen=True)
class CertifyOptions:
    """Examine the champion of a run: whether it truly walks, criterion by criterion
    (docs/certificate.md).

    Writes RUN/certificate.json. The exit code is 0 whether or not the champion passes, as long as
    it could be examined.

    Attributes:
      run: Run folder.
      config: TOML file with other thresholds; configs/certificate/default.toml shows all.
    """

    run: tyro.conf.Positional[Path]
    config: Path | None = None


def certify_command(arguments: Sequence[str]) -> int:
    """Returns the exit code."""
    options = tyro.cli(CertifyOptions, args=list(arguments), prog="mjxgait certify")
    creature, _ = open_run(options.run)
    champion = read_champion(options.run / CHAMPION, creature)
    config = (
        build(CertificateConfig, read_toml(options.config), str(options.config))
        if options.config
        else CertificateConfig()
    )
    from mjxgait.runs.screen import Screen  # rich is slow to import

    attempt = Exams(options.run / EXAMS).attempt(
        champion.fingerprint, int(champion.origin.get("generation", 0))
    )
    certificate = certify(creature, champion, config, attempts=attempt)
    (options.run / CERTIFICATE).write_text(certificate.to_json(), encoding="utf-8")
    Screen().certificate(certificate)
    return 0
