"""A gyro whose range is set to another one: its rates are off by a factor that is no unit."""

from dataclasses import replace

import numpy as np
import pytest

from drake_ispace.explain.check.check import check
from drake_ispace.explain.check.compare.gyro_rates import scales
from drake_ispace.explain.check.compare.hypotheses import RATES
from drake_ispace.files.recording import Channel
from hidden import two_wheels

COLUMNS = ("ax", "ay", "az", "wx", "wy", "wz")


def with_gyro(times, seed=7):
    """A sound run whose gyro is so many times as fast as the wheels."""
    run = two_wheels.drive(seed, 16.0, 0.0, 0.0, 0.0, in_step=True)
    encoder, forward = run.channels["encoder"], two_wheels.model().rover.plant.geometry.forward
    speed, turning = np.gradient(encoder.values @ forward[[0, 2]].T, encoder.t, axis=0).T
    values = 0.01 * np.random.default_rng(3).standard_normal((len(turning), 6))
    for column, motion in enumerate((np.gradient(speed, encoder.t), speed * turning, 9.80665, 0.0, 0.0, turning)):
        values[:, column] += motion
    values[:, 3:] *= times
    return replace(run, channels=run.channels | {"imu": Channel(encoder.t, COLUMNS, values)})


def without(run, channel):
    """The run without a channel."""
    return replace(run, channels={name: one for name, one in run.channels.items() if name != channel})


@pytest.mark.parametrize(("measured", "found"), [
    ([1.0, 1.1], []), ([2.0, 2.02, 2.03], [2.02]), ([0.5, None], [0.5]), ([57.3, 1.0], []), ([4.0], [4.0]),
    ([None], []),
])
def test_a_ratio_that_no_unit_explains_is_a_scale_by_itself(measured, found):
    assert scales(measured, RATES.values()) == found


@pytest.mark.first_case
@pytest.mark.parametrize("times", [2.0, 0.5, 4.0, 8.0])
def test_it_is_told_and_repaired_as_the_camera_says(times):
    (finding,) = check(two_wheels.model(), [with_gyro(times, seed) for seed in (7, 8)]).findings
    assert (finding.fault, finding.channel, finding.runs) == ("gyro_off", "imu", (0, 1))
    assert "as fast as the camera says" in finding.what
    assert finding.repairs[0].matrix[5][5] * times == pytest.approx(1.0, abs=0.02)


@pytest.mark.parametrize("times", [0.5, 2.0])
def test_a_camera_whose_headings_are_wrong_accuses_no_gyro(times):
    runs = [with_gyro(1.0, seed) for seed in (7, 8)]
    kinects = [replace(run.channels["kinect"], values=run.channels["kinect"].values * [1, 1, times]) for run in runs]
    runs = [replace(run, channels=run.channels | {"kinect": one}) for run, one in zip(runs, kinects, strict=True)]
    assert "gyro_off" not in {finding.fault for finding in check(two_wheels.model(), runs).findings}


@pytest.mark.parametrize("counts", [0.5, 2.0])
def test_without_a_camera_wheels_that_turn_too_far_accuse_no_gyro(counts):
    run = without(with_gyro(1.0), "kinect")
    encoder = run.channels["encoder"]
    run = replace(run, channels=run.channels | {"encoder": replace(encoder, values=counts * encoder.values)})
    assert "gyro_off" not in {finding.fault for finding in check(two_wheels.model(), [run]).findings}


def test_degrees_a_second_are_a_unit():
    (finding,) = check(two_wheels.model(), [with_gyro(180.0 / np.pi)]).findings
    assert finding.fault == "wrong_unit" and "in deg/s" in finding.what


@pytest.mark.parametrize("sees", [True, False])
def test_a_gyro_of_another_run_has_no_scale(sees):
    for seed in (8, 9):
        run, other = with_gyro(1.0), with_gyro(1.0, seed)
        run = replace(run, channels=run.channels | {"imu": other.channels["imu"]})
        found = check(two_wheels.model(), [run if sees else without(run, "kinect")]).findings
        assert "gyro_off" not in {finding.fault for finding in found}
