"""More than seventy mistakes of logs: each changes the tables of one recording, and says how it may be found.

`CORRUPTIONS` name -> Corruption. `every`: all runs of a set have it, otherwise the first alone.
"""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from planted.files import Folder

DEG = np.pi / 180.0
TURNED = {"heading_offset", "camera_turned"}
MIRRORED = {"camera_axis_mirrored", "camera_axes_swapped"}


@dataclass(frozen=True)
class Corruption:
    """A mistake.

    Attributes:
        change: of a Folder, in place; takes the folder and, as second, another run of the same set. channel: that it
            needs. expected: names of the faults that exact data cannot tell apart. every: whether all runs have it.
        robots: that it fits; empty: all.
    """

    change: Callable[[Folder, Folder], None]
    channel: str
    expected: frozenset[str]
    every: bool = True
    robots: tuple[str, ...] = ()


CORRUPTIONS: dict[str, Corruption] = {}


def add(name, channel, expected, change, every=True, robots=()):
    """Register a mistake; expected: one name or several."""
    names = frozenset([expected] if isinstance(expected, str) else expected)
    CORRUPTIONS[name] = Corruption(change, channel, names, every, robots)


def columns(channel, function):
    """A change of the values of a channel: function(t (n,), values (n, m)) -> values."""
    def change(folder, other):
        table = folder.tables[channel][1]
        table[:, 1:] = function(table[:, 0].copy(), table[:, 1:].copy())
    return change


def stamps(channel, function):
    """A change of the stamps of a channel: function(t (n,)) -> t; rows that no longer increase are left out."""
    def change(folder, other):
        names, table = folder.tables[channel]
        table[:, 0] = function(table[:, 0].copy())
        later = table[:, 0] > np.maximum.accumulate(np.r_[-np.inf, table[:-1, 0]])
        folder.tables[channel] = names, table[later]
    return change


def scaled(channel, factors):
    """Columns times numbers; factors: a number, or a list that is cut to the columns."""
    return columns(channel, lambda t, v: v * np.resize(factors, v.shape[1]))


def ordered(channel, order):
    """Columns in another order, the rest as it is."""
    return columns(channel, lambda t, v: v[:, [*order, *range(len(order), v.shape[1])]])


def place(matrix, sense=1.0, off=0.0):
    """Places by a matrix, headings times sense plus off."""
    def function(t, v):
        v[:, :2], v[:, 2] = v[:, :2] @ np.array(matrix, float).T, sense * v[:, 2] + off
        return v
    return columns("kinect", function)


def between(channel, since, until, function):
    """A change of the rows from since to until alone: function(rows) -> rows, as shares of the run's length."""
    def change(folder, other):
        table = folder.tables[channel][1]
        t = (table[:, 0] - table[0, 0]) / (table[-1, 0] - table[0, 0])
        inside = np.flatnonzero((t >= since) & (t <= until))
        table[inside, 1:] = function(table[inside, 1:].copy())
    return change


def one(index, factor, count=8):
    """A list of ones with another number at an index."""
    return [factor if i == index else 1.0 for i in range(count)]


I2 = ((1, 0), (0, 1))
for name, factor in {"degrees": 1 / DEG, "revolutions": 1 / (2 * np.pi), "milliradians": 1e3}.items():
    add(f"encoder in {name}", "encoder", {"wrong_unit"}, lambda f, o, k=factor: _exact(f, "encoder", k))
add("encoder in counts", "encoder", {"wrong_unit", "counts_per_turn"},
    lambda f, o: _exact(f, "encoder", {4: 108, 2: 2000}.get(len(f.tables["encoder"][0]), 3600) / (2 * np.pi)))
for factor in (2.0, 4.0, 0.5, 0.25, 9.0):
    add(f"counts per turn times {factor}", "encoder", {"counts_per_turn", "diameter_for_radius", "gear"},
        scaled("encoder", factor))
for factor in (2.0, 4.0, 0.5):
    add(f"counts per turn of wheel 1 times {factor}", "encoder", {"counts_per_turn"}, scaled("encoder", one(0, factor)))
add("encoder in radians read as degrees", "encoder", {"wrong_unit", "gear"}, scaled("encoder", DEG))
add("wheel 2 in degrees", "encoder", {"wrong_unit"}, scaled("encoder", one(1, 1 / DEG)))
for i in range(2):
    add(f"wheel {i + 1} counts backwards", "encoder", {"wheel_sign"}, scaled("encoder", one(i, -1.0)))
add("all wheels count backwards", "encoder", {"encoder_sign"}, scaled("encoder", -1.0))
add("wheels 1 and 2 swapped", "encoder", {"wheels_swapped", "wheel_order", "camera_axis_mirrored"},
    ordered("encoder", (1, 0)))
add("wheels 1 and 3 swapped", "encoder", {"wheels_swapped", "wheel_order"}, ordered("encoder", (2, 1, 0)),
    robots=("omni",))
add("wheels moved on by one", "encoder", {"wheels_swapped", "wheel_order", *TURNED}, ordered("encoder", (1, 2, 3, 0)),
    robots=("omni",))

for name, factor in {"millimetres": 1e3, "centimetres": 1e2, "inches": 1 / 0.0254, "tenths of a metre": 10.0}.items():
    add(f"camera in {name}", "kinect", {"wrong_unit"}, scaled("kinect", [factor, factor, 1.0, 1.0]))
add("headings in degrees", "kinect", {"wrong_unit"}, scaled("kinect", [1.0, 1.0, 1 / DEG, 1.0]))
add("headings in radians read as degrees", "kinect", {"wrong_unit"}, scaled("kinect", [1.0, 1.0, DEG, 1.0]))
add("camera in millimetres and degrees", "kinect", {"wrong_unit"}, scaled("kinect", [1e3, 1e3, 1 / DEG, 1.0]))
add("x and y swapped", "kinect", MIRRORED, place(((0, 1), (1, 0))))
add("x mirrored", "kinect", MIRRORED, place(((-1, 0), (0, 1))))
add("y mirrored", "kinect", MIRRORED, place(((1, 0), (0, -1))))
add("room mirrored", "kinect", {*MIRRORED, "wheels_swapped", "wheel_order", "heading_sign"},
    place(((1, 0), (0, -1)), -1.0))
add("headings of the other sense", "kinect", {"heading_sign", *MIRRORED}, place(I2, -1.0))
add("headings of a compass, in degrees", "kinect", {"heading_sign", "wrong_unit", *MIRRORED},
    columns("kinect", lambda t, v: np.column_stack([v[:, :2], 90.0 - np.degrees(v[:, 2]), v[:, 3:]])))
for quarter in (1, 2, 3):
    also = {"wheels_swapped", "wheel_order"} | ({"encoder_sign"} if quarter == 2 else set())
    add(f"headings off by {90 * quarter} degrees", "kinect", {*TURNED, *also}, place(I2, 1.0, quarter * np.pi / 2))
add("room turned by 90 degrees", "kinect", {*TURNED, "wheels_swapped", "wheel_order"}, place(((0, -1), (1, 0))))
add("room turned by 180 degrees", "kinect", {*TURNED, "wheels_swapped", "encoder_sign"}, place(((-1, 0), (0, -1))))

for name, factor in {"mN m": 1e3, "N cm": 1e2, "kgf cm": 1 / 0.0980665}.items():
    add(f"torque in {name}", "torque", {"wrong_unit"}, scaled("torque", factor))
add("torque of the other sense", "torque", {"torque_sign"}, scaled("torque", -1.0))
for i in range(2):
    add(f"torque of wheel {i + 1} of the other sense", "torque", {"torque_sign"}, scaled("torque", one(i, -1.0)))
add("torques 1 and 2 swapped", "torque", {"torques_swapped"}, ordered("torque", (1, 0)))

for name, factors in {
    "accelerometer in g": [1 / 9.80665] * 3 + [1.0] * 3, "gyro in degrees": [1.0] * 3 + [1 / DEG] * 3,
}.items():
    add(name, "imu", {"wrong_unit"}, scaled("imu", factors))
for name, signs in {
    "ax negated": (-1, 1, 1, 1, 1, 1), "az negated": (1, 1, -1, 1, 1, 1), "wy negated": (1, 1, 1, 1, -1, 1),
    "wz negated": (1, 1, 1, 1, 1, -1), "IMU turned by 180 degrees": (-1, -1, 1, -1, -1, 1),
}.items():
    add(name, "imu", {"imu_axes"}, scaled("imu", signs))
add("ax and ay swapped", "imu", {"imu_axes"}, ordered("imu", (1, 0, 2, 3, 4, 5)))
add("wx and wy swapped", "imu", {"imu_axes"}, ordered("imu", (0, 1, 2, 4, 3, 5)))
add("IMU axes permuted", "imu", {"imu_axes"}, ordered("imu", (2, 0, 1, 5, 3, 4)))
add("IMU x and y swapped", "imu", {"imu_axes"}, ordered("imu", (1, 0, 2, 4, 3, 5)))
add("gravity taken off", "imu", {"gravity_missing"}, columns("imu", lambda t, v: v - [0, 0, 9.80665, 0, 0, 0]))

for name, turn, low in (("-pi to pi", 2 * np.pi, -np.pi), ("0 to 2 pi", 2 * np.pi, 0.0)):
    add(f"angles wrapped to {name}", "encoder", {"angle_wrap", "counter_wrap"},
        columns("encoder", lambda t, v, turn=turn, low=low: (v - low) % turn + low))
add("angles in degrees, wrapped at 360", "encoder", {"angle_wrap", "counter_wrap", "wrong_unit"},
    columns("encoder", lambda t, v: (v / DEG) % 360.0))
add("a counter of few bits", "encoder", {"counter_wrap", "angle_wrap"},
    columns("encoder", lambda t, v: (v + 6.0) % 16.0 - 6.0))

for channel in ("encoder", "torque", "imu"):
    add(f"{channel} always zero", channel, {"channel_dead", "channel_frozen", "robot_carried"}, scaled(channel, 0.0))
add("camera always at one place", "kinect", {"channel_dead", "channel_frozen"},
    columns("kinect", lambda t, v: np.repeat(v[:1], len(v), axis=0)))
add("wheel 2 always zero", "encoder", {"channel_dead", "channel_frozen"}, scaled("encoder", one(1, 0.0)))
for channel in ("encoder", "kinect", "imu", "torque"):
    add(f"{channel} frozen for a while", channel, {"channel_frozen", "robot_carried", "rows_missing"},
        between(channel, 0.35, 0.5, lambda v: np.repeat(v[:1], len(v), axis=0)), every=False)
    if channel != "torque" and channel != "imu":
        add(f"{channel} in the opposite order for a while", channel, {"rows_reversed"},
            between(channel, 0.35, 0.5, lambda v: v[::-1]), every=False)
for channel in ("imu", "torque"):
    add(f"{channel} clipped", channel, {"channel_clipped"}, columns(
        channel, lambda t, v: np.clip(v, -np.quantile(np.abs(v), 0.9, axis=0), np.quantile(np.abs(v), 0.9, axis=0))))
add("places rounded to 10 cm", "kinect", {"channel_quantised"}, columns("kinect", lambda t, v: _rounded(v, 0.1)))


def _exact(folder, channel, factor):
    folder.tables[channel][1][:, 1:] *= factor


def _rounded(values, step):
    values[:, :2] = np.round(values[:, :2] / step) * step
    return values


def _repeat(channel, share):
    """The rows of a stretch again in place of those that follow."""
    def change(folder, other):
        table = folder.tables[channel][1]
        n, size = len(table), int(share * len(table))
        table[n // 2 : n // 2 + size, 1:] = table[n // 2 - size : n // 2, 1:]
    return change


def _gap(channel):
    def change(folder, other):
        names, table = folder.tables[channel]
        n = len(table)
        folder.tables[channel] = names, np.vstack([table[: n // 2], table[n // 2 + n // 15 :]])
    return change


def _jitter(channel, most):
    def change(folder, other):
        table = folder.tables[channel][1]
        step = np.median(np.diff(table[:, 0]))
        table[:, 0] = np.sort(table[:, 0] + np.random.default_rng(1).uniform(-most, most, len(table)) * step)
    return change


def _burst(folder, other):
    table = folder.tables["encoder"][1]
    t = table[:, 0].copy()
    for a, b in pairwise(range(0, len(t), 10)):
        table[a:b, 0] = t[b - 1] + np.arange(b - a) * 1e-5


for channel in ("encoder", "torque", "imu"):
    add(f"rows of {channel} twice", channel, {"rows_duplicated"}, _repeat(channel, 0.05), every=False)
    add(f"a gap in {channel}", channel, {"rows_missing"}, _gap(channel), every=False)
add("rows of kinect twice", "kinect", {"rows_duplicated"}, _repeat("kinect", 0.25), every=False)
add("uneven stamps", "encoder", {"stamp_jitter", "bursts"}, _jitter("encoder", 0.8))
add("frames stamped when they arrive", "kinect", {"stamp_jitter"}, _jitter("kinect", 0.3))
add("bursts", "encoder", {"bursts", "stamp_jitter"}, _burst)

for channel in ("kinect", "imu", "torque", "encoder"):
    for offset in (0.6, -2.0):
        add(f"clock of {channel} off by {offset} s", channel, {"clock_offset"},
            stamps(channel, lambda t, d=offset: t + d))
for channel, rate in (("kinect", 0.04), ("kinect", -0.05), ("imu", 0.05)):
    add(f"clock of {channel} {100 * rate:g} % fast", channel, {"clock_drift"},
        stamps(channel, lambda t, r=rate: t * (1 + r)))
for channel in ("kinect", "imu", "torque"):
    add(f"clock of {channel} jumps", channel, {"clock_jump"},
        stamps(channel, lambda t: np.where(t > 0.5 * t[-1], t + 1.5, t)), every=False)
for unit, factor in {"ms": 1e3, "us": 1e6}.items():
    add(f"stamps of the camera in {unit}", "kinect", {"time_unit"}, stamps("kinect", lambda t, k=factor: t * k))
    add(f"stamps of the encoder in {unit}", "encoder", {"time_unit"}, stamps("encoder", lambda t, k=factor: t * k))
add("camera stamped since 1970", "kinect", {"epoch_stamps", "clocks_disjoint", "time_unit"},
    stamps("kinect", lambda t: t + 1.7e9))
add("camera's clock elsewhere", "kinect", {"clocks_disjoint", "epoch_stamps"}, stamps("kinect", lambda t: t + 500.0))


def _jump(folder, other):
    table = folder.tables["kinect"][1]
    table[len(table) // 2 :, 1:3] += [0.5, 0.35]


def _outliers(folder, other):
    table = folder.tables["kinect"][1]
    for i in np.linspace(5, len(table) - 6, 4).astype(int):
        table[i, 1:3] += [0.6, -0.5]


def _carried(folder, other):
    table = folder.tables["kinect"][1]
    t = (table[:, 0] - table[0, 0]) / (table[-1, 0] - table[0, 0])
    share = np.clip((t - 0.5) / 0.07, 0.0, 1.0)
    centre, turn = table[len(t) // 2, 1:3].copy(), 1.0 * share
    away = table[:, 1:3] - centre
    c, s = np.cos(turn), np.sin(turn)
    table[:, 1] = centre[0] + c * away[:, 0] - s * away[:, 1] + 0.6 * share
    table[:, 2] = centre[1] + s * away[:, 0] + c * away[:, 1] - 0.5 * share
    table[:, 3] += turn


def _lifted(folder, other):
    table = folder.tables["encoder"][1]
    t = table[:, 0] - table[0, 0]
    spun = np.clip(t - 0.5 * t[-1], 0.0, 1.5)
    table[:, 1:] += spun[:, None] * np.linspace(9.0, 13.0, table.shape[1] - 1)


def _foreign(channel):
    def change(folder, other):
        folder.tables[channel] = folder.tables[channel][0], other.tables[channel][1].copy()
    return change


add("camera jumps", "kinect", {"camera_jump", "robot_carried"}, _jump, every=False)
add("camera outliers", "kinect", {"camera_outliers"}, _outliers, every=False)
add("robot carried", "kinect", {"robot_carried", "robot_lifted", "camera_jump"}, _carried, every=False)
add("robot lifted", "encoder", {"robot_lifted", "robot_carried"}, _lifted, every=False)
for channel in ("kinect", "encoder"):
    add(f"{channel} of another run", channel, {"channel_of_another_run", "another_robot", "clocks_disjoint"},
        _foreign(channel), every=False)
add("a robot with wheels elsewhere", "encoder", {"another_robot", "counts_per_turn", "wheel_order"},
    columns("encoder", lambda t, v: v @ (np.eye(v.shape[1]) + 1.5 * np.eye(v.shape[1])[::-1]).T))


def _every(channel, count):
    """The first of every so many rows."""
    def change(folder, other):
        names, table = folder.tables[channel]
        folder.tables[channel] = names, table[::count]
    return change


def _on_one_clock(folder, other):
    """Fixes interpolated at 100 Hz."""
    names, table = folder.tables["kinect"]
    t = np.arange(table[0, 0], table[-1, 0], 0.01)
    folder.tables["kinect"] = names, np.column_stack([t, *(np.interp(t, table[:, 0], c) for c in table[:, 1:].T)])


def _course(t, v):
    way = np.gradient(v[:, :2], axis=0)
    v[:, 2] = np.arctan2(way[:, 1], way[:, 0])
    return v


for channel, robots in (("torque", ()), ("imu", ("pendulum",))):
    add(f"one of two samples of {channel}", channel, {"undersampled"}, _every(channel, 2), robots=robots)
add("fixes interpolated at 100 Hz", "kinect", {"samples_interpolated"}, _on_one_clock)
add("headings from places", "kinect", {"heading_is_course"}, columns("kinect", _course))
