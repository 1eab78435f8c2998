"""The mapping file: which column of which log is what, in which unit, on which clock."""

from dataclasses import dataclass, field
from pathlib import Path

from drake_ispace.blocks.errors import InputError, expected_one_of, shown
from drake_ispace.files.quantity import quantity
from drake_ispace.files.recording import CHANNEL_COLUMNS, CHANNELS, PER_WHEEL
from drake_ispace.files.typed_tree import read
from drake_ispace.files.units import conversion, si_unit
from drake_ispace.files.yaml_guard import load_yaml
from drake_ispace.robots.robot_file import STEERED, RobotFile, read_robot, robot_of

FORMAT = "drake-ispace-mapping/1"
ROBOTS_CLOCK = "robot"
_LONGEST_OFFSET_S = 1e11


@dataclass
class Source:
    """Where the numbers of a column of a recording come from.

    Attributes:
        column: of the log; of a ROS message the path of a field, such as pose.pose.position.x or position[left_wheel].
        quaternion: instead of `column`, four columns x, y, z, w whose yaw is wanted.
    """

    column: str = quantity("")
    quaternion: list[str] | None = quantity(None, length=4)
    # of the numbers in the log; "": SI
    unit: str = quantity("")
    # instead of a unit: encoder counts of a whole turn of the wheel
    counts_per_turn: float | None = quantity(None, above=0.0)
    # numbers after which a counter starts again
    wraps_at: float | None = quantity(None, above=0.0)
    # whether each row holds the counts, or the angle, since the row before
    increments: bool = quantity(False)
    # -1 turns the sign over
    sign: float = quantity(1.0, minimum=-1.0, maximum=1.0)


@dataclass
class ChannelMap:
    """A channel of the recording.

    Attributes:
        file: its log, in the folder of the run. topic: in a bag. t: its time. columns: name in the recording ->
            Source.
    """

    file: str = quantity("")
    topic: str = quantity("")
    delimiter: str = quantity("")
    decimal: str = quantity("", choices=("", ".", ","))
    # name of the clock that stamped the log
    clock: str = quantity(ROBOTS_CLOCK)
    t: Source = field(default_factory=Source)
    columns: dict[str, Source] = field(default_factory=dict)


@dataclass
class Clock:
    """A clock other than the robot's.

    Attributes:
        offset_s: what it shows less what the robot's shows at the same instant [s]; None: estimated from the motion.
    """

    offset_s: float | None = None


@dataclass
class Mapping:
    """A mapping file, checked.

    Attributes:
        where: its path. robot: what it says of the robot. channels: of the recording, by name. clocks: by name.
    """

    where: str
    robot: RobotFile
    channels: dict[str, ChannelMap]
    clocks: dict[str, Clock]
    notes: str = ""


def load_mapping(path: Path) -> Mapping:
    """The mapping in a YAML file.

    Raises:
        InputError: an unknown key, a channel or column that recordings do not have, a unit that does not fit, or a
            clock that nothing can be compared with.
    """
    where, data = str(path), load_yaml(path, str(path))
    known = ("format", "robot", "channels", "clocks", "notes")
    for key in data:
        if key not in known:
            raise InputError(f"{where}: {shown(key)}: unknown key, {expected_one_of(key, known)}")
    if data.get("format") != FORMAT:
        raise InputError(f"{where}: format is {shown(data.get('format'))}, expected {FORMAT}")
    robot = data.get("robot")
    robot = robot_of(path.parent / robot) if isinstance(robot, str) else read_robot(robot, f"{where}: robot")
    channels = _section(data, "channels", where)
    if not channels:
        raise InputError(f"{where}: channels: expected at least one, such as encoder")
    mapping = Mapping(
        where, robot, {name: _channel(name, entry, where, robot) for name, entry in channels.items()},
        {name: _clock(entry, f"{where}: clocks.{name}") for name, entry in _section(data, "clocks", where).items()},
        str(data.get("notes") or ""),
    )
    used = {channel.clock for channel in mapping.channels.values()}
    for name in mapping.clocks:
        if name not in used:
            raise InputError(f"{where}: clocks.{name}: no channel has this clock, {expected_one_of(name, used)}")
    return mapping


def _section(data, key, where):
    section = data.get(key) or {}
    if not isinstance(section, dict) or not all(isinstance(name, str) for name in section):
        raise InputError(f"{where}: {key}: expected a mapping of names, got {shown(section)}")
    return section


def _clock(data, where):
    """A Clock of plain data; an offset may be the 1.7e9 s since 1970, more than any size of a robot."""
    known = Clock().__dict__
    for key in data if isinstance(data, dict) else ():
        if key not in known:
            raise InputError(f"{where}: {shown(key)}: unknown key, {expected_one_of(key, known)}")
    offset = data.get("offset_s") if isinstance(data, dict) else data
    is_number = isinstance(offset, int | float) and not isinstance(offset, bool) and abs(offset) < _LONGEST_OFFSET_S
    if not isinstance(data, dict) or not (offset is None or is_number):
        raise InputError(f"{where}: expected offset_s in seconds, or null for an estimate, got {shown(offset)}")
    return Clock(None if offset is None else float(offset))


def _channel(name, data, where, robot):
    place = f"{where}: channels.{name}"
    if name not in CHANNELS:
        raise InputError(f"{place}: unknown channel, {expected_one_of(name, CHANNELS)}")
    if not isinstance(data, dict):
        raise InputError(f"{place}: expected a mapping with file, t and columns, got {shown(data)}")
    plain = {key: value for key, value in data.items() if key not in ("t", "columns")}
    channel = read(ChannelMap(), plain, place)
    if not channel.file:
        raise InputError(f"{place}: file: expected the name of a log")
    channel.t = _source(data.get("t"), f"{place}.t", "t")
    channel.columns = {
        column: _source(source, f"{place}.columns.{column}", column)
        for column, source in _section(data, "columns", place).items()
    }
    wheels = tuple(wheel.name for wheel in robot.wheels)
    if name == "encoder" and robot.keys.kind == "tricycle":
        wanted = STEERED
    elif name in PER_WHEEL:
        wanted = tuple(PER_WHEEL[name] + wheel for wheel in wheels)
    else:
        wanted = CHANNEL_COLUMNS[name]
    for column in wanted:
        if column not in channel.columns and not (column == "vy" and robot.keys.kind in ("differential", "tricycle")):
            raise InputError(f"{place}.columns: {column} is missing, expected {', '.join(wanted)}")
    extra = {"kinect": ("t_received",)}.get(name, ())
    for column in channel.columns:
        if column not in (*wanted, *extra):
            raise InputError(f"{place}.columns.{column}: unknown column, {expected_one_of(column, (*wanted, *extra))}")
    return channel


def alike(column: str) -> str:
    """The column of recordings with the unit of this one: no recording has a steering angle, a heading is one too."""
    return "phi" if column == STEERED[1] else column


def _source(data, where, column):
    source = read(Source(), {"column": data} if isinstance(data, str) else data or {}, where)
    if bool(source.column) == (source.quaternion is not None):
        raise InputError(f"{where}: expected the name of a column, or a quaternion of four")
    if source.quaternion is not None and column != "phi":
        raise InputError(f"{where}: expected a column, only phi may come from a quaternion")
    if source.unit and source.counts_per_turn is not None:
        raise InputError(f"{where}: expected a unit or counts_per_turn, got both")
    if source.unit:
        conversion(alike(column), source.unit, where)
    if source.sign not in (-1.0, 1.0):
        raise InputError(f"{where}: sign is {source.sign:g}, expected 1 or -1")
    if source.counts_per_turn is not None and si_unit(alike(column)) != "rad":
        raise InputError(f"{where}: counts_per_turn: expected for angles only")
    return source
