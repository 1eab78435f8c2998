"""Proposals for a mapping file: what each column of some logs may be, each guess with its reason.

What is seen are wheels, positions, an IMU and commanded velocities. Tables of which nothing is used are said.
"""

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from drake_ispace.blocks.errors import InputError
from drake_ispace.logs.bags import LOG_TIME, is_bag, read_bag, topics_of
from drake_ispace.logs.mapping import FORMAT
from drake_ispace.logs.series import numeric_columns, read_series, shape_of, unwrapped

_TIME = re.compile(r"^(t|time|stamp|timestamp|zeit|secs?|header\.stamp|log_time)([_.\[ (].*)?$|_(time|stamp)$", re.I)
_SIDES = {
    "right": re.compile(r"(^|[^a-z])(right|rechts|droite?|derecha|r)([^a-z]|$)", re.I),
    "left": re.compile(r"(^|[^a-z])(left|links|gauche|izquierda|l)([^a-z]|$)", re.I),
}
_WHEEL = re.compile(r"wheel|enc|tick|count|pos(ition)?\[|theta|joint|^(right|left|rechts|links)$", re.I)
_RATE = re.compile(r"vel|speed|effort|rate", re.I)
_YAW = re.compile(r"(^|[._ ])(yaw|phi|theta|heading|psi)([_.\[ (]|$)", re.I)
#: Channels whose columns are known by their names alone: column -> what the name of a log ends in.
_KNOWN = {
    "imu": {
        **{f"a{axis}": (f"linear_acceleration.{axis}", f"a{axis}", f"acc_{axis}") for axis in "xyz"},
        **{f"w{axis}": (f"angular_velocity.{axis}", f"w{axis}", f"g{axis}", f"gyro_{axis}") for axis in "xyz"},
    },
    "command": {
        "vx": ("twist.linear.x", "linear.x", "linear_x", "vx", "v"),
        "vy": ("twist.linear.y", "linear.y", "linear_y", "vy"),
        "wz": ("twist.angular.z", "angular.z", "angular_z", "wz", "omega"),
    },
}
_MAY_LACK = "vy"  # of a robot that cannot go aside
_TIME_UNITS = {"s": 1.0, "ms": 1e3, "us": 1e6, "ns": 1e9}
_EPOCH_S = 5e8, 5e9  # seconds since 1970 lie between
_STEP_S = 1e-4, 2.0  # between rows of a log
_SAME_CLOCK_S = 30.0  # by which logs of a run may begin apart


@dataclass(frozen=True)
class Guess:
    """A proposed line: key of the mapping, its value, and why."""

    key: str
    value: str
    reason: str


@dataclass(frozen=True)
class Time:
    """The proposed column of time, its unit, and why."""

    column: str
    unit: str
    reason: str

    @property
    def value(self) -> str:
        return f"{{column: {_quoted(self.column)}, unit: {self.unit}}}"

    def first_s(self, columns) -> float:
        """The first time of a log [s]."""
        values = columns[self.column]
        return float(values[np.isfinite(values)][0]) / _TIME_UNITS[self.unit]


def sniff(files: list[Path]) -> str:
    """The text of a mapping file for logs of one run, for its reader to correct.

    Raises:
        InputError: a log that cannot be read, or logs in which neither wheels nor positions are seen.
    """
    channels: dict[str, list[str]] = {}
    wheels: list[str] = []
    stamps: dict[str, float] = {}
    passed_over: list[str] = []
    for file in files:
        for topic, names, columns, remark in _tables(file):
            found = _channel(names, columns)
            if found is None or found[0] in channels or "odom" in topic:  # what wheels say of a place is no position
                where = f"{file.name}, {topic}" if topic else file.name
                passed_over.append(f"# passed over: {where}, with {', '.join(names[:8])}{', ...' * (len(names) > 8)}")
                continue
            channel, time, guesses, own = found
            wheels, stamps[channel] = own or wheels, time.first_s(columns)
            lines = [f"  {channel}:", f"    file: {file.name}{remark}"]
            lines += [f"    topic: {topic}"] if topic else []
            lines += [f"    t: {time.value:44} # {time.reason}", "    columns:"]
            channels[channel] = lines + [f"      {g.key}: {g.value:44} # {g.reason}" for g in guesses]
    other_clock = stamps.keys() >= {"kinect", "encoder"} and abs(stamps["kinect"] - stamps["encoder"]) > _SAME_CLOCK_S
    if other_clock:
        channels["kinect"].insert(1, "    clock: camera   # its times are far from those of the wheels: see clocks")
    if not channels:
        raise InputError(f"{', '.join(map(str, files))}: no wheels and no positions seen, expected columns of numbers")
    lines = [
        f"format: {FORMAT}", "# Proposed from the logs. Read it, and correct what is wrong.", "robot:",
        "  name: my_robot", "  kind: differential          # differential | omni | mecanum | tricycle | listed",
        "  wheel_diameter_m: 0.1        # CORRECT THIS (or wheel_radius_m)",
        "  track_m: 0.3                 # CORRECT THIS: from wheel to wheel (or half_track_m)",
        f"  wheels: [{', '.join(wheels or ['right', 'left'])}]", "channels:",
        *(line for block in channels.values() for line in block),
    ]
    if other_clock:
        lines += ["clocks:", "  camera: {offset_s: null}     # null: estimated from the motion; or what it is ahead by"]
    return "\n".join(lines + passed_over) + "\n"


def _tables(file):
    """(topic, names, name -> numbers, remark) of every table in a log."""
    if is_bag(file):
        for name, topic in topics_of(file).items():
            names = list(topic.numbers)
            if names:
                yield name, names, read_bag(file, name, names).columns, f"   # {topic.count} of {topic.kind}"
        return
    if file.suffix == ".parquet":
        columns = read_series(file).columns
        yield "", list(columns), columns, ""
        return
    shape = shape_of(file)
    numeric = numeric_columns(file, shape) if shape.header else None
    remark = f"   # {'white space' if shape.delimiter == ' ' else repr(shape.delimiter)} between cells" + (
        ", decimal commas" if shape.decimal == "," else ""
    )
    columns = read_series(file, numeric, shape).columns
    yield "", list(columns), columns, remark


def _channel(names, columns):
    """(channel, Time, guesses of its columns, names of wheels), or None."""
    time = _time(names, columns)
    if time is None:
        return None
    rest = [name for name in names if name != time.column and not _TIME.search(name)]
    pose = _pose(rest, columns)
    wheels = [] if pose else _wheels(rest, columns)
    for channel, endings in _KNOWN.items() if not pose else ():
        chosen = {key: _ending(rest, ends) for key, ends in endings.items()}
        if all(name or (key == _MAY_LACK and not wheels) for key, name in chosen.items()):
            pairs = [(key, name) for key, name in chosen.items() if name]
            return channel, time, [Guess(key, f"{{column: {_quoted(name)}}}", "by its name") for key, name in pairs], []
    if pose:
        return "kinect", time, pose, []
    if wheels:
        return "encoder", time, wheels, [guess.key.removeprefix("theta_") for guess in wheels]
    return None


def _ending(names, endings):
    """The first name that ends so, None if there is none."""
    return next((name for end in endings for name in names if f".{name.lower()}".endswith(f".{end}")), None)


def _time(names, columns):
    named = [name for name in names if _TIME.search(name)] or names
    best = next((name for name in sorted(named, key=lambda n: n == LOG_TIME) if _increases(columns[name])), None)
    if best is None:
        return None
    values = columns[best][np.isfinite(columns[best])]
    step, first = float(np.median(np.diff(values))), float(values[0])
    for unit, factor in _TIME_UNITS.items():
        if _EPOCH_S[0] < first / factor < _EPOCH_S[1]:
            return Time(best, unit, f"rises; {unit} since 1970")
    for unit, factor in _TIME_UNITS.items():
        if _STEP_S[0] <= step / factor <= _STEP_S[1]:
            return Time(best, unit, f"rises by {step:g} a row, in {unit} {factor / step:.3g} Hz")
    return None


def _increases(values):
    values = values[np.isfinite(values)]
    steps = np.diff(values)
    return len(values) > 2 and bool((steps >= 0.0).all() and (steps > 0.0).mean() > 0.5)


def _pose(names, columns):
    x, y = (next((n for n in names if _last(n) == axis and "orientation" not in n and "q" not in _last(n)), None)
            for axis in ("x", "y"))
    if x is None or y is None:
        return []
    size = max(np.nanmax(np.abs(columns[x])), np.nanmax(np.abs(columns[y])))
    unit, why = ("mm", f"up to {size:.0f}: millimetres") if size > 50.0 else ("m", f"up to {size:.2f}: metres")
    guesses = [Guess(axis, f"{{column: {_quoted(name)}, unit: {unit}}}", why) for axis, name in (("x", x), ("y", y))]
    quaternion = _quaternion(names, columns)
    yaw = next((n for n in names if _YAW.search(n)), None)
    if quaternion:
        text = ", ".join(map(_quoted, quaternion))
        guesses.append(Guess("phi", f"{{quaternion: [{text}]}}", "four columns of length 1"))
    elif yaw:
        size = np.nanmax(np.abs(columns[yaw]))
        unit = "deg" if size > 6.5 and not _turns_in_rad(columns[yaw]) else "rad"
        guesses.append(Guess("phi", f"{{column: {_quoted(yaw)}, unit: {unit}}}", f"up to {size:.3g}"))
    else:
        return []
    return guesses


def _turns_in_rad(values):
    """Whether headings that go on counting beyond a turn are in rad: no row steps by more than a radian."""
    return bool(np.nanmax(np.abs(np.diff(values))) < 1.0) and np.nanmax(np.abs(values)) < 60.0


def _quaternion(names, columns):
    sets = [("qx", "qy", "qz", "qw"), ("orientation.x", "orientation.y", "orientation.z", "orientation.w"),
            ("rotation.x", "rotation.y", "rotation.z", "rotation.w")]
    for ends in sets:
        chosen = [next((n for n in names if n.lower().endswith(end)), None) for end in ends]
        if all(chosen):
            length = np.sqrt(sum(columns[name] ** 2 for name in chosen))
            if np.nanmax(np.abs(length - 1.0)) < 0.05:
                return chosen
    return None


def _wheels(names, columns):
    """Guesses for columns that look like wheels: counters, or angles."""
    moving = [name for name in names if np.nanmax(columns[name]) > np.nanmin(columns[name])]
    chosen = [name for name in moving if _WHEEL.search(name) and not _RATE.search(name)]
    sides = {side: [n for n in chosen if mark.search(n)] for side, mark in _SIDES.items()}
    if all(len(own) == 1 for own in sides.values()):
        pairs = [(own[0], side) for side, own in sides.items()]
    elif len(chosen) == 2:
        pairs = list(zip(chosen, _SIDES, strict=True))
    elif len(chosen) >= 3:
        pairs = [(name, str(i + 1)) for i, name in enumerate(chosen)]
    else:
        return []
    whole = {name: _went_on(columns[name][np.isfinite(columns[name])]) for name, _ in pairs}
    rises = {name: values[-1] - values[0] for name, values in whole.items()}
    rise = max(rises.values(), key=abs)
    guesses = []
    for name, wheel in pairs:
        values, text, reason = columns[name][np.isfinite(columns[name])], f"column: {_quoted(name)}", ""
        if (values == np.round(values)).all():
            wraps = _wraps(values)
            text += ", counts_per_turn: 2048" + (f", wraps_at: {wraps:g}" if wraps else "")
            again = f" that start again at {wraps:g}" if wraps else ""
            reason = f"whole numbers{again}: CORRECT counts_per_turn"
        else:
            unit = "deg" if np.abs(np.diff(values)).max() > 3.0 else "rad"
            text, reason = f"{text}, unit: {unit}", "an angle"
        if len(pairs) == 2 and np.sign(rises[name]) == -np.sign(rise) != 0.0:
            text, reason = f"{text}, sign: -1", f"{reason}; it falls while the other one rises"
        guesses.append(Guess(f"theta_{wheel}", f"{{{text}}}", reason))
    return guesses


def _went_on(values):
    """A counter as if it did not start again."""
    wraps = _wraps(values)
    return unwrapped(values, wraps) if wraps else values


def _wraps(values):
    """After how many counts a counter starts again, 0 if it does not seem to."""
    largest = np.abs(np.diff(values)).max(initial=0.0)
    for bits in (8, 12, 16, 32):
        if 0.5 * 2**bits < largest <= 2**bits:
            return float(2**bits)
    return 0.0


def _last(name):
    return re.sub(r"[\[(_ ].*$", "", name.rsplit(".", 1)[-1]).lower()


def _quoted(name):
    return name if re.fullmatch(r"[A-Za-z_][\w.]*", name) else f'"{name}"'
