"""Recordings: what is written reads back bit for bit, what is wrong is refused in one sentence that says where."""

import io
import math
import os
import pickle
import subprocess
import sys

import numpy as np
import pyarrow as pa
import pyarrow.parquet as parquet
import pytest

from drake_ispace.blocks.errors import InputError
from drake_ispace.files import recording as recording_module
from drake_ispace.files import recording_tables
from drake_ispace.files.recording import CHANNELS, Channel, Recording, validate
from drake_ispace.files.yaml_guard import dump_yaml, load_yaml
from drake_ispace.robots.recordings import load

HEAD = "format: drake-ispace-recording/1\nrobot: omni\n"
KINECT = HEAD + "channels: {kinect: {file: kinect.csv}}\n"
POSE = ("x", "y", "phi")
ROWS = "t,x,y,phi\n0,1,2,3\n0.1,1,2,3\n"
WHEELS = {"omni": "1234", "pendulum": "rl"}


def make_run(folder, yaml=KINECT, csv=ROWS, file="kinect.csv"):
    folder.mkdir(exist_ok=True)
    (folder / "recording.yaml").write_bytes(yaml if isinstance(yaml, bytes) else yaml.encode())
    (folder / file).write_bytes(csv if isinstance(csv, bytes) else csv.encode())
    return folder


def refusal(action, *arguments):
    """The one sentence with which `action` refuses its arguments."""
    with pytest.raises(InputError) as caught:
        action(*arguments)
    message = str(caught.value)
    assert "\n" not in message and "\r" not in message and not message.endswith(".")
    assert len(message) < 600
    return message


def awkward_numbers(n, m, seed=0):
    """Numbers (n, m) with random bits, finite, with signed zeros and denormals among them."""
    bits = np.random.default_rng(seed).integers(0, 2**64, size=4 * n * m, dtype=np.uint64).view(float)
    numbers = bits[np.isfinite(bits)][: n * m]
    numbers[:4] = [-0.0, 5e-324, 0.1 + 0.2, -1.7976931348623157e308]
    return numbers.reshape(n, m)


def awkward_run(robot="omni"):
    """Every channel a robot can have, each with its own number of samples."""
    columns = {
        "reference": ("x", "y", "phi"),
        "command": ("vx", "vy", "wz"),
        "torque": tuple("tau_" + wheel for wheel in WHEELS[robot]),
        "encoder": tuple("theta_" + wheel for wheel in WHEELS[robot]),
        "imu": ("ax", "ay", "az", "wx", "wy", "wz"),
        "kinect": ("x", "y", "phi"),
        "truth": ("x", "y", "phi", "slip_1", "tau_1"),
    }
    period = 0.004999999997380655
    channels = {}
    for seed, name in enumerate(CHANNELS):
        n = 20 + seed
        t = -3 * period + period * np.arange(n)
        channels[name] = Channel(t, columns[name], awkward_numbers(n, len(columns[name]), seed), period_s=period)
    return Recording(robot, "omni_multirate", channels, notes="wet carpet: 1e3\nyes, 'really' ° \x07")


# ---------------------------------------------------------------------------------------------------- round trips


@pytest.mark.parametrize("format", ["csv", "parquet"])
@pytest.mark.parametrize("robot", ["omni", "pendulum"])
def test_every_channel_reads_back_bit_for_bit(tmp_path, robot, format):
    run = awkward_run(robot)
    run.save(tmp_path / "run", format)
    back = load(tmp_path / "run")
    assert (back.robot, back.scenario, back.notes, back.path) == (robot, run.scenario, run.notes, tmp_path / "run")
    assert list(back.channels) == list(run.channels)
    for name, channel in run.channels.items():
        again = back.channels[name]
        assert again.columns == channel.columns and again.period_s == channel.period_s
        assert again.t.tobytes() == channel.t.tobytes()
        assert again.values.tobytes() == channel.values.tobytes()


@pytest.mark.parametrize("name", CHANNELS)
def test_any_single_channel_is_a_valid_run(tmp_path, name):
    run = awkward_run()
    run.channels = {name: run.channels[name]}
    run.save(tmp_path / "run")
    assert list(load(tmp_path / "run").channels) == [name]


def test_a_second_round_trip_writes_the_same_bytes(tmp_path):
    awkward_run().save(tmp_path / "first")
    load(tmp_path / "first").save(tmp_path / "second")
    files = sorted(file.name for file in (tmp_path / "first").iterdir())
    assert len(files) == 1 + len(CHANNELS)
    for file in files:
        assert (tmp_path / "first" / file).read_bytes() == (tmp_path / "second" / file).read_bytes()


def test_writing_csv_needs_no_pyarrow(tmp_path):
    program = (
        "import sys; sys.modules['pyarrow'] = None\n"
        "from drake_ispace.files.recording import Channel, Recording\n"
        "Recording('omni', None, {'kinect': Channel([0.0], ('x', 'y', 'phi'), [[1, 2, 3]])}).save(sys.argv[1])\n"
        "assert 'pandas' not in sys.modules\n"
    )
    subprocess.run([sys.executable, "-c", program, tmp_path / "run"], check=True, env=os.environ)
    assert load(tmp_path / "run").channels["kinect"].values.tolist() == [[1, 2, 3]]


@pytest.mark.parametrize(
    "text", ["on", "1e3", "1e-3", ".5", "nan", "-.INF", "null", "~", "1:30", "2024-01-01", "0x1F", "a: b"]
)
def test_names_that_look_like_something_else_stay_text(tmp_path, text):
    run = Recording(text, text, {"kinect": Channel([0.0], ("x", "y", "phi"), [[1, 2, 3]])}, notes=text)
    run.save(tmp_path / "run")
    back = load(tmp_path / "run")
    assert (back.robot, back.scenario, back.notes) == (text, text, text)


def test_parquet_of_integers_and_single_precision_is_read(tmp_path):
    make_run(tmp_path / "run", HEAD + "channels: {kinect: {file: k.parquet}}")
    columns = {
        "t": pa.array([0, 1]),
        "x": pa.array([0.5, 1], pa.float32()),
        "y": pa.array([1, 2]),
        "phi": pa.array([0.0, 1]),
    }
    parquet.write_table(pa.table(columns), tmp_path / "run" / "k.parquet")
    assert load(tmp_path / "run").channels["kinect"].values.tolist() == [[0.5, 1, 0], [1, 2, 1]]


# ------------------------------------------------------------------------------------------- files others have written

ACCEPTED = {
    "plain": ROWS,
    "utf8_bom": "\ufeff" + ROWS,
    "crlf": ROWS.replace("\n", "\r\n"),
    "no_newline_at_the_end": ROWS.rstrip(),
    "quoted_numbers": 't,"x",y,phi\n"0","1","2","3"\n0.1,"1",2,3\n',
    "blanks_around_cells": "t, x, y, phi\n 0, 1 , 2, 3\n0.1, 1, 2,\t3\n",
    "blank_lines": "t,x,y,phi\n\n0,1,2,3\n \n0.1,1,2,3\n\n\n",
    "plus_signs_and_exponents": "t,x,y,phi\n+0.0,+1.e0,.2E+1,3\n1e-1,1,2,3\n",
    "columns_in_another_order": "t,phi,x,y\n0,3,1,2\n0.1,3,1,2\n",
}


@pytest.mark.parametrize("csv", ACCEPTED.values(), ids=ACCEPTED.keys())
def test_harmless_variants_of_csv_are_read(tmp_path, csv):
    channel = load(make_run(tmp_path / "run", csv=csv)).channels["kinect"]
    assert channel.t.tolist() == [0, 0.1]
    assert [channel.column(name).tolist() for name in ("x", "y", "phi")] == [[1, 1], [2, 2], [3, 3]]


def test_negative_time_is_read(tmp_path):
    run = make_run(tmp_path / "run", csv="t,x,y,phi\n-2,1,2,3\n-1,1,2,3\n")
    assert load(run).channels["kinect"].t.tolist() == [-2, -1]


def test_times_of_arrival_are_read(tmp_path):
    run = make_run(tmp_path / "run", csv="t,x,y,phi,t_received\n0,1,2,3,0\n1,1,2,3,1.5\n")
    assert load(run).channels["kinect"].column("t_received").tolist() == [0, 1.5]


def test_another_robot_may_have_any_number_of_wheels(tmp_path):
    yaml = "format: drake-ispace-recording/1\nrobot: tricycle\nchannels: {encoder: {file: e.csv}}"
    run = make_run(tmp_path / "run", yaml, "t,theta_front,theta_2,theta_3\n0,1,2,3\n", "e.csv")
    assert load(run).channels["encoder"].columns == ("theta_front", "theta_2", "theta_3")


def test_a_file_may_lie_in_a_folder_of_the_run(tmp_path):
    run = make_run(tmp_path / "run", KINECT.replace("kinect.csv", "raw/kinect.csv"))
    (run / "raw").mkdir()
    (run / "kinect.csv").rename(run / "raw" / "kinect.csv")
    assert len(load(run).channels["kinect"].t) == 2


def test_a_period_written_as_1e_3_is_a_number(tmp_path):
    yaml = HEAD + "channels: {kinect: {file: kinect.csv, period_s: 1e-3}}"
    run = make_run(tmp_path / "run", yaml, "t,x,y,phi\n0,1,2,3\n0.001,1,2,3\n")
    assert load(run).channels["kinect"].period_s == 1e-3


@pytest.mark.parametrize(
    "step", [0.095 * 0.981, 0.095 * 1.019, 2 * 0.095], ids=["shorter", "longer", "every_second_fix"]
)
def test_period_and_time_stamps_may_differ_by_two_percent_and_by_fixes_not_seen(tmp_path, step):
    channel = Channel(step * np.arange(5), ("x", "y", "phi"), np.zeros((5, 3)), period_s=0.095)
    Recording("omni", None, {"kinect": channel}).save(tmp_path / "run")
    assert load(tmp_path / "run").channels["kinect"].period_s == 0.095


# ---------------------------------------------------------------------------------------------------------- units

# One column of 1s, or of the number given, in the unit declared, and the number it must become.
UNITS = [
    ("kinect", "x", "mm", 5, 0.005),
    ("kinect", "x", "cm", 1, 0.01),
    ("kinect", "phi", "deg", 180, math.pi),
    ("kinect", "phi", "°", 180, math.pi),
    ("encoder", "theta_1", "rev", 1, 2 * math.pi),
    ("encoder", "theta_1", "mrad", 1, 0.001),
    ("torque", "tau_1", "mN*m", 7, 0.007),
    ("torque", "tau_1", "N·m", 7, 7),
    ("torque", "tau_1", "Nm", 7, 7),
    ("torque", "tau_1", "N*cm", 7, 0.07),
    ("command", "vx", "mm/s", 250, 0.25),
    ("command", "vx", "km/h", 36, 10),
    ("command", "wz", "rpm", 30, math.pi),
    ("command", "wz", "deg/s", 90, math.pi / 2),
    ("imu", "ax", "g", 1, 9.80665),
    ("imu", "ax", "m/s²", 2, 2),
    ("imu", "ax", "m/s**2", 2, 2),
    ("imu", "wx", "deg/s", -180, -math.pi),
    ("truth", "slip_1", "1", 0.25, 0.25),
]


@pytest.mark.parametrize("channel, column, unit, number, in_si", UNITS, ids=[f"{u[1]}-{u[2]}" for u in UNITS])
def test_declared_units_become_si(tmp_path, channel, column, unit, number, in_si):
    columns = awkward_run().channels[channel].columns
    yaml = HEAD + f"channels: {{{channel}: {{file: c.csv, units: {{{column}: {unit!r}}}}}}}"
    cells = ["0"] + [repr(number) if name == column else "1" for name in columns]
    read = load(make_run(tmp_path / "run", yaml, ",".join(("t", *columns)) + "\n" + ",".join(cells) + "\n", "c.csv"))
    read = read.channels[channel]
    assert read.column(column).tolist() == [pytest.approx(in_si, rel=4e-16)]
    assert read.units[column] in ("m", "rad", "N*m", "m/s", "rad/s", "m/s^2", "1")
    assert all(read.column(name).tolist() == [1] for name in columns if name != column)


def test_time_in_milliseconds_becomes_the_nearest_double_in_seconds(tmp_path):
    yaml = HEAD + "channels: {kinect: {file: kinect.csv, units: {t: ms}, period_s: 0.005}}"
    run = make_run(tmp_path / "run", yaml, "t,x,y,phi\n0,1,2,3\n5,1,2,3\n")
    assert load(run).channels["kinect"].t.tolist() == [0, 0.005]


def test_units_are_known_without_being_declared(tmp_path):
    awkward_run().save(tmp_path / "run")
    channels = load(tmp_path / "run").channels
    assert channels["torque"].units == dict.fromkeys(("tau_1", "tau_2", "tau_3", "tau_4"), "N*m")
    assert channels["imu"].units == {
        **dict.fromkeys(("ax", "ay", "az"), "m/s^2"),
        **dict.fromkeys(("wx", "wy", "wz"), "rad/s"),
    }
    assert channels["truth"].units == {"x": "m", "y": "m", "phi": "rad", "tau_1": "N*m"}


# ------------------------------------------------------------------------------------------------- refused: the YAML


def kinect_entry(entry):
    return HEAD + f"channels: {{kinect: {entry}}}"


BOMB = "a: &a [x, x]\nb: &b [*a, *a, *a, *a, *a, *a, *a, *a, *a]\nc: &c [*b, *b, *b, *b, *b, *b, *b, *b, *b]\n"

# What recording.yaml says, and what the refusal must contain besides the name of that file.
BAD_YAML = {
    "empty": ("", ["empty"]),
    "only_comments": ("# nothing\n", ["empty"]),
    "not_yaml": ("format: [1, 2\nrobot: omni\n", ["line 2", "valid YAML"]),
    "tab_indent": ("format:\n\tx: 1\n", ["line 2", "valid YAML"]),
    "root_is_a_list": ("- format\n", ["line 1", "top level"]),
    "root_is_text": ("hello", ["line 1", "top level"]),
    "two_documents": (KINECT + "---\na: 1\n", ["line 4", "second YAML document"]),
    "duplicate_key": (HEAD + "robot: pendulum\n", ["line 3", "robot", "twice", "line 2"]),
    "duplicate_inner_key": (kinect_entry("{file: a.csv, file: b.csv}"), ["line 3", "channels.kinect.file", "twice"]),
    "duplicate_channel": (HEAD + "channels:\n  kinect: {}\n  kinect: {}\n", ["line 5", "channels.kinect", "twice"]),
    "unknown_key": (KINECT + "note: hi\n", ["'note'", "did you mean 'notes'?"]),
    "unknown_key_unlike_any": (KINECT + "zzz: 1\n", ["'zzz'", "expected one of format, robot"]),
    "key_is_a_list": (KINECT + "[a, b]: 1\n", ["line 4", "plain word"]),
    "merge_key": (KINECT + "<<: {notes: x}\n", ["line 4", "plain word"]),
    "missing_format": ("robot: omni\nchannels: {}\n", ["format is missing", "drake-ispace-recording/1"]),
    "unknown_format": (KINECT.replace("drake-ispace-recording/1", "rosbag2"), ["format is 'rosbag2'"]),
    "format_without_version": (KINECT.replace("/1", ""), ["format", "expected drake-ispace-recording/1"]),
    "newer_format": (KINECT.replace("/1", "/2"), ["drake-ispace-recording/2", "expected version 1"]),
    "missing_robot": (KINECT.replace("robot: omni\n", ""), ["robot is missing", "omni, pendulum"]),
    "empty_robot": (KINECT.replace("omni", ""), ["robot is missing"]),
    "robot_is_a_number": (KINECT.replace("omni", "4"), ["robot is 4", "expected text"]),
    "scenario_is_a_list": (KINECT + "scenario: [a]\n", ["scenario is ['a']", "expected text"]),
    "missing_channels": (HEAD, ["channels is missing"]),
    "channels_is_a_list": (HEAD + "channels: [kinect]\n", ["channels is ['kinect']"]),
    "no_channel": (HEAD + "channels: {}\n", ["channels is empty", "encoder"]),
    "unknown_channel": (HEAD + "channels: {encoders: {file: e.csv}}\n", ["'encoders'", "did you mean 'encoder'?"]),
    "channel_is_a_file_name": (kinect_entry("kinect.csv"), ["channels.kinect", "{file: kinect.csv}"]),
    "channel_without_file": (kinect_entry("{period_s: 1}"), ["channels.kinect.file is missing"]),
    "unknown_channel_key": (kinect_entry("{file: kinect.csv, unit: {}}"), ["channels.kinect.unit", "'units'"]),
    "file_is_a_number": (kinect_entry("{file: 3}"), ["channels.kinect.file is 3"]),
    "file_with_nul": (kinect_entry(r'{file: "a\0b"}'), ["channels.kinect.file", "name of a file"]),
    "file_above": (kinect_entry("{file: ../kinect.csv}"), ["channels.kinect.file", "'../kinect.csv'", "leads out"]),
    "file_above_and_back": (kinect_entry("{file: ../run/kinect.csv}"), ["channels.kinect.file", "leads out"]),
    "file_absolute": (kinect_entry("{file: /etc/passwd}"), ["channels.kinect.file", "'/etc/passwd'", "leads out"]),
    "units_is_text": (kinect_entry("{file: kinect.csv, units: mm}"), ["channels.kinect.units is 'mm'"]),
    "unit_unknown": (
        kinect_entry("{file: kinect.csv, units: {x: furlong}}"),
        ["kinect.units.x is 'furlong'", "m, cm, mm"],
    ),
    "unit_wrong_kind": (
        kinect_entry("{file: kinect.csv, units: {x: rad}}"),
        ["channels.kinect.units.x is 'rad'", "m, cm"],
    ),
    "unit_is_a_number": (kinect_entry("{file: kinect.csv, units: {x: 1}}"), ["channels.kinect.units.x is 1"]),
    "unit_of_no_column": (kinect_entry("{file: kinect.csv, units: {phy: rad}}"), ["'phy'", "did you mean 'phi'?"]),
    "period_mismatch": (
        kinect_entry("{file: kinect.csv, period_s: 0.095}"),
        ["kinect.period_s is 0.095 s", "0.1 s", "2%"],
    ),
    "period_zero": (kinect_entry("{file: kinect.csv, period_s: 0}"), ["channels.kinect.period_s is 0", "positive"]),
    "period_negative": (kinect_entry("{file: kinect.csv, period_s: -0.1}"), ["period_s is -0.1", "positive"]),
    "period_is_text": (kinect_entry("{file: kinect.csv, period_s: fast}"), ["channels.kinect.period_s is 'fast'"]),
    "period_is_true": (kinect_entry("{file: kinect.csv, period_s: true}"), ["channels.kinect.period_s is True"]),
    "period_nan": (
        kinect_entry("{file: kinect.csv, period_s: .nan}"),
        ["line 3", "channels.kinect.period_s", "finite"],
    ),
    "period_inf": (
        kinect_entry("{file: kinect.csv, period_s: -.Inf}"),
        ["line 3", "channels.kinect.period_s", "finite"],
    ),
    "period_overflows": (kinect_entry("{file: kinect.csv, period_s: 1e999}"), ["channels.kinect.period_s", "range"]),
    "huge_integer": (KINECT + "notes: " + "9" * 5000, ["line 4", "notes", "range"]),
    "anchor": (KINECT + "notes: &a hi\n", ["line 4", "notes", "anchor"]),
    "billion_laughs": (
        BOMB + "".join(f"{n}: &{n} [{f'*{p}, ' * 9}]\n" for p, n in zip("cdefgh", "defghi", strict=True)),
        ["line 1: a: anchor"],
    ),
    "tag": (KINECT + "notes: !!python/object/apply:os.system [ls]\n", ["line 4", "notes", "tag"]),
    "deep_nesting": (KINECT + "notes: " + "[" * 100_000, ["line 4", "nested more than 32 deep"]),
    "deep_nesting_of_mappings": (KINECT + "notes: " + "{a: " * 50_000, ["line 4", "nested more than 32 deep"]),
    "too_large": (KINECT + "notes: " + "x" * 2_000_000, ["larger than 262144 bytes"]),
    "not_utf8": (KINECT.encode() + b"notes: caf\xe9\n", ["line 4", "byte 0xe9"]),
    "utf16": (KINECT.encode("utf-16"), ["line 1", "UTF-8"]),
    "nul": (KINECT.encode() + b"notes: a\0b\n", ["valid YAML"]),
    "random_bytes": (bytes(range(256)) * 2000, ["recording.yaml"]),
}  # fmt: skip


@pytest.mark.parametrize("yaml, parts", BAD_YAML.values(), ids=BAD_YAML.keys())
def test_bad_recording_yaml_is_refused(tmp_path, yaml, parts):
    run = make_run(tmp_path / "run", yaml)
    message = refusal(load, run)
    assert message.startswith(str(run / "recording.yaml"))
    for part in parts:
        assert part in message


# ------------------------------------------------------------------------------------------------- refused: the tables

T = "t,x,y,phi\n0,1,2,3\n"

# What kinect.csv holds, and what the refusal must contain besides the name of that file.
BAD_CSV = {
    "empty": ("", ["empty", "header"]),
    "only_a_bom": ("\ufeff", ["empty", "header"]),
    "header_only": ("t,x,y,phi\n", ["line 1", "without rows"]),
    "header_and_blank_lines": ("t,x,y,phi\n\n\n", ["line 1", "without rows"]),
    "no_header": ("0,1,2,3\n0.1,1,2,3\n", ["line 1", "first column is '0'", "starting with t"]),
    "t_not_first": ("x,t,y,phi\n1,0,2,3\n", ["line 1", "first column is 'x'", "starting with t"]),
    "capital_t": ("T,x,y,phi\n0,1,2,3\n", ["line 1", "first column is 'T'"]),
    "duplicate_header": ("t,x,y,phi,x\n0,1,2,3,4\n", ["line 1", "'x'", "twice"]),
    "nameless_column": ("t,x,y,phi,\n0,1,2,3,\n", ["line 1", "column 5 is named ''"]),
    "missing_column": ("t,x,y\n0,1,2\n", ["column 'phi' is missing", "t,x,y,phi"]),
    "unexpected_column": ("t,x,y,phi,z\n0,1,2,3,4\n", ["unexpected column 'z'", "t,x,y,phi"]),
    "unit_row": ("t,x,y,phi\ns,m,m,rad\n0,1,2,3\n", ["line 2", "units", "recording.yaml"]),
    "unit_row_in_brackets": ("t,x,y,phi\n[s],[m],[m],[rad]\n0,1,2,3\n", ["line 2", "units"]),
    "semicolons": ("t;x;y;phi\n0;1;2;3\n", ["line 1", "semicolons", "commas"]),
    "semicolons_and_decimal_commas": ("t;x;y;phi\n0,0;1,0;2,0;3,0\n", ["line 1", "semicolons", "decimal points"]),
    "semicolons_below_the_header": ("t,x,y,phi\n0;1;2;3\n", ["line 2", "1 cell", "semicolons"]),
    "tabs": ("t\tx\ty\tphi\n0\t1\t2\t3\n", ["line 1", "tabs", "commas"]),
    "decimal_commas": ("t,x,y,phi\n0,0,1,0,2,0,3,0\n", ["line 2", "8 cells, expected 4", "decimal commas"]),
    "quoted_decimal_commas": (T + '"0,1","1,0","2,0","3,0"\n', ["line 3", "'t'", "'0,1'", "decimal point"]),
    "nan": (T + "0.1,1,nan,3\n", ["line 3", "column 'y'", "'nan'", "finite"]),
    "inf": (T + "0.1,-inf,2,3\n", ["line 3", "column 'x'", "'-inf'", "finite"]),
    "overflow": (T + "0.1,1e999,2,3\n", ["line 3", "column 'x'", "'1e999'", "finite"]),
    "nan_in_time": (T + "NaN,1,2,3\n", ["line 3", "column 't'", "'NaN'"]),
    "empty_cell": (T + "0.1,1,,3\n", ["line 3", "column 'y'", "empty cell"]),
    "quoted_empty_cell": (T + '0.1,1,"",3\n', ["line 3", "column 'y'", "empty cell"]),
    "only_commas": (T + ",,,\n", ["line 3", "column 't'", "empty cell"]),
    "text": (T + "0.1,1,two,3\n", ["line 3", "column 'y'", "'two'"]),
    "true": (T + "0.1,1,true,3\n", ["line 3", "column 'y'", "'true'"]),
    "underscore": (T + "0.1,1,1_000,3\n", ["line 3", "column 'y'", "'1_000'"]),
    "hexadecimal": (T + "0.1,1,0x10,3\n", ["line 3", "column 'y'", "'0x10'"]),
    "arabic_digits": (T + "0.1,1,٣,3\n", ["line 3", "column 'y'"]),
    "date": (T + "2024-01-01T00:00:00,1,2,3\n", ["line 3", "column 't'"]),
    "quotes_inside_a_number": (T + '0.1,1,"1"2,3\n', ["line 3", "quotes"]),
    "open_quote": (T + '0.1,1,"2,3\n0.2,1,2,3\n', ["line 3", "quotes"]),
    "open_quote_in_the_header": ('t,x,y,"phi\n0,1,2,3\n', ["line 1", "quotes"]),
    "short_row": (T + "0.1,1,2\n", ["line 3", "3 cells, expected 4"]),
    "long_row": (T + "0.1,1,2,3,4.5\n", ["line 3", "5 cells, expected 4"]),
    "comma_at_the_end": (T + "0.1,1,2,3.0,\n", ["line 3", "5 cells, expected 4"]),
    "row_cut_off": (T + "0.1,1", ["line 3", "2 cells, expected 4"]),
    "comment": (T + "# pause\n", ["line 3", "1 cell, expected 4"]),
    "after_blank_lines": (T + "\n\n\n0.1,1,x,3\n", ["line 6", "column 'y'"]),
    "time_repeats": (T + "0,1,2,3\n", ["line 3", "t = 0.0 s follows t = 0.0 s"]),
    "time_falls": (T + "\n2,1,2,3\n1,1,2,3\n", ["line 5", "t = 1.0 s follows t = 2.0 s"]),
    "received_before_capture": ("t,x,y,phi,t_received\n1,1,2,3,0.5\n", ["line 2", "t_received = 0.5 s", "t = 1.0 s"]),
    "utf16_le": (ROWS.encode("utf-16"), ["line 1", "byte order mark", "UTF-8"]),
    "utf16_be": (b"\xfe\xff" + ROWS.encode("utf-16-be"), ["line 1", "byte order mark", "UTF-8"]),
    "utf16_without_mark": (ROWS.encode("utf-16-le"), ["line 1", "NUL", "UTF-16"]),
    "utf32": (ROWS.encode("utf-32"), ["line 1", "byte order mark", "UTF-8"]),
    "latin1_header": ("t,x,y,phi,é\n".encode("latin-1"), ["line 1", "byte 0xe9", "UTF-8"]),
    "latin1_cell": (T.encode() + b"0.1,1,2\xb0,3\n", ["line 3", "byte 0xb0", "UTF-8"]),
    "nul_in_a_cell": (T.encode() + b"0.1,1,2\0,3\n", ["line 3", "NUL"]),
    "nul_padding": (T.encode() + b"\0" * 1000, ["line 3", "NUL"]),
    "escape_codes_in_the_header": (b"t,x,y,\x1b[31mphi\n0,1,2,3\n", ["line 1", "plain word"]),
    "old_mac_line_ends": (ROWS.replace("\n", "\r"), ["line 1", "carriage return"]),
    "carriage_return_in_a_row": (T + "0.1,1,2,3\r0.2,1,2,3\n", ["line 3", "carriage return"]),
    "endless_header": ("t," * 10_000_000, ["line 1", "longer than"]),
    "endless_row": (T + "1," * 10_000_000, ["line 3", "longer than"]),
    "endless_blank_lines": ("t,x,y,phi\n" + "\n" * 20_000_000, ["without rows"]),
    "long_row_in_a_short_file": (T + "1," * 100_000 + "\n", ["line 3", "longer than"]),
    "binary": (bytes(range(256)) * 4000, ["line 1"]),
    "binary_without_newline": (b"\xd0\xcf\x11\xe0" * 1_000_000, ["line 1"]),
}  # fmt: skip


@pytest.mark.parametrize("csv, parts", BAD_CSV.values(), ids=BAD_CSV.keys())
def test_bad_table_is_refused(tmp_path, csv, parts):
    run = make_run(tmp_path / "run", csv=csv)
    message = refusal(load, run)
    assert message.startswith(str(run / "kinect.csv"))
    for part in parts:
        assert part in message


@pytest.mark.parametrize("robot, header, part", [
    ("omni", "t,theta_1,theta_2,theta_3", "column 'theta_4' is missing"),
    ("omni", "t,theta_r,theta_l", "column 'theta_1' is missing"),
    ("pendulum", "t,theta_r,theta_l,theta_3", "unexpected column 'theta_3'"),
    ("tricycle", "t,theta_1,left", "unexpected column 'left', expected only theta_*"),
    ("tricycle", "t,theta_", "unexpected column 'theta_'"),
    ("tricycle", "t", "no column after t, expected theta_*"),
])  # fmt: skip
def test_wheel_columns_must_be_those_of_the_robot(tmp_path, robot, header, part):
    yaml = f"format: drake-ispace-recording/1\nrobot: {robot}\nchannels: {{encoder: {{file: encoder.csv}}}}"
    csv = header + "\n" + ",".join("0" for _ in header.split(",")) + "\n"
    message = refusal(load, make_run(tmp_path / "run", yaml, csv, "encoder.csv"))
    assert str(tmp_path / "run" / "encoder.csv") in message and part in message


def test_truth_starts_with_the_pose(tmp_path):
    yaml = HEAD + "channels: {truth: {file: truth.csv}}"
    message = refusal(load, make_run(tmp_path / "run", yaml, "t,slip,x,y,phi\n0,0,1,2,3\n", "truth.csv"))
    assert "truth.csv" in message and "start with 'slip,x,y'" in message


@pytest.fixture
def read_to(monkeypatch):
    """How far each file was read before it was closed [bytes]."""
    reached = []

    class Noting(io.BufferedReader):
        def close(self):
            if not self.closed:
                reached.append(self.tell())
            super().close()

    monkeypatch.setattr(recording_tables, "open", lambda path, mode: Noting(io.FileIO(path)), raising=False)
    return reached


@pytest.mark.parametrize("index", [0, 13_579, 19_999], ids=["first", "middle", "last"])
def test_only_the_block_with_the_bad_row_is_read_line_by_line(tmp_path, monkeypatch, read_to, index):
    block, by_line = 1 << 14, []
    monkeypatch.setattr(recording_tables, "BLOCK", block)
    slow = recording_tables._parse_by_line
    monkeypatch.setattr(recording_tables, "_parse_by_line", lambda *a: by_line.append(len(a[0])) or slow(*a))
    rows = [f"{k},1,2,3" for k in range(20_000)]
    rows[index] = f"{index},1,oops,3"
    message = refusal(load, make_run(tmp_path / "run", csv="t,x,y,phi\n" + "\n".join(rows) + "\n"))
    assert f"line {index + 2}: column 'y' holds 'oops'" in message
    assert len(by_line) == 1 and by_line[0] < block + 100
    assert read_to[0] < len("\n".join(rows[: index + 1])) + block + 100


@pytest.mark.parametrize("head", [b"", T.encode()], ids=["from_the_start", "below_a_good_header"])
def test_of_garbage_no_more_is_read_than_shows_it(tmp_path, read_to, head):
    garbage = np.random.default_rng(0).bytes(3 * recording_tables.BLOCK)
    assert "kinect.csv: line" in refusal(load, make_run(tmp_path / "run", csv=head + garbage))
    assert read_to[0] <= recording_tables.BLOCK + 2 * recording_tables.LONGEST_LINE


# ------------------------------------------------------------------------------------------- refused: files and folders


def test_folder_missing(tmp_path):
    assert refusal(load, tmp_path / "nowhere").startswith(f"{tmp_path / 'nowhere'}: expected the folder of a run")


def test_folder_is_a_file(tmp_path):
    make_run(tmp_path / "run")
    assert "expected the folder of a run, there is a file" in refusal(load, tmp_path / "run" / "recording.yaml")


def test_folder_with_an_impossible_name():
    assert "expected the folder of a run" in refusal(load, "x" * 300)


def test_recording_yaml_missing(tmp_path):
    assert refusal(load, tmp_path) == f"{tmp_path / 'recording.yaml'}: expected a file, there is none"


def test_table_missing(tmp_path):
    run = make_run(tmp_path / "run")
    (run / "kinect.csv").unlink()
    assert refusal(load, run) == f"{run / 'kinect.csv'}: expected a file, there is none"


@pytest.mark.parametrize("name, part", [
    ("kinect.xlsx", "ends in '.xlsx', expected .csv or .parquet"),
    ("recording.yaml", "expected .csv or .parquet"),
    (".", "expected .csv or .parquet"),
    ("x" * 300 + ".csv", "cannot be read"),
])  # fmt: skip
def test_file_that_cannot_be_a_table(tmp_path, name, part):
    assert part in refusal(load, make_run(tmp_path / "run", KINECT.replace("kinect.csv", name)))


def test_a_pipe_is_not_waited_for(tmp_path):
    run = make_run(tmp_path / "run")
    (run / "kinect.csv").unlink()
    os.mkfifo(run / "kinect.csv")
    assert "expected a file" in refusal(load, run)


@pytest.mark.parametrize(
    "target", ["../elsewhere.csv", "/etc/hostname", "kinect.csv"], ids=["above", "absolute", "loop"]
)
def test_symbolic_links_must_stay_inside(tmp_path, target):
    run = make_run(tmp_path / "run")
    (tmp_path / "elsewhere.csv").write_text(ROWS)
    (run / "kinect.csv").unlink()
    (run / "kinect.csv").symlink_to(target)
    message = refusal(load, run)
    assert message.startswith(f"{run / 'recording.yaml'}: channels.kinect.file") and "leads out" in message


def test_a_symbolic_link_within_the_run_is_followed(tmp_path):
    run = make_run(tmp_path / "run", file="raw.csv")
    (run / "kinect.csv").symlink_to("raw.csv")
    assert len(load(run).channels["kinect"].t) == 2


# ------------------------------------------------------------------------------------------------- refused: Parquet

GOOD = {"t": [0.0, 1.0], "x": [1.0, 1.0], "y": [2.0, 2.0], "phi": [3.0, 3.0]}
BAD_PARQUET = {
    "not_parquet": (None, ["expected a Parquet file"]),
    "t_not_first": ({"x": GOOD["x"], **GOOD}, ["first column is 'x'"]),
    "missing_column": ({k: v for k, v in GOOD.items() if k != "y"}, ["column 'y' is missing"]),
    "text": ({**GOOD, "y": ["1", "2"]}, ["column 'y' is of type string"]),
    "timestamps": ({**GOOD, "t": pa.array([0, 1], pa.timestamp("ns"))}, ["column 't' is of type timestamp[ns]"]),
    "null": ({**GOOD, "y": [1.0, None]}, ["row 2", "column 'y'", "empty"]),
    "nan": ({**GOOD, "y": [1.0, math.nan]}, ["row 2", "column 'y'", "finite"]),
    "no_rows": ({k: pa.array([], pa.float64()) for k in GOOD}, ["0 rows"]),
    "time_repeats": ({**GOOD, "t": [1.0, 1.0]}, ["row 2", "t = 1.0 s"]),
}  # fmt: skip


@pytest.mark.parametrize("columns, parts", BAD_PARQUET.values(), ids=BAD_PARQUET.keys())
def test_bad_parquet_is_refused(tmp_path, columns, parts):
    file = make_run(tmp_path / "run", KINECT.replace(".csv", ".parquet"), file="kinect.parquet") / "kinect.parquet"
    if columns is not None:
        parquet.write_table(pa.table(columns), file)
    message = refusal(load, tmp_path / "run")
    assert message.startswith(str(file))
    for part in parts:
        assert part in message


def as_written_elsewhere(folder):
    """The run without the seals that `save` notes beside Parquet files."""
    where = folder / "recording.yaml"
    data = load_yaml(where, "")
    for entry in data["channels"].values():
        for seal in ("rows", "columns", "sha256"):
            entry.pop(seal)
    where.write_text(dump_yaml(data), encoding="utf-8")


def test_damaged_parquet_without_a_checksum_never_breaks(tmp_path):
    run = awkward_run()
    run.channels = {"kinect": run.channels["kinect"]}
    run.save(tmp_path / "run", "parquet")
    as_written_elsewhere(tmp_path / "run")
    file = tmp_path / "run" / "kinect.parquet"
    good, random = file.read_bytes(), np.random.default_rng(0)
    for _ in range(200):
        damaged = bytearray(good)
        for index in random.integers(0, len(good), 3):
            damaged[index] = random.integers(0, 256)
        file.write_bytes(damaged[: random.integers(1, len(good) + 1)] if random.random() < 0.3 else damaged)
        try:
            load(tmp_path / "run")
        except InputError as error:
            assert str(file) in str(error) and "\n" not in str(error)


def test_no_changed_bit_of_a_parquet_file_goes_unnoticed(tmp_path):
    run = Recording("omni", None, {"kinect": Channel(np.arange(20.0), POSE, awkward_numbers(20, 3))})
    run.save(tmp_path / "run", "parquet")
    file = tmp_path / "run" / "kinect.parquet"
    good = file.read_bytes()
    for bit in range(0, 8 * len(good), 7):
        damaged = bytearray(good)
        damaged[bit // 8] ^= 1 << bit % 8
        file.write_bytes(damaged)
        assert "the file is damaged, or was changed" in refusal(load, tmp_path / "run")
    file.write_bytes(good)
    assert np.array_equal(load(tmp_path / "run").channels["kinect"].values, run.channels["kinect"].values)


@pytest.mark.parametrize(("seal", "value", "said"), [
    ("rows", 21, "rows 20, expected 21"), ("columns", ["t", "x", "y", "psi"], "expected ['t', 'x', 'y', 'psi']"),
    ("sha256", "0" * 64, "expected '000000000000...'"),
])
def test_a_table_that_is_not_the_noted_one_is_refused(tmp_path, seal, value, said):
    run = Recording("omni", None, {"kinect": Channel(np.arange(20.0), POSE, awkward_numbers(20, 3))})
    run.save(tmp_path / "run")
    where = tmp_path / "run" / "recording.yaml"
    data = load_yaml(where, "")
    data["channels"]["kinect"][seal] = value
    where.write_text(dump_yaml(data), encoding="utf-8")
    assert said in refusal(load, tmp_path / "run")


def test_a_parquet_file_that_announces_more_than_it_can_hold_is_refused_from_its_header(tmp_path):
    folder = make_run(tmp_path / "run", KINECT.replace(".csv", ".parquet"), file="kinect.parquet")
    n = 3_000_000
    announced = pa.table(dict.fromkeys(("t", *POSE), np.zeros(n)))
    parquet.write_table(announced, folder / "kinect.parquet", compression="zstd")
    assert "expected times that increase to take more" in refusal(load, folder)


# --------------------------------------------------------------------------------------------------------- writing


def names_in(folder):
    return sorted(file.name for file in folder.iterdir())


@pytest.mark.parametrize(
    "error", [RuntimeError("stop"), KeyboardInterrupt(), OSError(28, "No space left on device")], ids=repr
)
@pytest.mark.parametrize("existing", [False, True], ids=["new", "replacing"])
def test_an_interrupted_save_leaves_what_was_there(tmp_path, monkeypatch, error, existing):
    if existing:
        make_run(tmp_path / "run")
    calls = []

    def write_one_then_fail(path, names, values):
        calls.append(path)
        path.write_text("half")
        if len(calls) == 2:
            raise error

    monkeypatch.setattr(recording_module, "write_table", write_one_then_fail)
    with pytest.raises(InputError if isinstance(error, OSError) else type(error)):
        awkward_run().save(tmp_path / "run")
    assert len(calls) == 2
    assert names_in(tmp_path) == (["run"] if existing else [])
    assert not existing or load(tmp_path / "run").channels["kinect"].t.tolist() == [0, 0.1]


def test_a_recording_of_another_version_is_not_replaced(tmp_path):
    make_run(tmp_path / "run")
    text = (tmp_path / "run" / "recording.yaml").read_text()
    (tmp_path / "run" / "recording.yaml").write_text(text.replace("recording/1", "recording/999"))
    assert "expected version 1, the only one this program reads" in refusal(awkward_run().save, tmp_path / "run")
    assert "recording/999" in (tmp_path / "run" / "recording.yaml").read_text()


def test_saving_replaces_a_recording_as_a_whole(tmp_path):
    make_run(tmp_path / "run")
    run = awkward_run()
    run.channels = {"imu": run.channels["imu"]}
    run.save(tmp_path / "run")
    assert names_in(tmp_path) == ["run"] and names_in(tmp_path / "run") == ["imu.csv", "recording.yaml"]


SETTINGS = {"diagram": "omni_multirate", "seed": 3, "omni": {"control": {"gains": "given", "q": [1e-7, 2.0]}}}


def test_the_scenario_of_a_run_reads_back_and_goes_with_it(tmp_path):
    run = awkward_run()
    run.settings = SETTINGS
    run.save(tmp_path / "run")
    assert load(tmp_path / "run").settings == SETTINGS
    run.settings = None
    run.save(tmp_path / "run")
    assert load(tmp_path / "run").settings is None and "scenario.yaml" not in names_in(tmp_path / "run")


@pytest.mark.parametrize("text, part", [("seed: [", "valid YAML"), ("", "empty"), ("- 3", "at the top level")])
def test_a_scenario_that_cannot_be_read_is_refused(tmp_path, text, part):
    (make_run(tmp_path / "run") / "scenario.yaml").write_text(text)
    message = refusal(load, tmp_path / "run")
    assert message.startswith(str(tmp_path / "run" / "scenario.yaml")) and part in message


def test_a_scenario_outside_of_the_folder_is_refused(tmp_path):
    (tmp_path / "mine.yaml").write_text("seed: 3")
    (make_run(tmp_path / "run") / "scenario.yaml").symlink_to(tmp_path / "mine.yaml")
    assert "leads out of" in refusal(load, tmp_path / "run")


def test_settings_that_are_no_mapping_are_not_saved(tmp_path):
    run = awkward_run()
    run.settings = "omni_multirate"
    assert "settings is 'omni_multirate'" in refusal(run.save, tmp_path / "run")


def test_saving_creates_the_folders_above(tmp_path):
    awkward_run().save(tmp_path / "a" / "b" / "run")
    assert names_in(tmp_path / "a" / "b") == ["run"]


@pytest.mark.parametrize(
    "content", [{}, {"thesis.tex": "x"}, {"recording.yaml": "a: 1"}, {"recording.yaml": "["}], ids=str
)
def test_saving_never_replaces_a_folder_that_is_no_recording(tmp_path, content):
    (tmp_path / "run").mkdir()
    for name, text in content.items():
        (tmp_path / "run" / name).write_text(text)
    assert "is not a recording" in refusal(awkward_run().save, tmp_path / "run")
    assert names_in(tmp_path) == ["run"] and names_in(tmp_path / "run") == sorted(content)


def test_saving_never_replaces_a_file(tmp_path):
    (tmp_path / "run").write_text("x")
    assert "is not a recording" in refusal(awkward_run().save, tmp_path / "run")


def test_saving_never_deletes_a_file_the_recording_does_not_name(tmp_path):
    (make_run(tmp_path / "run") / "video.mp4").write_text("x")
    message = refusal(awkward_run().save, tmp_path / "run")
    assert message.startswith(str(tmp_path / "run" / "video.mp4")) and "moved elsewhere" in message
    assert (tmp_path / "run" / "video.mp4").exists()


def test_saving_below_a_file_is_refused(tmp_path):
    (tmp_path / "file").write_text("x")
    assert "cannot be written" in refusal(awkward_run().save, tmp_path / "file" / "run")


def test_saving_in_another_format_is_refused(tmp_path):
    assert "expected 'csv' or 'parquet'" in refusal(awkward_run().save, tmp_path / "run", "xlsx")


BAD_CHANNELS = {
    "no_samples": (Channel([], POSE, np.empty((0, 3))), ["kinect", "n > 0"]),
    "shapes": (Channel([0, 1], POSE, np.zeros((3, 3))), ["kinect", "(2,)", "(3, 3)"]),
    "nan": (Channel([0, 1], POSE, [[0, 0, 0], [0, math.nan, 0]]), ["kinect", "sample 2", "'y'", "finite"]),
    "time_repeats": (Channel([1, 1], POSE, np.zeros((2, 3))), ["kinect", "sample 2", "t = 1.0 s"]),
    "missing_column": (Channel([0], ("x", "y"), [[1, 2]]), ["kinect", "'phi' is missing"]),
    "duplicate_column": (Channel([0], (*POSE, "x"), [[1, 2, 3, 4]]), ["kinect", "'x'", "twice"]),
    "not_si": (Channel([0], POSE, [[1, 2, 3]], {"x": "mm"}), ["channels.kinect.units.x is 'mm'", "expected 'm'"]),
    "period": (Channel([0, 1], POSE, np.zeros((2, 3)), period_s=0.9), ["channels.kinect.period_s is 0.9 s", "1 s"]),
    "period_negative": (Channel([0, 1], POSE, np.zeros((2, 3)), period_s=-1.0), ["channels.kinect.period_s is -1.0 s"]),
}  # fmt: skip


@pytest.mark.parametrize("channel, parts", BAD_CHANNELS.values(), ids=BAD_CHANNELS.keys())
def test_a_channel_that_could_not_be_loaded_is_not_saved(tmp_path, channel, parts):
    run = Recording("omni", None, {"kinect": channel})
    message = refusal(run.save, tmp_path / "run")
    assert message.startswith(str(tmp_path / "run"))
    for part in parts:
        assert part in message
    assert names_in(tmp_path) == []
    assert refusal(validate, run, "this run").startswith("this run: ")


def test_a_comma_in_a_column_name_is_refused():
    run = Recording("omni", None, {"truth": Channel([0], (*POSE, "a,b"), [[1, 2, 3, 4]])})
    assert "column 5 is named 'a,b'" in refusal(validate, run, "run")


# ------------------------------------------------------------------------------------------------------ the YAML guard


@pytest.mark.parametrize("text, value", [
    ("1e-3", 0.001), ("1E3", 1000.0), ("+.5", 0.5), ("5.", 5.0), ("-0.0", 0.0), ("12", 12), ("010", 10), ("-3", -3),
    ("true", True), ("False", False), ("null", None), ("~", None), ("", None),
    ("on", "on"), ("off", "off"), ("yes", "yes"), ("No", "No"), ("y", "y"), ("1:30", "1:30"), ("1_000", "1_000"),
    ("2024-01-01", "2024-01-01"), ("0x1F", "0x1F"), ("'1e-3'", "1e-3"), ('".nan"', ".nan"), ("infinite", "infinite"),
])  # fmt: skip
def test_scalars_follow_yaml_1_2(text, value):
    read = load_yaml(f"key: {text}\n", "text")["key"]
    assert read == value and type(read) is type(value)


def test_keys_stay_text():
    assert load_yaml("{on: 1, 3: 2, null: 3, 1e3: 4}", "text") == {"on": 1, "3": 2, "null": 3, "1e3": 4}


@pytest.mark.parametrize("value", ["nan", "NaN", ".NaN", "inf", "-inf", "+.INF", "Infinity"])
def test_nan_and_infinity_are_refused_with_their_key(value):
    message = refusal(load_yaml, f"robot:\n  wheels:\n    - radius_m: 0.1\n    - radius_m: {value}\n", "a.yaml")
    assert message == f"a.yaml: line 4: robot.wheels[1].radius_m: '{value}', expected a finite number"


def test_nesting_to_the_limit_is_read():
    assert load_yaml("{a: " + "[" * 31 + "]" * 31 + "}", "text")
    assert "nested" in refusal(load_yaml, "{a: " + "[" * 32 + "]" * 32 + "}", "text")


@pytest.mark.parametrize(
    "value",
    [0.1 + 0.2, 1e-05, 1e300, 5e-324, 3, True, None, "", " a ", "no", "é°", "a\nb\n", "x " * 200, "1e5", "- a", "#"],
)
def test_what_the_guard_dumps_it_reads(value):
    shared = [value]
    data = {"a": {"b": [value, {"c": value}]}, "d": shared, "e": shared}
    assert load_yaml(dump_yaml(data), "text") == data


def test_an_input_error_stays_on_one_line_and_can_be_sent_to_another_process():
    error = pickle.loads(pickle.dumps(InputError("a file named\nx\u2028y: expected z")))
    assert isinstance(error, ValueError) and str(error) == "a file named x y: expected z"
