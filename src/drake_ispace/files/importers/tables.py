"""Tables of numbers as other programs write them: no fixed header, any separator."""

import math
from pathlib import Path

import numpy as np

from drake_ispace.blocks.errors import InputError, shown
from drake_ispace.files.recording import median_step

LARGEST_FILE = 1 << 28  # bytes


def read_lines(path: Path) -> list[str]:
    """The lines of a text file; InputError if there is none or it is not text."""
    try:
        if not path.is_file():  # also keeps us from waiting on a pipe
            raise InputError(f"{path}: expected a file, there is none")
        if path.stat().st_size > LARGEST_FILE:
            raise InputError(f"{path}: larger than {LARGEST_FILE} bytes, expected the table of one run")
        return path.read_bytes().decode("utf-8-sig").splitlines()
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from None
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: holds byte 0x{error.object[error.start]:02x}, expected UTF-8 text") from None


def parse_numbers(
    lines: list[str], path: Path, separator: str | None = None, columns: int | None = None
) -> np.ndarray:
    """Finite numbers (n, m) in the lines of the file `path`; blank lines and those that start with % are left out.

    `separator` None is any white space; m is `columns` or, if that is None, what the first row has. n > 0.
    """
    rows: list[list[float]] = []
    for number, line in enumerate(lines, start=1):
        if not line.strip() or line.startswith("%"):
            continue
        cells = line.split(separator)
        columns = columns or len(cells)
        if len(cells) != columns:
            raise InputError(f"{path}: line {number}: {len(cells)} cells, expected {columns}")
        rows.append(list(map(_number, cells)))
        for index, value in enumerate(rows[-1]):
            if not math.isfinite(value):
                place = f"{path}: line {number}: column {index + 1}"
                raise InputError(f"{place} holds {shown(cells[index].strip())}, expected a finite number")
    if not rows:
        raise InputError(f"{path}: no row of numbers, expected at least one")
    return np.array(rows)


def period_of(t: np.ndarray) -> float | None:
    """The median step of time stamps (n,) [s], to the microsecond; None of a single stamp or if it is not positive."""
    period = round(median_step(t), 6) if len(t) > 1 else 0.0
    return period if period > 0.0 else None


def _number(cell: str) -> float:
    """NaN where there is none."""
    try:
        return float(cell) if cell.isascii() and "_" not in cell else math.nan
    except ValueError:
        return math.nan
