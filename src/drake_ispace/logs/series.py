"""Columns of numbers from log files: CSV of any shape, Parquet, TUM trajectories."""

import csv
import io
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from drake_ispace.blocks.errors import InputError, expected_one_of, shown
from drake_ispace.files.recording_tables import LARGEST_TABLE

TUM = ("t", "x", "y", "z", "qx", "qy", "qz", "qw")
_DELIMITERS = (",", ";", "\t", "|", " ")
_BLOCK_ROWS = 1 << 16  # that are kept as Python's numbers at once


@dataclass(frozen=True)
class Series:
    """Columns of equal length from one log.

    Attributes:
        columns: name -> (rows,) numbers, NaN where a row has none.
    """

    columns: dict[str, np.ndarray]

    def __len__(self) -> int:
        return len(next(iter(self.columns.values())))


@dataclass(frozen=True)
class Shape:
    """How a text file holds its numbers.

    Attributes:
        delimiter: between cells; a blank stands for any white space. decimal: "." or ",". header: names of the columns,
            empty if the file has none. first: number of the first line of numbers, from 0.
    """

    delimiter: str
    decimal: str
    header: tuple[str, ...]
    first: int


def shape_of(file: Path, delimiter: str | None = None, decimal: str | None = None) -> Shape:
    """What the first lines of a text file say of its shape; what is given is not guessed.

    Raises:
        InputError: no such file, or no text.
    """
    lines = _first_lines(file)
    rows = [line for line in lines if line.strip() and not line.lstrip().startswith(("#", "%"))]
    if not rows:
        raise InputError(f"{file}: holds no rows, expected a table")
    try:
        return _shape(lines, rows, delimiter, decimal)
    except csv.Error as error:
        raise InputError(f"{file}: {error}, expected a table") from None


def _shape(lines, rows, delimiter, decimal):
    delimiter = delimiter or max(_DELIMITERS, key=lambda mark: _evenness(rows, mark))
    if decimal is None:
        cells = [cell for row in rows[1:] for cell in _cells(row, delimiter)]
        decimal = "," if delimiter != "," and any("," in cell for cell in cells) else "."
    has_header = not all(_is_number(cell, decimal) for cell in _cells(rows[0], delimiter) if not _is_empty(cell))
    header = tuple(cell.strip().strip('"') for cell in _cells(rows[0], delimiter)) if has_header else ()
    return Shape(delimiter, decimal, header, lines.index(rows[0]) + has_header)


def read_series(
    file: Path, wanted: Iterable[str] | None = None, shape: Shape | None = None,
    tell: Callable[[int], None] = lambda read: None,
) -> Series:
    """The columns of a table; a file without a header has columns "1", "2", ..., one of a TUM trajectory those of TUM.

    Args:
        wanted: names of columns, all if None. shape: of a text file, guessed if None. tell: called with the bytes read.

    Raises:
        InputError: what is wrong with the file, or that it has no such column.
    """
    if not file.is_file():
        raise InputError(f"{file}: expected a file, there is none")
    if file.suffix == ".parquet":
        return _parquet(file, wanted)
    shape = shape or shape_of(file)
    return _text(file, shape.header or (TUM if file.suffix == ".tum" else ()), shape, wanted, tell)


def numeric_columns(file: Path, shape: Shape) -> list[str]:
    """The names of a text file's columns that hold nothing but numbers and cells without a sample.

    Raises:
        InputError: as `read_series`.
    """
    good = dict(enumerate(shape.header))
    for _, cells, _ in _rows(file, shape):
        good = {
            i: name for i, name in good.items()
            if i < len(cells) and (_is_empty(cells[i]) or _is_number(cells[i], shape.decimal))
        }
    return list(good.values())


def unwrapped(numbers: np.ndarray, wraps_at: float) -> np.ndarray:
    """A counter (n,) that starts again after `wraps_at`, as if it went on."""
    turns = np.round(np.diff(numbers) / wraps_at)
    return numbers - wraps_at * np.concatenate([[0.0], np.cumsum(turns)])


def _parquet(file, wanted):
    import pyarrow
    from pyarrow import parquet

    try:
        with parquet.ParquetFile(file, page_checksum_verification=True) as table:
            names, rows = table.schema_arrow.names, table.metadata.num_rows
            chosen = list(names if wanted is None else dict.fromkeys(wanted))
            _check_names(chosen, names, file)
            if not 0 < rows * max(len(chosen), 1) <= LARGEST_TABLE:
                raise InputError(f"{file}: {rows} rows, expected between 1 and {LARGEST_TABLE // max(len(chosen), 1)}")
            columns = table.read(columns=chosen)
    except (pyarrow.ArrowException, OSError, UnicodeError) as error:
        raise InputError(f"{file}: expected a whole Parquet file, but {shown(str(error), 120)}") from None
    return Series({name: _numbers(columns[name], f"{file}: column {shown(name)}") for name in chosen})


def _text(file, names, shape, wanted, tell):
    """Rows in blocks, so that a large file never stands in memory as text."""
    columns: list[np.ndarray] = []
    chosen, indices, width = [], [], 0
    for number, cells, position in _rows(file, shape):
        if not width:
            width = len(names) or len(cells)
            names = names or tuple(str(i + 1) for i in range(width))
            chosen = list(names if wanted is None else dict.fromkeys(wanted))
            _check_names(chosen, names, file)
            indices, block = [names.index(name) for name in chosen], []
        if len(cells) != width:
            raise InputError(f"{file}: line {number}: {len(cells)} cells, expected {width}")
        block.append([_number(cells[i], shape.decimal, file, number, names[i]) for i in indices])
        if len(block) == _BLOCK_ROWS:
            columns.append(np.array(block))
            block = []
            tell(position)
    if not width:
        raise InputError(f"{file}: no row of numbers, expected at least one")
    values = np.vstack([*columns, *([np.array(block)] if block else [])])
    return Series({name: values[:, i] for i, name in enumerate(chosen)})


def _rows(file, shape):
    """(number of the line, cells, bytes read so far) of every row of numbers."""
    position = 0
    try:
        with file.open("rb") as stream:
            for index, raw in enumerate(stream):
                position += len(raw)
                if len(raw) > 1 << 20:
                    raise InputError(f"{file}: line {index + 1}: longer than a megabyte, expected a table")
                line = raw.decode("utf-8-sig" if index == 0 else "utf-8").rstrip("\r\n")
                if index < shape.first or not line.strip() or line.lstrip().startswith(("#", "%")):
                    continue
                try:
                    yield index + 1, _cells(line, shape.delimiter), position
                except csv.Error as error:
                    raise InputError(f"{file}: line {index + 1}: {error}, expected cells of a table") from None
    except UnicodeDecodeError:
        raise InputError(f"{file}: line {index + 1}: is no UTF-8, expected a text file") from None
    except OSError as error:
        raise InputError(f"{file}: cannot be read ({error.strerror or error})") from None


def _cells(line, delimiter):
    if delimiter == " ":
        return line.split()
    if '"' in line:
        return next(csv.reader(io.StringIO(line), delimiter=delimiter))
    return line.split(delimiter)


def _number(cell, decimal, file, number, name):
    text = cell.strip(" \t")
    if _is_empty(text):
        return np.nan
    value = _value(text, decimal)
    if value is None:
        raise InputError(f"{file}: line {number}: column {shown(name)} holds {shown(text)}, expected a number")
    return value


def _value(text, decimal):
    """The finite number in a cell, None if there is none."""
    if decimal == ",":
        text = text.replace(".", "_").replace(",", ".")
    if not text.isascii() or "_" in text:
        return None
    try:
        value = float(text)
    except ValueError:
        return None
    return value if np.isfinite(value) else None


def _is_empty(cell):
    """Whether a cell says that there was no sample."""
    return cell.strip(" \t").lower() in ("", "nan")


def _is_number(cell, decimal):
    return _value(cell.strip(" \t"), decimal) is not None


def _evenness(rows, mark):
    """How well a mark parts the first rows into cells: how many have as many as most have, and how many that is."""
    counts = [len(_cells(row, mark)) for row in rows]
    usual = max(set(counts), key=counts.count)
    return (counts.count(usual) if usual > 1 else 0, usual if mark != "," else usual - 0.5)


def _first_lines(file):
    if not file.is_file():
        raise InputError(f"{file}: expected a file, there is none")
    try:
        with file.open("rb") as stream:
            start = stream.read(1 << 16)
    except OSError as error:
        raise InputError(f"{file}: cannot be read ({error.strerror or error})") from None
    if b"\0" in start:
        raise InputError(f"{file}: is no text, expected a table, a .parquet, .mcap or .bag file")
    try:
        lines = start.decode("utf-8-sig", errors="ignore" if len(start) == 1 << 16 else "strict").splitlines()
    except UnicodeDecodeError:
        raise InputError(f"{file}: is no UTF-8, expected a text file") from None
    return lines[:200] if len(start) < 1 << 16 else lines[:-1][:200]


def _numbers(column, where):
    """(rows,) floats of an Arrow column, NaN where it is null."""
    import pyarrow

    try:
        values = column.cast(pyarrow.float64(), safe=False).to_numpy(zero_copy_only=False)
    except pyarrow.ArrowException:
        raise InputError(f"{where}: holds {column.type}, expected numbers") from None
    if np.isinf(values).any():
        raise InputError(f"{where}: holds infinity, expected finite numbers")
    return np.asarray(values, dtype=float)


def _check_names(chosen, names, file):
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise InputError(f"{file}: column {shown(twice)} is there twice, expected each name once")
    for name in chosen:
        if name not in names:
            raise InputError(f"{file}: there is no column {shown(name)}, {expected_one_of(name, names)}")
