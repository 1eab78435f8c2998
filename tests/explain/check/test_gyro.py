"""A gyro on a robot whose model says nothing of one, beside the camera's headings."""

from dataclasses import replace

import numpy as np
import pytest

from drake_ispace.explain.check.check import check
from drake_ispace.explain.predict.case import prepare
from drake_ispace.files.recording import Channel
from hidden import two_wheels

COLUMNS = ("ax", "ay", "az", "wx", "wy", "wz")


def with_gyro(share, rate, late_s=0.0, seed=7, **how):
    """A sound run whose gyro turns by (1 + share) times the wheels' rate and `rate` [rad/s], and stamps late."""
    run = two_wheels.drive(seed, 16.0, 0.0, 0.0, 0.0, in_step=True, **how)
    encoder, forward = run.channels["encoder"], two_wheels.model().rover.plant.geometry.forward
    speed, turning = np.gradient(encoder.values @ forward[[0, 2]].T, encoder.t, axis=0).T
    values = 0.01 * np.random.default_rng(3).standard_normal((len(turning), 6))
    felt = np.gradient(speed, encoder.t), speed * turning, 9.80665, 0.0, 0.0, (1.0 + share) * turning + rate
    for column, motion in zip(values.T, felt, strict=True):
        column += motion
    return replace(run, channels=run.channels | {"imu": Channel(encoder.t + late_s, COLUMNS, values)})


@pytest.mark.first_case
@pytest.mark.parametrize("share, rate", [(0.03, 0.03), (0.3, 0.0), (-0.1, 0.0), (0.0, 0.3), (0.0, -0.05)])
def test_its_scale_and_its_zero_are_told_and_repaired(share, rate):
    run = with_gyro(share, rate)
    checked = check(two_wheels.model(), [run])
    (finding,) = checked.findings
    assert (finding.fault, finding.channel) == ("gyro_off", "imu") and checked.serious == []
    repaired = finding.repairs[0].apply(run).channels["imu"].column("wz")
    sound = with_gyro(0.0, 0.0).channels["imu"].column("wz")
    assert np.mean(repaired - sound) == pytest.approx(0.0, abs=0.004)
    assert np.polyfit(sound, repaired, 1)[0] == pytest.approx(1.0, abs=0.02)


@pytest.mark.first_case
@pytest.mark.parametrize("share, rate, late_s", [(0.0, 0.0, 0.0), (0.004, 0.006, 0.0), (0.0, 0.0, 0.08)])
def test_a_sound_gyro_may_be_late_and_off_by_a_little(share, rate, late_s):
    assert check(two_wheels.model(), [with_gyro(share, rate, late_s)]).findings == []


@pytest.mark.first_case
@pytest.mark.parametrize("most_rad_s", [0.0, 0.02])
def test_a_gyro_is_not_off_where_the_robot_hardly_turns(most_rad_s):
    run = with_gyro(0.0, 0.0, rates_rad_s=(-most_rad_s, most_rad_s))
    assert "gyro_off" not in {finding.fault for finding in check(two_wheels.model(), [run]).findings}


@pytest.mark.slow
def test_a_gyro_is_not_off_beside_a_camera_of_another_run():
    run, other = with_gyro(0.0, 0.0), with_gyro(0.0, 0.0, seed=8)
    swapped = replace(run, channels=run.channels | {"kinect": other.channels["kinect"]})
    found = {(finding.fault, finding.channel) for finding in check(two_wheels.model(), [swapped]).findings}
    assert ("channel_of_another_run", "kinect") in found and ("gyro_off", "imu") not in found


def test_explain_says_that_it_uses_no_gyro():
    assert "the IMU is not used" in prepare(two_wheels.model(), [with_gyro(0.0, 0.0)]).warning
    assert "IMU" not in prepare(two_wheels.model(), [two_wheels.drive(7, 16.0, 0.0, 0.0, 0.0, in_step=True)]).warning
