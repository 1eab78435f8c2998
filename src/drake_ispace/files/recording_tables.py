"""One table of numbers in one file, CSV or Parquet: strict about what it reads, exact in what it writes."""

import csv
import hashlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from drake_ispace.blocks.errors import InputError, shown

LONGEST_LINE = 1 << 16  # bytes
BLOCK = 1 << 22  # bytes of CSV parsed at a time
_MOST_COMPRESSED = 250  # times that increasing times can be made smaller: at most 220 where tried, equal steps in zstd
LARGEST_TABLE = 50_000_000  # numbers; a damaged Parquet file of a few bytes can announce any size

_BYTE_ORDER_MARK = b"\xef\xbb\xbf"
_MARKS_OF_OTHER_ENCODINGS = (b"\xff\xfe", b"\xfe\xff", b"\x00\x00\xfe\xff")


@dataclass(frozen=True, eq=False)
class Table:
    """`values` (n, k) under `names` (k,), `t` first; `place(i)` says where sample `i` stands in the file."""

    names: tuple[str, ...]
    values: np.ndarray
    place: Callable[[int], str]


def read_table(path: Path) -> Table:
    """The numbers in `path`, a `.csv` or `.parquet` file; whatever is not a table of numbers is an InputError."""
    readers = {".csv": _read_csv, ".parquet": _read_parquet}
    reader = readers.get(path.suffix.lower())
    if reader is None:
        raise InputError(f"{path}: file name ends in {shown(path.suffix)}, expected .csv or .parquet")
    try:
        if not path.is_file():  # also keeps us from waiting on a pipe
            raise InputError(f"{path}: expected a file, there is none")
        return reader(path)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from None


def sha256_of(path: Path) -> str:
    """The SHA-256 of a file, in hexadecimal."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


def check_sum(path: Path, expected: object, where: str) -> None:
    """Refuses a file that is not the one that was written.

    expected: its SHA-256, None where nobody noted it. where: the field that holds it, for the message.
    """
    if expected is None or not path.is_file():  # of a missing file the reader tells
        return
    try:
        found = sha256_of(path)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from None
    if found != expected:
        raise InputError(
            f"{path}: its SHA-256 is {found[:12]}..., expected {shown(expected, 12)} as {where} says: the file is "
            "damaged, or was changed (then take the line out)"
        )


def write_table(path: Path, names: tuple[str, ...], values: np.ndarray) -> None:
    """Writes float64 `values` (n, k) under `names` (k,), so that they read back bit for bit."""
    if path.suffix == ".parquet":
        import pyarrow as pa
        import pyarrow.parquet as parquet

        columns = [np.ascontiguousarray(column) for column in values.T]
        parquet.write_table(pa.table(columns, names=list(names)), path, write_page_checksum=True)
        return
    with open(path, "w", encoding="utf-8", newline="\n") as file:
        file.write(",".join(names) + "\n")
        file.writelines(",".join(map(repr, row)) + "\n" for row in values.tolist())


def _read_csv(path: Path) -> Table:
    with open(path, "rb") as file:
        names = _csv_header(file.readline(LONGEST_LINE + 1), path)
        blocks, line = [], 2
        while block := file.read(BLOCK):
            rest = file.readline(LONGEST_LINE + 1)
            if len(rest) > LONGEST_LINE:
                line += block.count(b"\n")
                raise InputError(f"{path}: line {line}: {_too_long(names)}")
            blocks.append(_parse(block + rest, names, path, line))
            line += (block + rest).count(b"\n")
    values = np.concatenate(blocks) if blocks else np.empty((0, len(names)))
    if len(values) == 0:
        raise InputError(f"{path}: line 1 is a header without rows, expected at least one (else leave the channel out)")
    return Table(names, values, lambda sample: f"line {_line_of(path, sample)}")


def _csv_header(line: bytes, path: Path) -> tuple[str, ...]:
    """Column names on the first line of a CSV file, `t` first."""
    place = f"{path}: line 1"
    if line.startswith(_MARKS_OF_OTHER_ENCODINGS):
        raise InputError(f"{place}: starts with the byte order mark of another encoding, expected UTF-8 text")
    line = line.removeprefix(_BYTE_ORDER_MARK)
    if not line:
        raise InputError(f"{path}: empty, expected a header line whose first column is t")
    text = _decode(line, place, ("t",))
    for name, separator in (("semicolons", ";"), ("tabs", "\t")):
        if separator in text and "," not in text:
            raise InputError(f"{place}: separated by {name}, expected commas (and decimal points)")
    names = tuple(name.strip() for name in _cells(text, place))
    check_header(names, place)
    return names


def check_header(names: tuple[str, ...], place: str) -> None:
    """Refuses column names (k,) that do not start with `t`, repeat, or could not be written to a CSV header."""
    if names[:1] != ("t",):
        first = shown(names[0]) if names else "missing"
        raise InputError(f"{place}: first column is {first}, expected a header starting with t")
    for index, name in enumerate(names):
        if name in names[:index]:
            raise InputError(f"{place}: column {shown(name)} appears twice, expected once")
        if not name.isprintable() or name != name.strip() or not name or set(name) & set(',"'):
            raise InputError(f"{place}: column {index + 1} is named {shown(name)}, expected a plain word")


def _parse(block: bytes, names: tuple[str, ...], path: Path, line: int) -> np.ndarray:
    """Numbers (n, k) in whole lines of CSV, the first of them being line number `line` of the file.

    pyarrow does the work. What it refuses, and what it would read in silence although it should not (`nan`, `"1"2`,
    lone carriage returns, a byte order mark before a number) goes through `_parse_by_line`, which finds the culprit or,
    if there is none, the numbers.
    """
    import pyarrow as pa
    import pyarrow.csv as pacsv

    if not block.strip():
        return np.empty((0, len(names)))
    if block.count(b"\r") == block.count(b"\r\n") and b'"' not in block and not block.startswith(_BYTE_ORDER_MARK):
        try:
            table = pacsv.read_csv(
                pa.py_buffer(block),
                read_options=pacsv.ReadOptions(  # a process can abort at its end while Arrow's own threads still wait
                    use_threads=False, column_names=list(names), block_size=len(block) + 1,
                ),
                convert_options=pacsv.ConvertOptions(column_types={n: pa.float64() for n in names}, null_values=[]),
            )
            values = np.column_stack([column.to_numpy() for column in table.columns])
            if np.isfinite(values).all():
                return values
        except pa.ArrowException:
            pass
    return _parse_by_line(block, names, path, line)


def _parse_by_line(block: bytes, names: tuple[str, ...], path: Path, line: int) -> np.ndarray:
    rows = []
    for number, raw in enumerate(block.split(b"\n"), start=line):
        place = f"{path}: line {number}"
        text = _decode(raw, place, names)
        if not text.strip():
            continue
        cells = _cells(text, place)
        values = [_number(cell) for cell in cells]
        if number == 2 and len(cells) > 1 and all(cell.strip() for cell in cells) and values == [None] * len(cells):
            raise InputError(f"{place}: no number in it (a row of units?), expected units to stand in recording.yaml")
        if len(cells) != len(names):
            raise InputError(f"{place}: {_wrong_count(text, len(cells), len(names))}")
        for name, cell, value in zip(names, cells, values, strict=True):
            if value is None or not np.isfinite(value):
                raise InputError(f"{place}: column {shown(name)} {_wrong_cell(cell, value)}")
        rows.append(values)
    return np.array(rows, dtype=float).reshape(len(rows), len(names))


def _decode(raw: bytes, place: str, names: tuple[str, ...]) -> str:
    """One line as text, without its line end."""
    raw = raw.removesuffix(b"\n").removesuffix(b"\r")
    if b"\0" in raw:
        raise InputError(f"{place}: holds a NUL byte, expected UTF-8 text (is it UTF-16, or not a CSV file?)")
    if len(raw) > LONGEST_LINE:
        raise InputError(f"{place}: {_too_long(names)}")
    if b"\r" in raw:
        raise InputError(f"{place}: holds a carriage return on its own, expected lines that end in LF or CRLF")
    try:
        return raw.decode("utf-8")
    except UnicodeDecodeError as error:
        raise InputError(f"{place}: holds byte 0x{raw[error.start]:02x}, expected UTF-8 text") from None


def _cells(text: str, place: str) -> list[str]:
    try:
        return next(csv.reader([text], strict=True), [])
    except csv.Error:
        raise InputError(f"{place}: quotes do not match in {shown(text)}, expected cells separated by commas") from None


def _number(cell: str) -> float | None:
    """The number in a cell; None for anything else, also for `1_000` and Arabic digits, which float() would take."""
    try:
        return float(cell) if cell.isascii() and "_" not in cell else None
    except ValueError:
        return None


def _too_long(names: tuple[str, ...]) -> str:
    return f"longer than {LONGEST_LINE} bytes, expected cells for {','.join(names)[:80]} and a line end"


def _wrong_count(text: str, found: int, expected: int) -> str:
    problem = f"{found} cell{'s' if found != 1 else ''}, expected {expected} as in the header"
    if ";" in text or "\t" in text:
        return f"{problem} (separated by {'semicolons' if ';' in text else 'tabs'} instead of commas?)"
    if found > expected and "." not in text:
        return f"{problem} (decimal commas instead of points?)"
    return problem


def _wrong_cell(cell: str, value: float | None) -> str:
    if value is not None:
        return f"holds {shown(cell)}, expected a finite number (leave out a row that has no sample)"
    if not cell.strip():
        return "is an empty cell, expected a number (leave out a row that has no sample)"
    if _number(cell.replace(",", ".", 1)) is not None:
        return f"holds {shown(cell)}, expected a number with a decimal point, not a comma"
    return f"holds {shown(cell)}, expected a number"


def _line_of(path: Path, sample: int) -> int:
    """Line number of a sample; blank lines count as lines and not as samples."""
    with open(path, "rb") as file:
        numbers = (number for number, line in enumerate(file, start=1) if line.strip())
        return next(number for index, number in enumerate(numbers) if index == sample + 1)


def _read_parquet(path: Path) -> Table:
    import pyarrow as pa
    import pyarrow.parquet as parquet

    try:
        with parquet.ParquetFile(path, page_checksum_verification=True) as file:
            schema, rows = file.schema_arrow, file.metadata.num_rows
            names = tuple(schema.names)
            check_header(names, f"{path}: header")
            for field in schema:
                if not (pa.types.is_floating(field.type) or pa.types.is_integer(field.type)):
                    raise InputError(f"{path}: column {shown(field.name)} is of type {field.type}, expected float64")
            if not 0 < rows * len(names) <= LARGEST_TABLE:
                raise InputError(f"{path}: {rows} rows, expected between 1 and {LARGEST_TABLE // len(names)}")
            size = path.stat().st_size
            if 8 * rows > _MOST_COMPRESSED * size:  # increasing times cannot be that small
                raise InputError(f"{path}: {rows} rows in {size} bytes, expected times that increase to take more")
            table = file.read(use_threads=False)
    except (pa.ArrowException, OSError, UnicodeError) as error:
        raise InputError(f"{path}: expected a Parquet file, but {shown(str(error), 120)}") from None
    columns = []
    for name, column in zip(names, table.columns, strict=True):
        if column.null_count:
            row = column.is_null().to_numpy().argmax() + 1
            raise InputError(f"{path}: row {row}: column {shown(name)} is empty, expected a number")
        columns.append(column.cast(pa.float64(), safe=False).to_numpy())
    return Table(names, np.column_stack(columns), lambda sample: f"row {sample + 1}")
