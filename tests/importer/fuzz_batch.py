"""Runs a share of the hostile inputs: python -m importer.fuzz_batch SCRATCH SHARE SHARES.

Prints a line before and after each.
"""

import sys
import time
from pathlib import Path

from importer.fuzz_inputs import model_inputs, own_xml_inputs, toml_inputs
from importer.models import QUADRUPED

from mjxgait.config.layers import resolve_config
from mjxgait.creature import load_creature
from mjxgait.errors import UserError
from mjxgait.importer import ImportChoices, import_model, stance

stance.FIRST, stance.ROUNDS = 60, 4  # it is the files that are hostile, not the search


def main(scratch: Path, share: int, shares: int) -> None:
    home, outside, folder = scratch / "home", scratch / "outside", scratch / "folder"
    for made in (home, folder):
        made.mkdir(parents=True, exist_ok=True)
    (home / "link.stl").symlink_to(outside / "secret.stl")
    good = home / "good.xml"
    good.write_text(QUADRUPED)
    creature = import_model(good, ImportChoices(apart=False)).files
    inputs = [
        *model_inputs(),
        *toml_inputs(creature["creature.toml"]),
        *own_xml_inputs(creature["creature.xml"]),
    ]
    _forbid(outside)
    for name, kind, data in inputs[share::shares]:
        print("start", name, flush=True)
        began = time.perf_counter()
        data = data.replace(b"{outside}", str(outside).encode())
        try:
            if kind in ("toml", "own"):
                files = {
                    **{n: t.encode() for n, t in creature.items()},
                    "creature.toml" if kind == "toml" else "creature.xml": data,
                }
                for file, text in files.items():
                    (folder / file).write_bytes(text)
                made = load_creature(folder)
                resolve_config(made.settings.train, made.name)
                outcome = "creature"
            else:
                (home / f"model.{kind}").write_bytes(data)
                imported = import_model(home / f"model.{kind}", ImportChoices(apart=False))
                for file, text in imported.files.items():
                    (folder / file).write_text(text)
                load_creature(folder)
                outcome = "creature"
        except UserError as error:
            outcome = (
                "error"
                if str(error) and "\n" not in str(error) and len(str(error)) < 25_000
                else f"badly said: {str(error)[:200]!r}"
            )
        print("end", name, f"{time.perf_counter() - began:.2f}", outcome, flush=True)


def _forbid(outside: Path) -> None:
    """Any opening of a file in a folder, by Python, ends the process."""

    def hook(event: str, arguments: tuple) -> None:
        if (
            event == "open"
            and isinstance(arguments[0], str | bytes)
            and str(outside) in str(arguments[0])
        ):
            print("read outside:", arguments[0], flush=True)
            raise SystemExit(9)
        if event in ("os.system", "subprocess.Popen", "os.exec", "os.posix_spawn"):
            print("ran a program:", arguments[:2], flush=True)
            raise SystemExit(9)

    sys.addaudithook(hook)


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3]))
