"""Fixes that were smoothed before they were logged."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter, savgol_filter

from drake_ispace.explain.check.check import check
from hidden import two_wheels

SOUND = {"left_share": 0.0, "late_s": 0.0, "lag_s": 0.0, "in_step": True}
KEPT = 0.3  # of the coefficients of the low-pass: 0.08 s at 30 Hz


def lowpassed(column):
    return lfilter([KEPT], [1.0, KEPT - 1.0], column, zi=[(1.0 - KEPT) * column[0]])[0]


def meant(column, over):
    return np.convolve(np.pad(column, over // 2, mode="edge"), np.full(over, 1.0 / over), "valid")


HOW = {
    "a mean of five": lambda column: meant(column, 5), "a mean of nine": lambda column: meant(column, 9),
    "a low-pass": lowpassed, "parabolas": lambda column: savgol_filter(column, 11, 3),
}


def smoothed(run, how):
    kinect = run.channels["kinect"]
    poses = [how(column) for column in (*kinect.values[:, :2].T, np.unwrap(kinect.values[:, 2]))]
    values = np.column_stack([*poses, kinect.values[:, 3:]])
    return replace(run, channels=run.channels | {"kinect": replace(kinect, values=values)})


@pytest.fixture(scope="module")
def rover():
    return two_wheels.drive(3, 20.0, **SOUND)


@pytest.mark.first_case
@pytest.mark.parametrize("how", HOW)
def test_smoothed_fixes_are_told_and_thinned_out(rover, how):
    checked = check(two_wheels.model(), [smoothed(rover, HOW[how])])
    assert [f.fault for f in checked.findings] == ["samples_smoothed"] and not checked.serious
    after, before = checked.repaired[0].channels["kinect"], rover.channels["kinect"]
    assert 3.0 <= len(before.t) / len(after.t) <= 9.0


@pytest.mark.first_case
@pytest.mark.parametrize("changes", [
    {}, {"late_s": 0.1}, {"left_share": 0.03, "late_s": 0.1, "lag_s": 0.05},
], ids=["sound", "late", "three effects"])
def test_fixes_as_measured_are_not_smoothed(changes):
    assert not check(two_wheels.model(), [two_wheels.drive(4, 20.0, **SOUND | changes)]).findings


@pytest.mark.slow
@pytest.mark.parametrize("seeds", [(0, 1, 2), (20, 21, 22)])
def test_a_slow_camera_beside_wheels_of_another_size_is_not_smoothed(seeds):
    runs = [two_wheels.drive(seed, 30.0, camera_hz=5.0) for seed in seeds]
    assert "samples_smoothed" not in [f.fault for f in check(two_wheels.model(), runs).findings]


def test_counts_that_last_for_several_fixes_are_no_smoothed_camera(rover):
    encoder = rover.channels["encoder"]
    count = 2.0 * np.pi / 60.0
    coarse = replace(encoder, values=count * np.round(encoder.values / count))
    model = two_wheels.model()
    found = check(model, [replace(rover, channels=rover.channels | {"encoder": coarse})]).findings
    assert "samples_smoothed" not in [f.fault for f in found]
