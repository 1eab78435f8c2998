"""Importers under attack: mapping and robot files, tables of any shape, and MCAP files and ROS bags."""

import csv
import importlib.util
import math

import numpy as np

from drake_ispace.logs.bags import read_bag
from drake_ispace.logs.mapping import load_mapping
from drake_ispace.logs.series import read_series, shape_of
from drake_ispace.logs.sniff import sniff
from drake_ispace.robots.robot_file import robot_of
from fuzz.mutate import damaged, rewritten
from fuzz.reader import Reader, Silent, YamlFile, written

FIELDS = ["header.stamp", "position[left]", "position[1]", "log_time"]


class MappingFile(YamlFile):
    """A mapping file."""

    SEEDS = (
        "format: drake-ispace-mapping/1\nrobot: {kind: differential, wheel_diameter_m: 0.1, track_m: 0.3}\nchannels:\n"
        "  encoder:\n    file: wheels.csv\n    delimiter: \";\"\n    t: {column: ms, unit: ms}\n    columns:\n"
        "      theta_right: {column: r, counts_per_turn: 4096, wraps_at: 65536, sign: -1}\n      theta_left: l\n"
        "  kinect:\n    file: a.mcap\n    topic: /pose\n    clock: camera\n    t: header.stamp\n    columns:\n"
        "      x: {column: x, unit: mm}\n      y: {column: y, unit: mm}\n      phi: {quaternion: [a, b, c, d]}\n"
        "clocks: {camera: {offset_s: 1.7e9}}\nnotes: carpet\n",
    )

    def attack(self, given):
        mapping = load_mapping(written(self.folder / "hostile.yaml", given))
        for channel in mapping.channels.values():
            sources = channel.columns.values()
            if not channel.file or not sources or not all(one.column or one.quaternion for one in sources):
                raise Silent("a channel without a source")


class RobotYaml(YamlFile):
    """A robot file."""

    SEEDS = (
        "name: cart\nkind: differential\nwheel_diameter_m: 0.1\ntrack_m: 0.3\nwheels: [right, left]\n",
        "kind: omni\nwheel_radius_m: 0.05\ncentre_distance_m: 0.2\nangles_deg: [60, 130, 230, 300]\n"
        "forward_turns: clockwise\n",
        "kind: mecanum\nwheel_diameter_m: 0.1\ntrack_m: 0.4\nwheelbase_m: 0.5\ncounts_per_turn: 2048\n",
        "kind: listed\nwheels:\n  a: {x_m: 0.1, y_m: 0.2, tyre: true}\n  b: {y_m: -0.2, drive_deg: 10, tyre: true}\n",
    )

    def attack(self, given):
        robot = robot_of(written(self.folder / "hostile.yaml", given))
        if not np.isfinite(robot.geometry.forward).all():
            raise Silent("wheels that make no motion")
        robot.scenario(), robot.cannot(), robot.doubts()


class LogTable(Reader):
    """A CSV file of any shape. What is read is what Python's own reader finds at these places."""

    SEEDS = (
        "t,a,b\n0.0,1.5,-2\n0.1,2.5,3e2\n0.2,,4\n", "ms;x;y\n0;1,5;-2\n10;2,5;3\n20;3,5;4\n",
        "# by a logger\n0.0 1.5 -2\n0.1 2.5 3e2\n0.2 3.5 4\n", 't\t"a b"\n0\t1\n1\t2\n',
    )

    def input(self, source):
        return rewritten(source.choice(self.SEEDS), source)

    def attack(self, given):
        file = written(self.folder / "log.csv", given)
        shape = shape_of(file)
        series = read_series(file, None, shape)
        names, rows = list(series.columns), self._rows(given, shape)
        if len(rows) != len(series):
            raise Silent("another number of rows")
        for i, row in enumerate(rows):
            for name, cell in zip(names, row, strict=True):
                found = float(series.columns[name][i])
                wanted = float(cell.replace(",", ".") if shape.decimal == "," else cell) if cell.strip() else math.nan
                if found != wanted and not (math.isnan(found) and math.isnan(wanted)):
                    raise Silent("another number")

    @staticmethod
    def _rows(text, shape):
        lines = [line.rstrip("\r\n") for line in text.split("\n")][shape.first :]
        kept = [line for line in lines if line.strip() and not line.lstrip().startswith(("#", "%"))]
        return [_cells(line, shape.delimiter) for line in kept]


def _cells(line, delimiter):
    if delimiter == " ":
        return line.split()
    return next(csv.reader([line], delimiter=delimiter)) if '"' in line else line.split(delimiter)


class SniffedTable(LogTable):
    """The proposal of a mapping from such a file."""

    SEEDS = (
        "ms;enc_left;enc_right\n0;1;2\n10;5;9\n20;9;20\n30;20;31\n",
        "time,x,y,yaw\n0.0,1,2,0.1\n0.1,1.5,2,0.2\n0.2,2,2,0.3\n",
        "0.5 1 2 0 0 0 0 1\n0.6 1 2 0 0 0 0 1\n0.7 1 2 0 0 0 0 1\n",
    )

    def attack(self, given):
        sniff([written(self.folder / "log.csv", given)])


class Bag(Reader):
    """An MCAP file with checksums: the numbers are those that stood there, or it is refused."""

    def __init__(self, folder):
        super().__init__(folder)
        from mcap.writer import Writer

        self.file = folder / "seed.mcap"
        with self.file.open("wb") as stream:
            writer = Writer(stream)
            writer.start("ros2", "test")
            schema = writer.register_schema("joints", "jsonschema", b"{}")
            channel = writer.register_channel("/joints", "json", schema)
            for k in range(12):
                text = (
                    f'{{"header": {{"stamp": {{"sec": {k}, "nanosec": 5}}}}, "name": ["left", "right"], '
                    f'"position": [{k / 7}, {-k / 3}]}}'
                )
                writer.add_message(channel, 10**9 * k, text.encode(), 10**9 * k)
            writer.finish()
        self.data = self.file.read_bytes()
        self.numbers = self._read(self.file)

    def _read(self, file):
        columns = read_bag(file, "/joints", FIELDS).columns
        return np.column_stack([columns[name] for name in FIELDS])

    def input(self, source):
        return damaged(self.data, source)

    def attack(self, given):
        hurt = self.folder / "hurt.mcap"
        hurt.write_bytes(given)
        if not np.array_equal(self._read(hurt), self.numbers):
            raise Silent("other numbers")


class Ros1Bag(Reader):
    """A ROS 1 bag, which has no checksums: nothing but a sentence comes out of it."""

    def __init__(self, folder):
        super().__init__(folder)
        from rosbags.rosbag1 import Writer
        from rosbags.typesys import Stores, get_typestore

        store = get_typestore(Stores.ROS1_NOETIC)
        kind = "std_msgs/msg/Float64"
        with Writer(folder / "seed.bag") as writer:
            connection = writer.add_connection("/speed", kind, typestore=store)
            for k in range(12):
                writer.write(connection, 10**9 * (k + 1), store.serialize_ros1(store.types[kind](data=k / 7), kind))
        self.data = (folder / "seed.bag").read_bytes()

    def input(self, source):
        return damaged(self.data, source)

    def attack(self, given):
        (self.folder / "hurt.bag").write_bytes(given)
        read_bag(self.folder / "hurt.bag", "/speed", ["data", "log_time"])


LOG_READERS: dict[str, type[Reader]] = {
    "mapping": MappingFile, "robot": RobotYaml, "log-csv": LogTable, "sniff": SniffedTable,
}
if importlib.util.find_spec("mcap") and importlib.util.find_spec("rosbags"):
    LOG_READERS |= {"mcap": Bag, "ros1": Ros1Bag}
