"""A robot that stands still, is pushed or slides before a coarse camera, whose place jumps or does not."""

import numpy as np
import pytest

from drake_ispace.explain.check.check import check
from drake_ispace.files.recording import Channel, Recording
from hidden import two_wheels


def coarse(seed, slips=0.0, pushed_m=0.0, jumped_m=(0.0, 0.0), marker_m=(0.0, 0.0)):
    """What is found in 60 s before a camera of 5 Hz, good to 2 cm and 3 degrees, of bends to and fro between rests.

    slips: share of the way, from 20 s to 28 s: at rest from 25 s on. pushed_m: along x, from 16.5 s to 17.5 s, at rest.
    jumped_m: by which the camera's places are off from 40 s and from 48 s on. marker_m: ahead, and to the left.
    """
    t, rng = 0.02 * np.arange(3000), np.random.default_rng(seed)
    steps = 0.02 * 0.8 * np.interp(t % 18.0, [1.0, 2.0, 6.0, 7.0, 10.0, 11.0, 15.0, 16.0], [0, 1, 1, 0, 0, -1, -1, 0])
    phi = 0.4 * np.cumsum(steps)
    wheels = np.cumsum(steps)[:, None] + two_wheels.HALF_TRACK_M * phi[:, None] * [1.0, -1.0]
    axes = np.column_stack([np.cos(phi), np.sin(phi)])
    places = np.cumsum((steps * (1.0 - slips * ((t > 20.0) & (t < 28.0))))[:, None] * axes, axis=0)
    places += marker_m[0] * axes + marker_m[1] * axes[:, ::-1] * [-1.0, 1.0]
    places[:, 0] += np.interp(t, [16.5, 17.5], [0.0, pushed_m])
    places[:, 1] += jumped_m[0] * (t > 40.0) + jumped_m[1] * (t > 48.0)
    poses = np.column_stack([places, phi])[::10]
    count = 2.0 * np.pi / two_wheels.COUNTS
    run = Recording("mine", "velocity_base", {
        "encoder": Channel(t, ("theta_1", "theta_2"), count * np.floor(wheels / two_wheels.RADIUS_M / count)),
        "kinect": Channel(t[::10], ("x", "y", "phi"), poses + [0.02, 0.02, 0.05] * rng.standard_normal(poses.shape)),
    })
    found = check(two_wheels.model(), [run]).findings
    return [(finding.fault, round(finding.from_s), round(finding.to_s)) for finding in found]


@pytest.mark.parametrize("seed", [0, 5])
@pytest.mark.parametrize("marker_m", [(0.0, 0.9), (1.5, 0.0)])
def test_a_robot_that_stands_still_is_not_carried_by_the_noise_of_a_marker_far_from_its_middle(seed, marker_m):
    assert coarse(seed, marker_m=marker_m) == []


@pytest.mark.parametrize("seed", [0, 1])
def test_a_robot_that_is_pushed_at_rest_is_carried(seed):
    assert coarse(seed, pushed_m=0.15) == [("robot_carried", 16, 19)]


@pytest.mark.parametrize("slips", [0.6, 0.9])
@pytest.mark.parametrize("seed", [0, 1])
def test_wheels_that_slide_for_seconds_are_told_once_and_as_no_jumps_of_the_place(seed, slips):
    ((fault, since, until),) = coarse(seed, slips=slips)
    assert fault == "robot_lifted" and since in (19, 20) and until == 25


def test_a_place_that_jumps_in_the_same_run_is_told_beside_wheels_that_slide():
    jumps = [("camera_jump", 40, 40), ("camera_jump", 48, 48)]
    assert coarse(0, jumped_m=(0.3, -0.2)) == jumps
    assert coarse(0, slips=0.6, jumped_m=(0.3, -0.2)) == [*jumps, ("robot_lifted", 20, 25)]
