"""The rows of a campaign on disk: a folder with its plan and Parquet files, each written whole or not at all."""

import fcntl
import math
import os
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as parquet

from drake_ispace.blocks.errors import InputError, shown
from drake_ispace.files.places import check_folder, whole_file
from drake_ispace.files.yaml_guard import LARGEST_FILE, dump_yaml, load_yaml

PLAN = "campaign.yaml"
FORMAT = "drake-ispace-campaign/1"
_ROWS, _SECONDS = 500, 5.0  # of rows kept back at most


class Rows:
    """The rows of a campaign so far, in memory, or in `folder` as well.

    Attributes:
        done: numbers of the runs whose rows exist; schema: of a row; folder: None to keep the rows in memory.
        damaged: files that could not be read, and are set aside: their runs have no rows.
    """

    def __init__(self, schema: pa.Schema, folder: Path | None = None):
        self.schema = schema
        self.folder = folder
        self.done, self.damaged = _found(folder, schema) if folder else (set(), [])
        self._kept: list[dict] = []
        self._tables: list[pa.Table] = []  # without a folder
        self._written = time.monotonic()

    def add(self, rows: Sequence[dict]) -> None:
        """Take rows; those kept back are written now and then."""
        self._kept += rows
        self.done.update(row["run"] for row in rows)
        if len(self._kept) >= _ROWS or time.monotonic() - self._written > _SECONDS:
            self.flush()

    def flush(self) -> None:
        """Write the rows kept back, to a file that is named after the first of them.

        Raises:
            InputError: the folder cannot be written.
        """
        if not self._kept:
            return
        rows = sorted(self._kept, key=lambda row: row["run"])
        self.done.update(row["run"] for row in rows)  # Ctrl-C may have come while they were counted
        table = pa.Table.from_pylist(rows, self.schema)
        if self.folder is None:
            self._tables.append(table)
        else:
            with whole_file(self.folder / f"part-{rows[0]['run']:09d}.parquet") as beside:
                parquet.write_table(table, beside, write_page_checksum=True)
        self._kept = []
        self._written = time.monotonic()

    def table(self) -> pa.Table:
        """All rows, sorted by the number of the run."""
        self.flush()
        if self.folder is None:
            return pa.concat_tables([self.schema.empty_table(), *self._tables]).sort_by("run")
        return _read_parts(self.folder, self.schema)


def read_campaign(folder: Path) -> pa.Table:
    """The rows of the campaign in `folder`, sorted by the number of the run.

    Raises:
        InputError: no campaign, or a damaged file.
    """
    if not (folder / PLAN).is_file():
        raise InputError(f"{folder}: is no campaign, expected a folder with a {PLAN}")
    return _read_parts(folder, None)


@contextmanager
def campaign_folder(folder: Path, plan: dict) -> Iterator[Path]:
    """`folder`, made for `plan` or found with the same one, held against other processes meanwhile.

    Raises:
        InputError: another plan's folder, one that cannot be written, or one that another process writes to.
    """
    text = dump_yaml({"format": FORMAT, **plan})
    if len(text) > LARGEST_FILE:
        raise InputError(f"{folder / PLAN}: would be larger than {LARGEST_FILE} bytes, expected fewer parameter sets")
    check_folder(folder)
    folder.mkdir(parents=True, exist_ok=True)
    handle = os.open(folder, os.O_RDONLY)
    try:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise InputError(f"{folder}: another campaign is writing there, expected a folder of its own") from None
        if (folder / PLAN).exists():
            _compare(load_yaml(folder / PLAN, str(folder / PLAN)), load_yaml(text, PLAN), folder)
        else:
            if parts := next(folder.glob("part-*.parquet"), None):
                raise InputError(f"{folder}: has {parts.name} but no {PLAN}, expected an empty folder")
            with whole_file(folder / PLAN) as beside:
                beside.write_text(text, encoding="utf-8")
        for left in folder.glob(".part-*.parquet"):  # of a process that was killed: nobody else writes here
            left.unlink(missing_ok=True)
        yield folder
    finally:
        os.close(handle)


def spread(table: pa.Table, names: Sequence[str]) -> dict[str, dict[str, float | None]]:
    """name of a column -> median, 5 %, 95 % and worst of its numbers; None where no run has one."""
    result = {}
    for name in names:
        values = table[name].drop_null().to_numpy()
        numbers = [*np.quantile(values, [0.5, 0.05, 0.95]), values.max()] if len(values) else [math.nan] * 4
        result[name] = {
            key: float(number) if math.isfinite(number) else None
            for key, number in zip(("median", "p05", "p95", "max"), numbers, strict=True)
        }
    return result


def _compare(found, wanted, folder):
    for key in {**wanted, **found}:
        if key == "code" and found.get(key) != wanted.get(key) and isinstance(found.get(key), dict):
            changed = [name for name in wanted[key] if found[key].get(name) != wanted[key][name]]
            raise InputError(
                f"{folder / PLAN}: the rows there were computed by other code ({', '.join(map(shown, changed))}), "
                "expected the same version of drake_ispace, or another folder"
            )
        if found.get(key) != wanted.get(key):
            raise InputError(
                f"{folder / PLAN}: another campaign lies there, its {key} is {shown(_plain(found.get(key)))}, not "
                f"{shown(_plain(wanted.get(key)))}; expected the same call, to resume it, or another folder"
            )


def _plain(value):
    return "missing" if value is None else value


def _found(folder: Path, schema: pa.Schema) -> tuple[set[int], list[Path]]:
    """The runs that have rows in `folder`, and the new names of parts that cannot be read, which are set aside."""
    done, damaged = set(), []
    for file in sorted(folder.glob("part-*.parquet")):
        try:
            done.update(_read_part(file, schema)["run"].to_pylist())
        except InputError:
            damaged.append(file.rename(file.with_suffix(".damaged")))
    return done, damaged


def _read_part(file: Path, schema: pa.Schema | None) -> pa.Table:
    try:
        with parquet.ParquetFile(file, page_checksum_verification=True) as part:
            table = part.read(use_threads=False)
        if schema is not None and table.schema != schema:
            raise pa.ArrowInvalid("its columns are those of another campaign")
    except (pa.ArrowException, OSError, UnicodeError) as error:
        reason = shown(str(error).splitlines()[0] if str(error) else type(error).__name__, 120)
        raise InputError(
            f"{file}: cannot be read ({reason}), expected a part of this campaign; the same call computes its runs "
            "again"
        ) from None
    return table


def _read_parts(folder: Path, schema: pa.Schema | None) -> pa.Table:
    tables = [_read_part(file, schema) for file in sorted(folder.glob("part-*.parquet"))]
    if not tables:
        return schema.empty_table() if schema else pa.table({"run": pa.array([], pa.int64())})
    return pa.concat_tables(tables).sort_by("run")
