"""Read joint angles over time from a CSV or JSON file.

CSV: a line of names, then numbers; `time` in s, each other column a joint in rad, or in degrees if
its name ends with `_deg`. Columns of `mjxgait.walk` (`pos_NAME`) are accepted. JSON: `{"time":
[...], "unit": "deg", "joints": {"NAME": [...]}}`.
"""

import csv
from pathlib import Path

import numpy as np

from mjxgait import files
from mjxgait.animation.clips.clip import (
    AngleTrack,
    check_numbers,
    check_size,
    check_times,
    read_text,
)
from mjxgait.errors import UserError

DEGREES, OURS = "_deg", "pos_"


def read_csv(path: Path) -> AngleTrack:
    """Return the angles in a CSV file.

    Raises:
      UserError: names the line that cannot be read.
    """
    lines = [row for row in csv.reader(read_text(path).splitlines()) if row]
    names = [name.strip() for name in lines[0]] if lines else []
    if "time" not in names:
        raise UserError(f'{path}: its first line must name the columns, one of them "time"')
    check_size(path, len(names), len(lines) - 1)
    rows = []
    for number, row in enumerate(lines[1:], 2):
        try:
            rows.append([float(value) for value in row])
        except ValueError:
            raise UserError(f"{path}: line {number} has something that is no number") from None
        if len(row) != len(names):
            raise UserError(f"{path}: line {number} has {len(row)} values, not {len(names)}")
    table = dict(zip(names, np.array(rows).T, strict=True))
    times = table.pop("time")
    if any(name.startswith(OURS) for name in table):
        table = {n.removeprefix(OURS): v for n, v in table.items() if n.startswith(OURS)}
    named = {
        name.removesuffix(DEGREES): np.radians(values) if name.endswith(DEGREES) else values
        for name, values in table.items()
    }
    return _track(path, times, named)


def read_json(path: Path) -> AngleTrack:
    """Return the angles in a JSON file.

    Raises:
      UserError: says what it must hold.
    """
    try:
        document = files.read_json(path)
        unit = document.get("unit", "rad")
        times = np.array(document["time"], float)
        named = {str(n): np.array(v, float) for n, v in document["joints"].items()}
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        raise UserError(
            f'{path}: must hold {{"time": [...], "joints": {{"NAME": [...]}}}} with numbers'
        ) from None
    if unit not in ("rad", "deg"):
        raise UserError(f'{path}: unit = {unit!r}: must be "rad" or "deg"')
    if times.ndim != 1 or any(values.shape != times.shape for values in named.values()):
        raise UserError(f"{path}: each joint needs as many angles as there are times")
    factor = np.radians(1.0) if unit == "deg" else 1.0
    return _track(path, times, {name: factor * values for name, values in named.items()})


def _track(path: Path, times: np.ndarray, named: dict[str, np.ndarray]) -> AngleTrack:
    if not named:
        raise UserError(f"{path}: has no joint's angles")
    check_size(path, len(named), len(times))
    angles = np.stack(list(named.values()), 1)
    check_numbers(path, "an angle", angles)
    return AngleTrack(tuple(named), check_times(path, times), angles)
