"""From logs and a mapping to a recording: units, counters, quaternions and clocks. Nothing is resampled."""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from drake_ispace.blocks.errors import InputError, shown
from drake_ispace.files.importers.tables import period_of
from drake_ispace.files.recording import CHANNELS, PER_WHEEL, Channel, Recording, median_step, validate
from drake_ispace.files.units import conversion, si_unit
from drake_ispace.logs.bags import is_bag, is_sealed, read_bag
from drake_ispace.logs.clocks import offset_of
from drake_ispace.logs.mapping import ROBOTS_CLOCK, ChannelMap, Mapping, Source, alike
from drake_ispace.logs.series import Series, read_series, shape_of, unwrapped
from drake_ispace.robots.robot_file import REAR_COMPUTED, STEERED


def convert(
    mapping: Mapping, folder: Path, tell: Callable[[str], None] = lambda said: None,
    progress: Callable[[int], None] = lambda read: None,
) -> Recording:
    """The recording of the run in a folder.

    Args:
        tell: called with a sentence for all that was trimmed, shifted or estimated; the notes hold them too.
        progress: called with how much was read.

    Raises:
        InputError: what is wrong with a log, or with what the mapping says of it.
    """
    said: list[str] = []

    def note(sentence):
        said.append(sentence)
        tell(sentence)

    times, values = {}, {}
    for file in dict.fromkeys(folder / channel.file for channel in mapping.channels.values()):
        if is_bag(file) and file.exists() and not is_sealed(file):
            note(f"{file.name} has no checksums: damage within its messages may go unnoticed")
    for name in sorted(mapping.channels, key=CHANNELS.index):
        times[name], values[name] = _channel(name, mapping.channels[name], folder, mapping.where, note, progress)
    if "encoder" in values and mapping.robot.keys.kind == "tricycle":
        rear = mapping.robot.rear_angles(*(values["encoder"][column] for column in STEERED)).T
        names = [PER_WHEEL["encoder"] + entry.name for entry in mapping.robot.wheels]
        values["encoder"] = dict(zip(names, rear, strict=True))
        note(f"encoder: {REAR_COMPUTED}")
    if "command" in values and "vy" not in values["command"]:  # such a robot is told to go ahead and to turn
        ahead, turn = values["command"]["vx"], values["command"]["wz"]
        values["command"] = {"vx": ahead, "vy": np.zeros_like(ahead), "wz": turn}
    _on_one_clock(mapping, times, values, note)
    first = float(min(t[0] for t in times.values()))
    if abs(first) > 1e4:  # stamps since 1970 or since the computer started
        note(f"times are counted from {first!r} s of the robot's clock")
        for name in times:
            times[name] = times[name] - first
            if "t_received" in values[name]:
                values[name]["t_received"] = values[name]["t_received"] - first
    channels = {}
    for name, t in times.items():
        columns = tuple(values[name])
        table = np.column_stack([values[name][column] for column in columns])
        units = {column: si_unit(column) for column in columns}
        channels[name] = Channel(t, columns, table, units, _period(t))
    notes = "; ".join([mapping.notes] * bool(mapping.notes) + said)
    scenario = mapping.robot.scenario()
    recording = Recording(mapping.robot.name, scenario["diagram"], channels, notes, settings=scenario)
    validate(recording, str(folder))
    return recording


def _channel(name, channel: ChannelMap, folder, where, note, progress):
    """(n,) times [s] of a channel on its own clock, and column -> (n,) numbers in SI units."""
    file, place = folder / channel.file, f"{where}: channels.{name}"
    wanted = [column for source in (channel.t, *channel.columns.values()) for column in _columns(source)]
    series = _read(file, channel, dict.fromkeys(wanted), place, progress)
    rows = np.column_stack([series.columns[column] for column in dict.fromkeys(wanted)])
    whole = np.isfinite(rows).all(axis=1)
    if not whole.any():
        raise InputError(f"{file}: no row has all of {shown(', '.join(dict.fromkeys(wanted)))}, expected some")
    if not whole.all():
        note(f"{name}: {int((~whole).sum())} of {len(whole)} rows without a sample left out")
    columns = {column: numbers[whole] for column, numbers in series.columns.items()}
    t = _in_si(columns[channel.t.column], channel.t, "t", place)
    values = {key: _value(columns, source, key, place) for key, source in channel.columns.items()}
    return _in_order(name, channel, file, t, values, note)


def _in_order(name, channel, file, t, values, note):
    """Samples whose times increase: of several at one time the last, which is what was known by then."""
    again = np.flatnonzero((np.diff(t) == 0.0) & np.all([np.diff(v) == 0.0 for v in values.values()], axis=0)) + 1
    if len(again):
        note(f"{name}: {len(again)} rows that repeat the one before left out")
        t, values = np.delete(t, again), {key: np.delete(v, again) for key, v in values.items()}
    older = np.flatnonzero(np.diff(t) == 0.0)
    if 2 * len(older) >= len(t):
        raise InputError(
            f"{file}: {len(older)} of {len(t)} samples of {name} have the {channel.t.column} of the next one, expected "
            "times that tell samples apart"
        )
    if len(older):
        note(f"{name}: {len(older)} of {len(t)} samples at the time of the next one left out: times of arrival?")
        t, values = np.delete(t, older), {key: np.delete(v, older) for key, v in values.items()}
    backward = np.flatnonzero(np.diff(t) < 0.0) + 1
    if len(backward):
        raise InputError(
            f"{file}: sample {backward[0] + 1} of {name}: {channel.t.column} is {t[backward[0]]:g} s after "
            f"{t[backward[0] - 1]:g} s, expected times that increase"
        )
    return t, values


def _read(file, channel, wanted, place, progress) -> Series:
    if is_bag(file):
        if not channel.topic:
            raise InputError(f"{place}: topic: expected the name of a topic in {file.name}")
        return read_bag(file, channel.topic, list(wanted), progress)
    if channel.topic:
        raise InputError(f"{place}: topic: {file.name} is no bag, expected .mcap, .bag or the folder of a ROS 2 bag")
    shape = None
    if file.suffix != ".parquet" and file.is_file():
        shape = shape_of(file, channel.delimiter or None, channel.decimal or None)
    return read_series(file, wanted, shape, progress)


def _columns(source: Source):
    return source.quaternion or [source.column]


def _value(columns, source, key, place):
    if source.quaternion is not None:
        x, y, z, w = (columns[name] for name in source.quaternion)
        length = np.sqrt(x * x + y * y + z * z + w * w)
        if np.abs(length - 1.0).max() > 0.05:
            raise InputError(
                f"{place}.columns.{key}: a quaternion of length {length[np.abs(length - 1.0).argmax()]:g}, expected 1; "
                "are the columns x, y, z, w?"
            )
        return source.sign * np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    numbers = columns[source.column]
    if source.wraps_at is not None:
        numbers = unwrapped(numbers, source.wraps_at)
    if source.increments:
        numbers = np.cumsum(numbers) - numbers[0]
    return source.sign * _in_si(numbers, source, key, place)


def _in_si(numbers, source, key, place):
    if source.counts_per_turn is not None:
        return numbers * (2.0 * np.pi / source.counts_per_turn)
    if source.unit:
        _, numerator, denominator = conversion(alike(key), source.unit, place)
        return numbers * numerator / denominator
    return numbers


def _on_one_clock(mapping, times, values, note):
    """Put the channels of other clocks on the robot's."""
    for clock in dict.fromkeys(channel.clock for channel in mapping.channels.values()):
        own = [name for name, channel in mapping.channels.items() if channel.clock == clock]
        if clock == ROBOTS_CLOCK:
            continue
        known = mapping.clocks[clock].offset_s if clock in mapping.clocks else None
        if known is None:
            offset = _estimated(mapping, times, values, own, clock)
            note(
                f"clock {clock}: {offset} ahead of the robot's, estimated from the motion and taken off; a delay of "
                "what it stamps is part of that number"
            )
            known = offset.offset_s
        else:
            note(f"clock {clock}: {known!r} s ahead of the robot's, as the mapping says, taken off")
        for name in own:
            times[name] = times[name] - known
            if "t_received" in values[name]:
                values[name]["t_received"] = values[name]["t_received"] - known


def _estimated(mapping, times, values, own, clock):
    where = f"{mapping.where}: clocks.{clock}"
    if "kinect" not in own or "encoder" not in times or mapping.channels["encoder"].clock != ROBOTS_CLOCK:
        raise InputError(
            f"{where}: expected offset_s; it is estimated only where encoder is on the robot's clock and kinect on this"
        )
    wheels = [values["encoder"][PER_WHEEL["encoder"] + entry.name] for entry in mapping.robot.wheels]
    steps = np.diff(np.column_stack(wheels), axis=0) @ mapping.robot.geometry.forward.T
    distance = np.hypot(steps[:, 0], steps[:, 1]) * np.where(steps[:, 0] < 0.0, -1.0, 1.0)
    moved = np.vstack([np.zeros(2), np.cumsum(np.column_stack([distance, steps[:, 2]]), axis=0)])
    poses = np.column_stack([values["kinect"][key] for key in ("x", "y", "phi")])
    return offset_of(times["encoder"], moved, times["kinect"], poses, where)


def _period(t):
    period = period_of(t)
    return None if period is None or abs(median_step(t) / period - 1.0) > 0.01 else period
