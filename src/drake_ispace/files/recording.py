"""Runs of a robot, measured or simulated, as folders on disk: `recording.yaml`, one table per channel, and of a
simulated run the `scenario.yaml` that repeats it.

`docs/recordings.md` describes the format. In memory every number is in SI units and radians; units declared in
`recording.yaml` are converted while loading.
"""

import errno
import math
import os
import re
import shutil
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from drake_ispace.blocks.errors import InputError, expected_one_of, shown
from drake_ispace.files.places import beside, check_folder, clear_leftovers, put_in_place
from drake_ispace.files.recording_tables import check_header, check_sum, read_table, sha256_of, write_table
from drake_ispace.files.units import conversion, si_unit
from drake_ispace.files.yaml_guard import dump_yaml, load_yaml

FORMAT = "drake-ispace-recording"
VERSION = 1
PERIOD_TOLERANCE = 0.02  # of the period

SETTINGS = "scenario.yaml"
_SEALS = ("rows", "columns", "sha256")  # of a channel: what its file must hold, compared where it is noted
#: Robot -> names of its wheels, as robots.library tells them; of any other robot they are what its columns say.
WHEELS: dict[str, tuple[str, ...]] = {}
CHANNELS = ("reference", "command", "torque", "encoder", "imu", "kinect", "truth")

CHANNEL_COLUMNS = {
    "reference": ("x", "y", "phi"),
    "command": ("vx", "vy", "wz"),
    "imu": ("ax", "ay", "az", "wx", "wy", "wz"),
    "kinect": ("x", "y", "phi"),
    "truth": ("x", "y", "phi"),
}
PER_WHEEL = {"torque": "tau_", "encoder": "theta_"}
@dataclass(frozen=True, eq=False)
class Channel:
    """Samples of one signal at its own rate, in SI units.

    Parameters
    ----------
    t
        Time of each sample, (n,) [s], strictly increasing.
    columns
        Names (m,) of the columns after `t`.
    values
        (n, m), finite, column by column in the unit `si_unit` gives.
    units
        SI unit of a column. May be left out for columns whose unit is known from their name.
    period_s
        Nominal sampling period [s], None if unknown.
    file
        Where it was read from, for messages; empty if it was made in memory.
    """

    t: np.ndarray
    columns: tuple[str, ...]
    values: np.ndarray
    units: dict[str, str] = field(default_factory=dict)
    period_s: float | None = None
    file: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "t", np.asarray(self.t, dtype=float))
        object.__setattr__(self, "columns", tuple(self.columns))
        object.__setattr__(self, "values", np.asarray(self.values, dtype=float))

    def column(self, name: str) -> np.ndarray:
        """Samples (n,) of the column called `name`."""
        return self.values[:, self.columns.index(name)]


@dataclass
class Recording:
    """One run: which robot, whose controller drove it, and its channels by name.

    Attributes:
        scenario: name of the Diagram, None when unknown.
        settings: the scenario that repeats a simulated run, as plain data (`scenario.difference`); None when unknown.
    """

    robot: str
    scenario: str | None = None
    channels: dict[str, Channel] = field(default_factory=dict)
    notes: str = ""
    path: Path | None = None
    settings: dict[str, Any] | None = None

    def save(self, path: str | Path, format: str = "csv") -> None:
        """Writes the run as the folder `path`, its tables as "csv" or "parquet"; replaces a recording that is there.

        The folder is written under another name beside its place and then renamed, so that a reader never finds half a
        run at `path`. Numbers read back bit for bit.
        """
        if format not in ("csv", "parquet"):
            raise InputError(f"{path}: format is {format!r}, expected 'csv' or 'parquet'")
        path = Path(os.path.realpath(path))
        validate(self, str(path))
        check_place(path)
        fresh = beside(path)
        try:
            clear_leftovers(path)
            fresh.mkdir(parents=True)
            _write(self, fresh, format)
            put_in_place(fresh, path)
        except OSError as error:
            raise InputError(f"{path}: cannot be written ({error.strerror or error})") from error
        finally:
            shutil.rmtree(fresh, ignore_errors=True)


def load(path: str | Path) -> Recording:
    """The run in the folder `path`, checked and in SI units; InputError says what is wrong with it."""
    folder = Path(path)
    if not os.path.isdir(folder):
        there = "there is a file" if os.path.isfile(folder) else "there is none"
        raise InputError(f"{folder}: expected the folder of a run, {there}")
    where = folder / "recording.yaml"
    data = load_yaml(where, str(where))
    _check_keys(data, ("format", "robot", "scenario", "channels", "notes"), "", where)
    _check_format(data.get("format"), where)
    for key in ("robot", "scenario", "notes"):
        if data.get(key) is not None and not isinstance(data[key], str):
            raise InputError(f"{where}: {key} is {shown(data[key])}, expected text")
    if not isinstance(data.get("channels"), dict):
        found = "missing" if data.get("channels") is None else shown(data["channels"])
        raise InputError(f"{where}: channels is {found}, expected 'name: {{file: ...}}' entries")
    recording = Recording(data.get("robot") or "", data.get("scenario"), {}, data.get("notes") or "", folder)
    _check_frame(recording.robot, data["channels"], where)
    if os.path.lexists(folder / SETTINGS):
        settings = _file_inside(folder, SETTINGS, str(folder))
        recording.settings = load_yaml(settings, str(settings))
    for name, entry in data["channels"].items():
        recording.channels[name] = _load_channel(folder, name, entry, recording.robot, where)
    return recording


def validate(recording: Recording, where: str | Path) -> None:
    """Raises InputError, with `where` naming the run, unless `recording` is one that `load` could have returned."""
    _check_frame(recording.robot, recording.channels, where)
    if not isinstance(recording.settings, dict | None):
        raise InputError(f"{where}: settings is {shown(recording.settings)}, expected a mapping or None")
    for name, channel in recording.channels.items():
        source = f"{where}: channel {name!r}"
        if channel.t.ndim != 1 or channel.values.shape != (len(channel.t), len(channel.columns)) or not len(channel.t):
            shapes = f"t {channel.t.shape}, {len(channel.columns)} columns, values {channel.values.shape}"
            raise InputError(f"{source}: {shapes}, expected (n,), m and (n, m) with n > 0 (else leave the channel out)")
        check_header(("t", *channel.columns), source)
        _check_columns(name, channel.columns, recording.robot, source)
        for column, unit in channel.units.items():
            known, *_ = _conversion(column, unit, ("t", *channel.columns), f"{where}: channels.{name}.units")
            if known != unit:
                raise InputError(f"{where}: channels.{name}.units.{column} is {unit!r}, expected {known!r}")
        _check_samples(channel, source, lambda sample: f"sample {sample + 1}")
        _check_period(name, channel, where)


def check_place(path: str | Path) -> None:
    """Raises InputError unless a recording can be saved as the folder `path`: there is nothing yet, or a recording and
    nothing besides it. A long run asks before it starts."""
    path = Path(os.path.realpath(path))
    check_folder(path.parent if path.exists() else path)
    if not path.exists():
        return
    try:
        data = load_yaml(path / "recording.yaml", str(path))
    except InputError:
        data = {}
    if not str(data.get("format")).startswith(FORMAT + "/"):
        raise InputError(f"{path}: exists and is not a recording, expected a new folder or a recording to replace")
    _check_format(data["format"], path / "recording.yaml")  # what another version wrote is not this one's to replace
    channels = data.get("channels") if isinstance(data.get("channels"), dict) else {}
    own = {str(entry.get("file")) for entry in channels.values() if isinstance(entry, dict)}
    for file in path.rglob("*"):
        if not file.is_dir() and str(file.relative_to(path)) not in {"recording.yaml", SETTINGS, *own}:
            raise InputError(f"{file}: is no part of the recording to replace, expected it moved elsewhere first")


def _load_channel(folder: Path, name: str, entry: Any, robot: str, where: Path) -> Channel:
    key = f"channels.{name}"
    if not isinstance(entry, dict):
        raise InputError(f"{where}: {key} is {shown(entry)}, expected a mapping such as {{file: {name}.csv}}")
    _check_keys(entry, ("file", "units", "period_s", *_SEALS), f"{key}.", where)
    units, period_s = entry.get("units") or {}, entry.get("period_s")
    if not isinstance(units, dict):
        raise InputError(f"{where}: {key}.units is {shown(units)}, expected a mapping such as {{x: m}}")
    if period_s is not None and (isinstance(period_s, bool) or not isinstance(period_s, (int, float)) or period_s <= 0):
        raise InputError(f"{where}: {key}.period_s is {shown(period_s)}, expected a positive number of seconds")

    file = _file_inside(folder, entry.get("file"), f"{where}: {key}.file")
    check_sum(file, entry.get("sha256"), f"{where}: {key}.sha256")
    table = read_table(file)
    for seal, found in (("rows", len(table.values)), ("columns", list(table.names))):
        if seal in entry and entry[seal] != found:
            raise InputError(f"{file}: {seal} {shown(found)}, expected {shown(entry[seal])} as {where}: {key} says")
    columns, values = table.names[1:], table.values
    _check_columns(name, columns, robot, str(file))
    in_si = {column: si_unit(column) for column in table.names if si_unit(column)}
    for column, unit in units.items():
        in_si[column], numerator, denominator = _conversion(column, unit, table.names, f"{where}: {key}.units")
        if numerator != denominator:
            index = table.names.index(column)
            values[:, index] = values[:, index] * numerator / denominator
    in_si.pop("t")
    read = Channel(values[:, 0].copy(), columns, values[:, 1:].copy(), in_si, period_s, str(file))
    channel = _in_order(read, name, robot)
    _check_samples(channel, str(file), table.place)
    _check_period(name, channel, where)
    return channel if period_s is None else replace(channel, period_s=float(period_s))


def _in_order(channel: Channel, name: str, robot: str) -> Channel:
    """The channel with the columns of a known robot's wheels in the order of its wheels."""
    if name not in PER_WHEEL or robot not in WHEELS:
        return channel
    columns = tuple(PER_WHEEL[name] + wheel for wheel in WHEELS[robot])
    order = [channel.columns.index(column) for column in columns]
    return replace(channel, columns=columns, values=channel.values[:, order])


def _check_keys(data: dict[str, Any], known: tuple[str, ...], prefix: str, where: Path) -> None:
    for key in data:
        if key not in known:
            raise InputError(f"{where}: unknown key {shown(prefix + key)}, {expected_one_of(key, known)}")


def _check_format(text: Any, where: Path) -> None:
    match = re.fullmatch(FORMAT + r"/([0-9]{1,9})", text) if isinstance(text, str) else None
    if match is None:
        found = "missing" if text is None else shown(text)
        raise InputError(f"{where}: format is {found}, expected {FORMAT}/{VERSION}")
    if int(match[1]) != VERSION:
        raise InputError(f"{where}: format is {text!r}, expected version {VERSION}, the only one this program reads")


def _check_frame(robot: Any, channels: dict[str, Any], where: str | Path) -> None:
    """Refuse a recording.yaml that is wrong before any table is looked at."""
    if not isinstance(robot, str) or not robot.strip():
        raise InputError(f"{where}: robot is missing, expected omni, pendulum or the name of your own model")
    if not channels:
        raise InputError(f"{where}: channels is empty, expected at least one of {', '.join(CHANNELS)}")
    for name in channels:
        if name not in CHANNELS:
            raise InputError(f"{where}: unknown channel {shown(name)} in channels, {expected_one_of(name, CHANNELS)}")


def _file_inside(folder: Path, name: Any, where: str) -> Path:
    """The path of a channel's file, which must not lead out of the folder of its run."""
    if not isinstance(name, str) or not name.isprintable() or not name:
        found = "missing" if name is None else shown(name)
        raise InputError(f"{where} is {found}, expected the name of a file in {folder}")
    file = folder / name
    try:
        inside = file.resolve(strict=file.is_symlink()).is_relative_to(folder.resolve())
    except RuntimeError:  # a loop of symbolic links, before Python 3.13
        inside = False
    except OSError as error:  # the same since then, or a link to nothing; other names fail when they are opened
        inside = error.errno not in (errno.ELOOP, errno.ENOENT)
    if not inside or ".." in Path(name).parts or Path(name).is_absolute():
        raise InputError(f"{where} is {shown(name)}, which leads out of {folder}, expected a file inside it")
    return file


def _check_columns(channel: str, columns: tuple[str, ...], robot: str, where: str) -> None:
    prefix = PER_WHEEL.get(channel)
    wheels = WHEELS.get(robot)
    if prefix and wheels is None:
        for column in columns:
            if not re.fullmatch(prefix + r"\w+", column):
                raise InputError(f"{where}: unexpected column {shown(column)}, expected only {prefix}* after t")
        if not columns:
            raise InputError(f"{where}: no column after t, expected {prefix}* for each wheel of robot {shown(robot)}")
        return
    required = tuple(prefix + wheel for wheel in wheels) if prefix else CHANNEL_COLUMNS[channel]
    wanted = f"t,{','.join(required)} for the {channel} of robot {shown(robot)}"
    for column in required:
        if column not in columns:
            raise InputError(f"{where}: column {column!r} is missing, expected {wanted}")
    if channel == "truth":
        if columns[: len(required)] != required:
            raise InputError(f"{where}: columns start with {shown(','.join(columns[:3]))}, expected {wanted}")
        return
    for column in columns:
        if column not in required and (channel, column) != ("kinect", "t_received"):
            raise InputError(f"{where}: unexpected column {shown(column)}, expected {wanted}")


def _conversion(column: str, unit: Any, columns: tuple[str, ...], where: str) -> tuple[str, float, float]:
    """SI unit, numerator and denominator that take a column in `unit` to SI."""
    if column not in columns:
        raise InputError(f"{where}: there is no column {shown(column)}, {expected_one_of(column, columns)}")
    return conversion(column, unit, where)


def _check_samples(channel: Channel, where: str, place: Callable[[int], str]) -> None:
    """Refuses samples that are not finite or not in order of time."""
    check_finite(channel, where, place)
    bad = np.flatnonzero(np.diff(channel.t) <= 0) + 1
    if len(bad):
        before, t = channel.t[bad[0] - 1 : bad[0] + 1].tolist()
        raise InputError(f"{where}: {place(bad[0])}: t = {t} s follows t = {before} s, expected t to increase")
    if "t_received" in channel.columns:
        received = channel.column("t_received")
        bad = np.flatnonzero(received < channel.t)
        if len(bad):
            t, late = channel.t[bad[0]].item(), received[bad[0]].item()
            raise InputError(f"{where}: {place(bad[0])}: t_received = {late} s, expected no less than t = {t} s")


def check_finite(channel: Channel, where: str, place: Callable[[int], str]) -> None:
    """Refuse samples that are no number; where: the channel, place: a row, both in words.

    Raises:
        InputError: naming channel, row and column.
    """
    for name, samples in (("t", channel.t), *((name, channel.column(name)) for name in channel.columns)):
        bad = np.flatnonzero(~np.isfinite(samples))
        if len(bad):
            raise InputError(
                f"{where}: {place(bad[0])}: column {shown(name)} is {samples[bad[0]]}, expected a finite number"
            )


def median_step(t: np.ndarray) -> float:
    """The median step [s] of stamps (k,), k > 1.

    Of an even number of steps it is the lower of the two in the middle: halfway between 95 and 190 ms is no step.
    """
    return float(np.quantile(np.diff(t), 0.5, method="lower"))


def _check_period(name: str, channel: Channel, where: str | Path) -> None:
    """Refuses a period that the time stamps contradict; the Kinect may miss the robot, so steps may be multiples."""
    period = channel.period_s
    if period is None or len(channel.t) < 2:
        return
    step = median_step(channel.t)
    steps = max(1, round(step / period)) if name == "kinect" and period > 0 else 1
    if not (0 < period < math.inf and abs(step - steps * period) <= PERIOD_TOLERANCE * period):
        raise InputError(
            f"{where}: channels.{name}.period_s is {period} s but the median step of t is {step:.9g} s, "
            f"expected them to agree within {PERIOD_TOLERANCE:.0%}"
        )


def _write(recording: Recording, folder: Path, format: str) -> None:
    entries = {}
    for name, channel in recording.channels.items():
        units = {column: channel.units.get(column) or si_unit(column) for column in channel.columns}
        entries[name] = {"file": f"{name}.{format}", "units": {column: unit for column, unit in units.items() if unit}}
        if channel.period_s is not None:
            entries[name]["period_s"] = float(channel.period_s)
        table, columns = np.column_stack([channel.t, channel.values]), ("t", *channel.columns)
        write_table(folder / entries[name]["file"], columns, table)
        if format == "parquet":  # a flipped bit can take rows away and rename columns; nobody edits such a file by hand
            sha256 = sha256_of(folder / entries[name]["file"])
            entries[name] |= {"rows": len(table), "columns": list(columns), "sha256": sha256}
    data = {"format": f"{FORMAT}/{VERSION}", "robot": recording.robot, "scenario": recording.scenario}
    data |= {"channels": entries, "notes": recording.notes}
    text = dump_yaml({key: value for key, value in data.items() if value is not None})
    (folder / "recording.yaml").write_text(text, encoding="utf-8")
    if recording.settings is not None:
        (folder / SETTINGS).write_text(dump_yaml(recording.settings), encoding="utf-8")
