"""Logs of REGBOT as recordings."""

import numpy as np
import pytest

from drake_ispace.blocks.errors import InputError
from drake_ispace.files.importers.regbot import COUNTS_PER_WHEEL_TURN, WHEEL_RADIUS_M, load_folder, load_log
from drake_ispace.robots.recordings import load

HEAD = """%% logfile from robot 1
%  1    time 0.000 sec
%  2    mission (0) state 2
%  3  4  5 Acc x,y,z [m/s2]: -9.2 0.9 2.6
%  6  7  8 Gyro x,y,z [deg/s]: 0.1 0.2 0.3
%  9 10 Motor velocity ref left, right: 2.10 2.10
% 11 12 Motor voltage [V] left, right: 2.1 2.1
% 13 14 Motor current left, right [A]: -0.001 0.018
% 15 16 Encoder left, right: 4294967294 5
% 17 18 Wheel velocity [m/s] left, right: 0.0 0.0
% 19    Turnrate [r/s]: 0.0
% 20 21 22 23 Pose x,y,h,tilt [m,m,rad,rad]: 0.0 0.0 0.0 1.8
% 24    Battery voltage [V]: 12.20
%% Configuration as seen in client
% 11 Motor voltage is not here
"""
ROWS = """0.001 2 -9.0 0.9 2.6 90 180 -90 2.1 2.1 2.1 3.1 0.1 0.2 4294967294 5 0.3 0.4 0 1 2 3 4 12.1
0.002 2 -9.0 0.9 2.6 90 180 -90 2.1 2.1 2.1 3.1 0.1 0.2 4 4 0.3 0.4 0 1 2 3 4 12.1
"""


@pytest.fixture
def log(tmp_path):
    file = tmp_path / "step.txt"
    file.write_text(HEAD + ROWS)
    return file


def test_channels_in_si_units_right_before_left(log):
    channels = load_log(log).channels
    truth = channels["truth"]
    row = dict(zip(truth.columns, truth.values[0], strict=True))
    assert row == {
        "x": 1, "y": 2, "phi": 3, "tilt": 4, "voltage_r": 3.1, "voltage_l": 2.1, "current_r": 0.2, "current_l": 0.1,
        "speed_r": 0.4, "speed_l": 0.3, "battery": 12.1,
    }  # fmt: skip
    assert truth.units["voltage_r"] == "V" and truth.units["current_l"] == "A" and truth.units["speed_l"] == "m/s"
    turns = channels["encoder"].values * COUNTS_PER_WHEEL_TURN / (2 * np.pi)
    np.testing.assert_allclose(turns, [[0, 0], [-1, 6]])  # the left counter wraps
    np.testing.assert_allclose(channels["imu"].values[0], [-9.0, -0.9, -2.6, np.pi / 2, -np.pi, np.pi / 2])
    assert truth.period_s == 0.001


def test_without_counts_and_acceleration_there_are_no_such_channels(log):
    lines = [line for line in HEAD.splitlines() if not any(word in line for word in ("Acc", "Encoder", "Battery"))]
    log.write_text("\n".join(lines) + "\n" + ROWS)
    run = load_log(log)
    assert list(run.channels) == ["truth"] and "battery" not in run.channels["truth"].columns


def test_a_log_can_be_saved(log):
    run = load_log(log)
    run.save(log.parent / "saved")
    again = load(log.parent / "saved")
    assert again.channels["truth"].units == run.channels["truth"].units
    np.testing.assert_array_equal(again.channels["encoder"].values, run.channels["encoder"].values)


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        (ROWS, "no line of the head names 'Motor voltage', expected '%  7  8 Motor voltage ...'"),
        (HEAD, "no row of numbers, expected at least one"),
        (HEAD + "0.001 2 3\n", "ay is in column 4, expected 1 to 3 as in the rows"),
        (HEAD + ROWS + "0.003 2\n", "line 18: 2 cells, expected 24"),
        (HEAD + ROWS.replace("3.1", "inf"), "line 16: column 12 holds 'inf', expected a finite number"),
    ],
)
def test_bad_logs_are_refused(log, content, sentence):
    log.write_text(content)
    with pytest.raises(InputError) as error:
        load_log(log)
    assert str(error.value) == f"{log}: {sentence}"


def test_time_must_rise(log):
    log.write_text(HEAD + ROWS.replace("0.002", "0.001"))
    with pytest.raises(InputError, match=r"sample 2: t = 0.001 s follows t = 0.001 s, expected t to increase"):
        load_log(log)


def test_missing_files_are_refused(tmp_path):
    with pytest.raises(InputError, match="expected a file, there is none"):
        load_log(tmp_path / "step.txt")
    with pytest.raises(InputError, match="expected a folder with logs"):
        load_folder(tmp_path)


def test_measured_motor_steps(measured):
    runs = load_folder(measured("regbot/motor_steps"))
    assert len(runs) == 20 and sum("encoder" in run.channels for run in runs) == 3
    for run in runs:
        truth = run.channels["truth"]
        for side in "rl":
            volts, speed, current = (truth.column(f"{name}_{side}") for name in ("voltage", "speed", "current"))
            assert 0.25 < speed[-20:].mean() / volts[-1] < 0.45  # [m/s/V], same sign
            assert current[-20:].mean() * volts[-1] > -0.02
        assert truth.period_s == 0.001 and 11.9 < truth.column("battery").mean() < 12.5


def test_counts_of_motor_steps_agree_with_their_odometry(measured):
    for name in ("vel_step", "vel_step_2", "vel_step_-2"):
        run = load_log(measured(f"regbot/motor_steps/{name}.txt"))
        travelled = WHEEL_RADIUS_M * run.channels["encoder"].values[-1].mean()
        assert travelled == pytest.approx(run.channels["truth"].column("x")[-1], rel=0.04)


def test_imu_of_the_balancing_robot(measured):
    run = load_log(measured("regbot/balance/bal_drive_4.log"))
    truth, imu = run.channels["truth"], run.channels["imu"]
    upright = abs(truth.column("tilt")) < 0.1
    assert imu.column("az")[upright].mean() == pytest.approx(9.81, abs=0.2)
    assert np.corrcoef(imu.column("wy"), np.gradient(truth.column("tilt"), truth.t))[0, 1] > 0.9
    assert np.corrcoef(imu.column("wz"), np.gradient(truth.column("phi"), truth.t))[0, 1] > 0.6
