"""Columns of numbers from the messages of MCAP files and of ROS 1 and ROS 2 bags. Needs the extra [logs]."""

import json
import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from drake_ispace.blocks.errors import InputError, expected_one_of, shown
from drake_ispace.logs.series import Series

SUFFIXES = (".mcap", ".bag", ".db3")
LOG_TIME = "log_time"  # [s] at which a message was written
_LARGEST_RECORD = 1 << 28  # bytes
_PART = re.compile(r"(\w+)((?:\[[^\[\]]+\])*)")


@dataclass(frozen=True)
class Topic:
    """What a bag holds of a topic: its kind of message, how many there are, and the numbers in the first one."""

    kind: str
    count: int
    numbers: dict[str, float]


def is_bag(path: Path) -> bool:
    """Whether a path is a bag: a file of that name, or the folder of a ROS 2 bag."""
    return path.suffix in SUFFIXES or (path / "metadata.yaml").is_file()


def read_bag(path: Path, topic: str, wanted: Sequence[str], tell: Callable[[int], None] = lambda read: None) -> Series:
    """A column for each path to a number in the messages of a topic, NaN where a message has none.

    Args:
        wanted: such as pose.pose.position.x, position[left_wheel] (the joint of that name), ranges[3],
            transforms[odom>base].transform.translation.x, header.stamp [s] or log_time [s].
        tell: called with the number of messages read.

    Raises:
        InputError: no such file or topic, a damaged or unfinished file, or a path that leads to no number.
    """
    rows: list[list[float]] = []
    columns: list[np.ndarray] = []
    topics: set[str] = set()
    for name, _, log_time_s, message in _messages(path, {topic}, topics):
        rows.append([_number(message, log_time_s, field, f"{path}: {name}") for field in wanted])
        if len(rows) == 1 << 14:
            columns.append(np.array(rows))
            tell(sum(map(len, columns)))
            rows = []
    if not columns and not rows:
        raise InputError(f"{path}: there is no topic {shown(topic)} with messages, {expected_one_of(topic, topics)}")
    values = np.vstack([*columns, *([np.array(rows)] if rows else [])])
    return Series({field: values[:, i] for i, field in enumerate(wanted)})


def topics_of(path: Path) -> dict[str, Topic]:
    """Name -> what there is of each topic.

    Raises:
        InputError: as `read_bag`.
    """
    found: dict[str, Topic] = {}
    for name, kind, log_time_s, message in _messages(path, None, set()):
        if name in found:
            found[name] = Topic(found[name].kind, found[name].count + 1, found[name].numbers)
        else:
            found[name] = Topic(kind, 1, {LOG_TIME: log_time_s, **_numbers(message)})
    return found


def _messages(path: Path, wanted: set[str] | None, topics: set[str]) -> Iterator[tuple[str, str, float, object]]:
    """(topic, kind, time of writing [s], message) of every message on the wanted topics; adds all names to `topics`."""
    if not path.exists():
        raise InputError(f"{path}: expected a bag, there is none")
    try:
        import mcap  # noqa: F401
        import rosbags  # noqa: F401
    except ImportError:
        raise InputError(f"{path}: bags need the extra [logs], expected `pip install drake_ispace[logs]`") from None
    with _sentences(path):
        yield from (_mcap if path.suffix == ".mcap" else _ros)(path, wanted, topics)


@contextmanager
def _sentences(path):
    """Libraries raise whatever a damaged file makes them stumble over."""
    try:
        yield
    except (InputError, GeneratorExit):
        raise
    except Exception as error:
        said = (str(error).strip() or type(error).__name__).splitlines()[0]
        raise InputError(f"{path}: cannot be read, expected a whole bag ({shown(said, 120)})") from None


def _mcap(path, wanted, topics):
    """Read from start to end, every checksum compared, the number of messages with what the file says."""
    from mcap.records import Channel, Message, Schema

    schemas, channels, decode = {}, {}, {}
    for record in _records(path):
        if isinstance(record, Schema):
            schemas[record.id] = record
        elif isinstance(record, Channel):
            channels[record.id] = record
            topics.add(record.topic)
        elif isinstance(record, Message):
            channel = channels[record.channel_id]
            if wanted is None or channel.topic in wanted:
                if channel.id not in decode:
                    decode[channel.id] = _decoder(channel, schemas.get(channel.schema_id), path)
                kind, read = decode[channel.id]
                yield channel.topic, kind, record.log_time * 1e-9, read(record.data)


def _records(path):
    """The records of an MCAP file up to the end of its data."""
    from mcap.records import Chunk, DataEnd, Footer, Message, Statistics
    from mcap.stream_reader import StreamReader, breakup_chunk

    counted, told, ended, over = 0, None, False, False
    with path.open("rb") as stream:
        reader = StreamReader(stream, emit_chunks=True, validate_crcs=True, record_size_limit=_LARGEST_RECORD)
        for record in reader.records:
            if isinstance(record, Statistics):
                told = record.message_count
            over = over or isinstance(record, DataEnd)
            ended = ended or isinstance(record, Footer)
            for inner in breakup_chunk(record, validate_crc=True) if isinstance(record, Chunk) else [record]:
                counted += isinstance(inner, Message)
                if not over:
                    yield inner
    if not ended or (told is not None and told != counted):
        raise InputError(f"{path}: holds {counted} messages of {told}, expected a whole file")


def is_sealed(path: Path) -> bool:
    """Whether every message of a bag stands under a checksum; without one, a damaged byte may go unnoticed.

    Raises:
        InputError: as `read_bag`.
    """
    if path.suffix != ".mcap":
        return False
    from mcap.records import Chunk, DataEnd, Message
    from mcap.stream_reader import StreamReader

    with _sentences(path), path.open("rb") as stream:
        bare = False
        for record in StreamReader(stream, emit_chunks=True, record_size_limit=_LARGEST_RECORD).records:
            bare = bare or isinstance(record, Message) or (isinstance(record, Chunk) and not record.uncompressed_crc)
            if isinstance(record, DataEnd):
                return not bare or bool(record.data_section_crc)
    return False


def _decoder(channel, schema, path):
    """(kind of message, function from bytes to the message) of an MCAP channel."""
    if channel.message_encoding == "json":
        return (schema.name if schema else "json"), json.loads
    if schema is None or (channel.message_encoding, schema.encoding) not in (("cdr", "ros2msg"), ("ros1", "ros1msg")):
        raise InputError(
            f"{path}: {channel.topic} is encoded as {shown(channel.message_encoding)}, expected cdr, ros1 or json"
        )
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.EMPTY)
    name = schema.name if schema.name.count("/") > 1 else schema.name.replace("/", "/msg/")
    store.register(get_types_from_msg(schema.data.decode(), name))
    read = store.deserialize_cdr if channel.message_encoding == "cdr" else store.deserialize_ros1
    return schema.name, lambda data: read(data, name)


def _ros(path, wanted, topics):
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores, get_typestore

    folder = path.parent if path.suffix == ".db3" else path
    with AnyReader([folder], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader:
        topics |= set(reader.topics)
        chosen = [one for one in reader.connections if wanted is None or one.topic in wanted]
        counted = 0
        for connection, stamp, data in reader.messages(connections=chosen) if chosen else ():
            counted += 1
            yield connection.topic, connection.msgtype, stamp * 1e-9, reader.deserialize(data, connection.msgtype)
        told = sum(one.msgcount for one in chosen)
        if told != counted:
            raise InputError(f"{path}: holds {counted} messages of {told}, expected a whole bag")


def _number(message, log_time_s, field, where):
    """The number at a path in a message."""
    if field == LOG_TIME:
        return log_time_s
    value = message
    for part in _split(field, where):
        value = _child(value, part)
        if value is None:
            return np.nan
    if _is_stamp(value):
        return _seconds(value)
    if isinstance(value, bool | np.bool_) or not isinstance(value, int | float | np.number):
        raise InputError(f"{where}: {field} is no number, expected the path of one")
    return float(value)


def _split(field, where):
    """Names and, as ("key", text), what stands in brackets."""
    parts = []
    for word in re.split(r"\.(?![^\[]*\])", field):
        match = _PART.fullmatch(word)
        if match is None:
            raise InputError(f"{where}: {shown(field)}: expected a path such as pose.position.x or position[name]")
        parts.append(match[1])
        parts += [("key", key) for key in re.findall(r"\[([^\[\]]+)\]", match[2])]
    return parts


def _child(value, part):
    """The part of a message by name, by index, by the name of a joint, or by the frames of a transform; else None.

    A list of numbers is told by the names beside it: `position` of a message with `name`.
    """
    if isinstance(part, str):
        found = value.get(part) if isinstance(value, dict) else getattr(value, part, None)
        names = value.get("name") if isinstance(value, dict) else getattr(value, "name", None)
        is_list = isinstance(found, list | np.ndarray) and isinstance(names, list | np.ndarray)
        return _Named(found, names) if is_list and found is not names else found
    key = part[1]
    if isinstance(value, _Named):
        if key in value.names:
            return _at(value.values, list(value.names).index(key))
        value = value.values
    if ">" in key:
        parent, child = (frame.strip().lstrip("/") for frame in key.split(">", 1))
        for one in value if isinstance(value, list | np.ndarray) else ():
            frames = _child(_child(one, "header"), "frame_id"), _child(one, "child_frame_id")
            if tuple(str(frame).lstrip("/") for frame in frames) == (parent, child):
                return one
        return None
    return _at(value, int(key)) if key.isdecimal() and isinstance(value, list | np.ndarray | tuple) else None


@dataclass(frozen=True)
class _Named:
    """A list of numbers and the names of its entries."""

    values: list
    names: list


def _at(values, index):
    return values[index] if index < len(values) else None


def _is_stamp(value):
    return all(_child(value, part) is not None for part in ("sec", "nanosec")) or all(
        _child(value, part) is not None for part in ("secs", "nsecs")
    )


def _seconds(value):
    whole, rest = _child(value, "sec"), _child(value, "nanosec")
    if whole is None or rest is None:
        whole, rest = _child(value, "secs"), _child(value, "nsecs")
    return float(whole) + 1e-9 * float(rest)


def _numbers(message, path="", depth=0) -> dict[str, float]:
    """Path -> number, of all numbers in a message that is no larger than a few hundred of them."""
    if depth > 6:
        return {}
    if path and _is_stamp(message):
        return {path: _seconds(message)}
    if isinstance(message, bool | np.bool_ | str | bytes):
        return {}
    if isinstance(message, int | float | np.number):
        return {path: float(message)}
    found: dict[str, float] = {}
    if isinstance(message, list | np.ndarray | tuple):
        for i, one in enumerate(message[:64]):
            found |= _numbers(one, f"{path}[{i}]", depth + 1)
        return found
    names = list(message) if isinstance(message, dict) else [
        name for name in getattr(message, "__dataclass_fields__", {}) if not name.startswith("__")
    ]
    labels = _child(message, "name") if "name" in names else None
    for name in names:
        one = message[name] if isinstance(message, dict) else getattr(message, name)
        inner = f"{path}.{name}" if path else name
        if isinstance(labels, list | np.ndarray) and isinstance(one, list | np.ndarray) and one is not labels:
            for label, value in zip(labels, one, strict=False):
                found |= _numbers(value, f"{inner}[{label}]", depth + 1)
        else:
            found |= _numbers(one, inner, depth + 1)
    return found
