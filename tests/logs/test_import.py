"""From logs of somebody's robot to recordings and to the missing effect, through the command line."""

import numpy as np
import pytest
import somebodys_robot as somebody

import drake_ispace as di
from drake_ispace.blocks.errors import InputError
from drake_ispace.logs.clocks import offset_of
from drake_ispace.logs.convert import convert
from drake_ispace.logs.mapping import load_mapping
from drake_ispace.logs.sniff import sniff

MAPPING = """
format: drake-ispace-mapping/1
robot: {name: cart, kind: differential, wheel_diameter_m: 0.1, track_m: 0.3, wheels: [right, left]}
channels:
  encoder:
    file: wheels.csv
    t: {column: uptime_ms, unit: ms}
    columns:
      theta_right: {column: enc_rechts, counts_per_turn: 4096, wraps_at: 65536}
      theta_left: {column: enc_links, counts_per_turn: 4096, wraps_at: 65536, sign: -1}
  kinect:
    file: mocap.csv
    clock: camera
    t: {column: stamp}
    columns:
      x: {column: X, unit: mm}
      y: {column: Y, unit: mm}
      phi: {column: yaw_deg, unit: deg}
"""


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    """Folders of three runs, and the mapping beside them."""
    folder = tmp_path_factory.mktemp("logs")
    for run in range(3):
        somebody.write_csv(folder / f"run{run}", run)
    (folder / "mapping.yaml").write_text(MAPPING)
    return folder


@pytest.fixture(scope="module")
def recording(logs):
    return convert(load_mapping(logs / "mapping.yaml"), logs / "run0")


def test_numbers_are_those_of_the_logs_in_si_units(recording):
    _, angles, pose = somebody.cart(0)
    encoder, kinect = recording.channels["encoder"], recording.channels["kinect"]
    turned = encoder.column("theta_left") - encoder.column("theta_left")[0]
    assert turned == pytest.approx(angles[::20, 0] - angles[0, 0], abs=2 * np.pi / 4096)
    assert encoder.t[:3] == pytest.approx([12.345, 12.365, 12.385], abs=1e-9)
    assert kinect.column("x") == pytest.approx(pose[::33, 0], abs=3e-3)
    gap = kinect.column("phi") - pose[::33, 2]
    assert np.abs((gap + np.pi) % (2 * np.pi) - np.pi).max() < 6e-3


def test_the_camera_is_put_on_the_robots_clock_and_that_is_said(recording):
    assert recording.channels["kinect"].t[0] == pytest.approx(somebody.UPTIME_S, abs=0.01)
    assert "clock camera: 1699999987.7" in recording.notes and "estimated" in recording.notes


@pytest.mark.parametrize("run", range(3))
def test_the_offset_of_the_clocks_lies_in_its_interval(run):
    uptime_ms, counts, stamps, poses = somebody.samples(run)
    angles = np.unwrap(counts * [-1.0, 1.0] * 2 * np.pi / 4096, period=2 * np.pi * 16, axis=0)
    left, right = (0.05 * (angles - angles[0])).T
    offset = offset_of(uptime_ms / 1e3, np.column_stack([(left + right) / 2, (right - left) / 0.3]), stamps, poses)
    assert abs(offset.offset_s - somebody.OFFSET_S - 1000.0 * run) < max(offset.half_width_s, 1e-3)
    assert offset.half_width_s < 0.02


def test_a_motion_that_repeats_itself_does_not_tell_the_offset():
    t = np.arange(0.0, 40.0, 0.02)
    moved = np.column_stack([0.3 * t, np.sin(2 * np.pi * t / 4.0)])
    x = np.cumsum(0.3 * np.cos(moved[:, 1])) * 0.02
    y = np.cumsum(0.3 * np.sin(moved[:, 1])) * 0.02
    with pytest.raises(InputError, match="the motion does not tell the offset of the clocks"):
        offset_of(t, moved, t + 500.0, np.column_stack([x, y, moved[:, 1]]))


def test_an_offset_that_is_known_is_taken_off(logs, tmp_path):
    (tmp_path / "m.yaml").write_text(MAPPING + "clocks: {camera: {offset_s: 1699999987.655}}\n")
    recording = convert(load_mapping(tmp_path / "m.yaml"), logs / "run0")
    assert recording.channels["kinect"].t[0] == pytest.approx(somebody.UPTIME_S + 0.080, abs=1e-4)
    assert "as the mapping says" in recording.notes


def test_the_proposed_mapping_needs_two_sizes_and_the_counts(logs, tmp_path):
    text = sniff([logs / "run0" / name for name in ("wheels.csv", "mocap.csv", "battery.csv")])
    assert text.count("CORRECT") == 4
    (tmp_path / "m.yaml").write_text(text.replace("counts_per_turn: 2048", "counts_per_turn: 4096"))
    found, wanted = (
        convert(load_mapping(folder / name), logs / "run1")
        for folder, name in ((tmp_path, "m.yaml"), (logs, "mapping.yaml"))
    )
    for name, channel in wanted.channels.items():
        assert np.array_equal(found.channels[name].t, channel.t)
        assert np.array_equal(found.channels[name].values, channel.values)


@pytest.mark.parametrize("channel, header", [
    ("imu", "t,ax,ay,az,gx,gy,gz"), ("command", "t,vx,vy,wz"), ("command", "t,linear_x,angular_z"),
    ("command", "t,v,omega"),
    ("imu", "t," + ",".join(f"{of}.{axis}" for of in ("linear_acceleration", "angular_velocity") for axis in "xyz")),
])
def test_an_imu_and_commands_are_known_by_their_names(tmp_path, channel, header):
    rows = "\n".join(",".join([f"{0.01 * k:.2f}", *["0.5"] * header.count(",")]) for k in range(5))
    (tmp_path / "a.csv").write_text(f"{header}\n{rows}\n")
    text = sniff([tmp_path / "a.csv"])
    assert f"  {channel}:" in text and text.count("by its name") == header.count(",")


def test_what_is_not_known_is_said_to_be_passed_over(tmp_path):
    (tmp_path / "wheels.csv").write_text("t,left,right\n" + "".join(f"{0.01 * k:.2f},{k},{k}\n" for k in range(5)))
    (tmp_path / "b.csv").write_text("t,volts\n" + "".join(f"{0.01 * k:.2f},{k}\n" for k in range(5)))
    text = sniff([tmp_path / "wheels.csv", tmp_path / "b.csv"])
    assert "theta_left: {column: left" in text and text.endswith("# passed over: b.csv, with t, volts\n")


def test_wheels_beside_speeds_are_seen_as_wheels(tmp_path):
    rows = "".join(f"{0.01 * k:.2f},{k},{k},0.1,0.2\n" for k in range(5)).replace("3,3,", "3,nan,", 1)
    (tmp_path / "a.csv").write_text(f"t,enc_left,enc_right,v,omega\n{rows}")
    text = sniff([tmp_path / "a.csv"])
    assert "theta_left" in text and "command:" not in text


def test_from_three_csv_files_to_the_larger_wheel(document, logs, tmp_path):
    """The whole road: the radius is named; the delay went into the offset of the clocks, and is said there."""
    runs = [logs / f"run{i}" for i in range(3)]
    told = document("import", logs / "mapping.yaml", *runs, "--out", tmp_path)
    assert all(any("part of that number" in line for line in lines) for lines in told["notes"].values())
    *training, held_out = told["recordings"].values()
    some = [di.effects()[name] for name in ("single_wheel_radius_error", "camera_latency", "track_error")]
    answer = di.explain(told["model"], [di.load(run) for run in training], [di.load(held_out)], some)
    (effect,) = answer.effects
    names = {effect.name, *effect.equivalents}
    assert "single_wheel_radius_error" in names and answer.verdict in ("named", "set")
    assert effect.parameters["share"].estimate == pytest.approx(0.04, abs=0.004)


def test_times_since_1970_are_counted_from_the_first_and_that_is_said_as_a_number(logs, tmp_path):
    (tmp_path / "wheels.csv").write_text("s,l,r\n" + "".join(f"{1.7e9 + 0.02 * k:.2f},{k},{k}\n" for k in range(9)))
    (tmp_path / "m.yaml").write_text(
        "format: drake-ispace-mapping/1\nrobot: {kind: differential, wheel_diameter_m: 0.1, track_m: 0.3}\n"
        "channels:\n  encoder: {file: wheels.csv, t: s, columns: {theta_left: l, theta_right: r}}\n"
    )
    said = []
    recording = convert(load_mapping(tmp_path / "m.yaml"), tmp_path, said.append)
    assert said == ["times are counted from 1700000000.0 s of the robot's clock"]
    assert recording.channels["encoder"].t == pytest.approx(0.02 * np.arange(9), abs=1e-6)


def test_commands_that_were_logged_as_they_changed_are_taken(tmp_path):
    """Of an even number of steps of time none need be near the middle."""
    (tmp_path / "wheels.csv").write_text("s,l,r\n" + "".join(f"{0.02 * k:.2f},{k},{k}\n" for k in range(200)))
    (tmp_path / "told.csv").write_text("s,v,w\n0.1,0.1,0.0\n1.2,0.2,0.0\n2.6,0.1,0.1\n")
    (tmp_path / "m.yaml").write_text(
        "format: drake-ispace-mapping/1\nrobot: {kind: differential, wheel_diameter_m: 0.1, track_m: 0.3}\nchannels:\n"
        "  encoder: {file: wheels.csv, t: s, columns: {theta_left: l, theta_right: r}}\n"
        "  command: {file: told.csv, t: s, columns: {vx: v, wz: w}}\n"
    )
    command = convert(load_mapping(tmp_path / "m.yaml"), tmp_path).channels["command"]
    assert command.t == pytest.approx([0.1, 1.2, 2.6]) and command.columns == ("vx", "vy", "wz")
    assert command.values[2] == pytest.approx([0.1, 0.0, 0.1])


def test_a_recording_becomes_a_trajectory(said, logs, tmp_path, document):
    told = document("import", logs / "mapping.yaml", logs / "run0", "--out", tmp_path)
    said("export", told["recordings"]["run0"], "--out", tmp_path / "run0.tum")
    rows = np.loadtxt(tmp_path / "run0.tum")
    kinect = di.load(told["recordings"]["run0"]).channels["kinect"]
    assert np.array_equal(rows[:, 0], kinect.t) and np.array_equal(rows[:, 1], kinect.column("x"))
    assert np.hypot(rows[:, 6], rows[:, 7]) == pytest.approx(1.0)


def test_a_tricycles_logs_become_its_rear_wheels(tmp_path):
    (tmp_path / "m.yaml").write_text(
        "format: drake-ispace-mapping/1\n"
        "robot: {kind: tricycle, wheel_diameter_m: 0.2, wheelbase_m: 1.1, track_m: 0.7}\n"
        "channels:\n  encoder:\n    file: a.csv\n    t: t\n    columns:\n      theta_front: w\n"
        "      steer_front: {column: d, unit: deg}\n"
    )
    (tmp_path / "a.csv").write_text("t,w,d\n" + "".join(f"{0.01 * k},{0.1 * k},{30.0}\n" for k in range(50)))
    encoder = convert(load_mapping(tmp_path / "m.yaml"), tmp_path).channels["encoder"]
    assert encoder.columns == ("theta_right", "theta_left")
    forward, turn = 4.9 * 0.1 * np.cos(np.pi / 6), 4.9 * 0.1 * 0.5 / 1.1
    assert encoder.values[-1] == pytest.approx([(forward + 0.35 * turn) / 0.1, (forward - 0.35 * turn) / 0.1])


# -- Bad input


@pytest.mark.parametrize("change, message", [
    (("mapping/1", "mapping/2"), "format is"),
    (("  encoder:", "  encoders:"), "did you mean 'encoder'"),
    (("column: enc_links", "column: enc_link"), "did you mean 'enc_links'"),
    (("theta_left: {", "theta_lift: {"), "theta_left is missing"),
    (("unit: mm", "unit: kg"), "expected one of m, cm, mm"),
    (("unit: ms", "unit: m"), "expected one of s, ms"),
    (("sign: -1", "sign: 0.5"), "expected 1 or -1"),
    (("counts_per_turn: 4096, wraps_at: 65536, sign", "unit: deg, counts_per_turn: 4096, sign"), "got both"),
    (("track_m: 0.3, ", ""), "expected track_m or half_track_m, got neither"),
    (("track_m: 0.3", "track_m: 0.3, half_track_m: 0.15"), "expected track_m or half_track_m, got both"),
    (("wheels: [right, left]", "wheels: [right, rechts]"), "says neither left nor right"),
    (("file: wheels.csv", "file: wheel.csv"), "there is none"),
    (("file: mocap.csv", "file: mocap.csv\n    topic: /x"), "is no bag"),
    (("t: {column: stamp}", "t: {column: X}"), "expected times that increase"),
    (("clock: camera", "clock: camera\n    colour: red"), "unknown key"),
])
def test_a_wrong_mapping_is_named(refused, logs, tmp_path, change, message):
    assert change[0] in MAPPING
    (tmp_path / "m.yaml").write_text(MAPPING.replace(*change, 1))
    sentence = refused("import", tmp_path / "m.yaml", logs / "run0", "--out", tmp_path / "out")
    assert message in sentence and not (tmp_path / "out" / "run0").exists()


def test_two_runs_of_one_name_are_refused(refused, logs, tmp_path):
    run = logs / "run0"
    assert "two folders of the same name" in refused("import", logs / "mapping.yaml", run, run, "--out", tmp_path)


def test_rows_without_a_sample_are_left_out_and_counted(logs, tmp_path):
    (tmp_path / "run").mkdir()
    for name in ("wheels.csv", "mocap.csv"):
        (tmp_path / "run" / name).write_text((logs / "run0" / name).read_text())
    lines = (tmp_path / "run" / "mocap.csv").read_text().splitlines()
    lines[5] = lines[5].split(",")[0] + ",,,"
    (tmp_path / "run" / "mocap.csv").write_text("\n".join(lines))
    said = []
    recording = convert(load_mapping(logs / "mapping.yaml"), tmp_path / "run", said.append)
    assert len(recording.channels["kinect"].t) == len(lines) - 2
    assert "kinect: 1 of 1213 rows without a sample left out" in said


def stamped(folder, logs, change):
    """Write the run with other stamps, made from the index of a row and its stamp, and return what is said of them."""
    folder.mkdir()
    (folder / "wheels.csv").write_text((logs / "run0" / "wheels.csv").read_text())
    header, *rows = (logs / "run0" / "mocap.csv").read_text().splitlines()
    rows = [row.split(",", 1) for row in rows]
    lines = [f"{change(k, [stamp for stamp, _ in rows])},{rest}" for k, (_, rest) in enumerate(rows)]
    (folder / "mocap.csv").write_text("\n".join([header, *lines]))
    said = []
    return convert(load_mapping(logs / "mapping.yaml"), folder, said.append), said, rows


def test_of_samples_that_share_a_time_the_last_is_kept(logs, tmp_path):
    recording, said, rows = stamped(tmp_path / "run", logs, lambda k, t: t[10] if k in (8, 9) else t[k])
    assert len(recording.channels["kinect"].t) == len(rows) - 2
    assert recording.channels["kinect"].column("x")[8] == pytest.approx(float(rows[10][1].split(",")[0]) / 1e3)
    assert any(f"kinect: 2 of {len(rows)} samples at the time of the next one left out" in one for one in said)


def test_times_that_hardly_tell_samples_apart_are_refused(logs, tmp_path):
    with pytest.raises(InputError, match="samples of kinect have the stamp of the next one"):
        stamped(tmp_path / "run", logs, lambda k, t: t[k - k % 3])
