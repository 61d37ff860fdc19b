"""Files of named NumPy arrays, written atomically and read with a limit on their size."""

import io
import zipfile
import zlib
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from mjxgait.files import DamagedFile, read_bytes, write_bytes


def write_arrays(path: Path, arrays: Mapping[str, np.ndarray]) -> None:
    """Write arrays by name, compressed."""
    data = io.BytesIO()
    np.savez_compressed(data, allow_pickle=False, **arrays)
    write_bytes(path, data.getvalue())


def read_arrays(path: Path, most: int) -> dict[str, np.ndarray]:
    """Return the arrays of a file by name. most: limit on their size in bytes.

    Raises:
      UserError: see `files.read_bytes`; or the file is damaged, or its arrays are too large.
    """
    data = io.BytesIO(read_bytes(path, most))
    try:
        with zipfile.ZipFile(data) as packed:
            size = sum(entry.file_size for entry in packed.infolist())
        if size > most:
            raise ValueError(f"its arrays would take {size / 1e9:.1f} GB")
        with np.load(data, allow_pickle=False) as stored:
            return {name: stored[name] for name in stored.files}
    # NumPy and zipfile raise all of these for bytes that were changed.
    except (
        EOFError,
        KeyError,
        MemoryError,
        NotImplementedError,
        OSError,
        RuntimeError,
        SyntaxError,
        ValueError,
        zipfile.BadZipFile,
        zlib.error,
    ) as error:
        raise DamagedFile(f"{path}: damaged ({error})") from None
