"""Turns at once that no wheel makes: of a robot that is pushed, and of counts that are lost at once."""

from dataclasses import replace

import numpy as np
import pytest

from drake_ispace.blocks.frames import rotated
from drake_ispace.explain.check.check import check
from drake_ispace.faults.repair import CutOut
from hidden import two_wheels

AT_S, LASTS_S = 20.02, 0.15


def runs(**others):
    drive = {"left_share": 0.0, "late_s": 0.05, "lag_s": 0.04, "in_step": True, "others": others}
    return [two_wheels.drive(660 + i, 40.0, **drive) for i in range(2)]


def pushed(run, degrees, at_s=AT_S):
    """The run if somebody turns the robot where it is: the rest of its path is turned about that place."""
    kinect = run.channels["kinect"]
    seen_s = kinect.t - 0.05  # the camera is late
    angles = np.deg2rad(degrees) * np.clip((seen_s - at_s) / LASTS_S, 0.0, 1.0)
    values = kinect.values.copy()
    there = values[np.searchsorted(seen_s, at_s), :2]
    values[:, :2] = there + rotated(values[:, :2] - there, angles)
    values[:, 2] += angles
    return replace(run, channels=run.channels | {"kinect": replace(kinect, values=values)})


def found(changed, other):
    return check(two_wheels.model(), [changed, other]).findings


@pytest.mark.first_case
@pytest.mark.parametrize("degrees", [5.0, -8.0])
def test_a_robot_that_is_turned_by_hand_is_told_and_the_moment_cut_out(degrees):
    first, second = runs()
    (finding,) = found(pushed(first, degrees), second)
    assert (finding.fault, finding.runs) == ("robot_carried", (0,))
    told = float(finding.what.split(" by ")[1].split()[0])
    assert told == pytest.approx(abs(degrees), rel=0.1) and finding.what.endswith("its wheels do not turn it")
    assert finding.from_s - 0.1 < AT_S and AT_S + LASTS_S < finding.to_s + 0.1 and finding.to_s - finding.from_s < 0.5
    assert finding.repairs == (CutOut(finding.from_s, finding.to_s),)


def test_counts_that_are_lost_at_once_are_the_encoders():
    first, second = runs()
    encoder = first.channels["encoder"]
    row = int(np.searchsorted(encoder.t, AT_S))
    values = encoder.values.copy()
    values[row:, 1] -= 0.5
    lost = replace(first, channels=first.channels | {"encoder": replace(encoder, values=values)})
    (finding,) = found(lost, second)
    assert (finding.fault, finding.channel, finding.runs) == ("counter_reset", "encoder", (0,))
    assert (finding.from_s, finding.to_s) == (encoder.t[row - 1], encoder.t[row])


@pytest.mark.first_case
@pytest.mark.parametrize("others", [{}, {"track_share": 0.05}, {"slip_share": 0.05}, {"brake_s2_m": 0.5}], ids=str)
def test_no_turn_is_told_of_whatever_else_is_missing(others):
    assert found(*runs(**others)) == []


@pytest.mark.slow
def test_a_turn_that_takes_the_robot_nowhere_is_not_told():
    first, second = runs()
    assert found(pushed(first, 0.7), second) == []


@pytest.mark.slow
def test_two_turns_by_hand_do_not_hide_each_other():
    first, second = runs()
    checked = found(pushed(pushed(first, 8.0), 8.0, 30.0), second)
    assert [(f.fault, round(f.from_s)) for f in checked] == [("robot_carried", 20), ("robot_carried", 30)]


@pytest.mark.first_case
@pytest.mark.parametrize("share", [0.3, 0.8])
def test_headings_that_turn_without_the_path_are_the_cameras_and_turned_back(share):
    first, second = runs()
    kinect = first.channels["kinect"]
    values, after = kinect.values.copy(), kinect.t > share * 40.0
    values[after, 2] += np.deg2rad(10.0)
    turned = replace(first, channels=first.channels | {"kinect": replace(kinect, values=values)})
    (finding,) = found(turned, second)
    assert (finding.fault, finding.channel, finding.runs) == ("heading_offset", "kinect", (0,))
    back = check(two_wheels.model(), [turned, second]).repaired[0].channels["kinect"].column("phi")
    assert np.abs(np.diff(back - kinect.column("phi"))).max() < 0.02


@pytest.mark.first_case
@pytest.mark.parametrize("late_s", [0.0, 0.05, 0.12])
@pytest.mark.parametrize("rate_rad_s", [1.5, 4.0])
def test_one_quick_turn_before_a_late_camera_is_made_by_wheels(monkeypatch, rate_rad_s, late_s):
    def wandering(random, t, low, high, step_s):
        if low < 0.0:
            return np.where((t >= 9.3) & (t < 9.3 + np.pi / rate_rad_s), rate_rad_s, 0.0)
        return np.where(((t >= 2.0) & (t < 9.0)) | ((t >= 12.0) & (t < 18.0)), 0.4, 0.0)

    monkeypatch.setattr(two_wheels, "wandering", wandering)
    sound = {"left_share": 0.0, "late_s": late_s, "lag_s": 0.04, "in_step": True}
    assert found(*(two_wheels.drive(670 + i, 20.0, **sound) for i in range(2))) == []


@pytest.mark.parametrize(("camera_hz", "most_rad_s"), [(2.0, 3.0), (30.0, 6.0)])
def test_nobody_carries_a_robot_that_spins(camera_hz, most_rad_s):
    sound = {"left_share": 0.0, "late_s": 0.0, "in_step": True, "camera_hz": camera_hz}
    runs = [two_wheels.drive(800 + k, 30.0, rates_rad_s=(-most_rad_s, most_rad_s), **sound) for k in range(2)]
    assert check(two_wheels.model(), runs).findings == []
