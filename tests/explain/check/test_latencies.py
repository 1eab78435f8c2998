"""Clocks that are off by the same throughout, in all runs or in one that is later than the others."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d

from drake_ispace.explain.check.check import check
from drake_ispace.explain.check.compare.clocks.clocks import clocks
from drake_ispace.explain.check.compare.clocks.latencies import other_latencies
from drake_ispace.explain.check.compare.links import LATENCIES_S, base_of, link_of
from drake_ispace.files.recording import Channel
from drake_ispace.robots.library import robots
from hidden import two_wheels

SOUND = {"left_share": 0.0, "late_s": 0.0, "lag_s": 0.0}


def findings(late_s, **hidden):
    """What is found in runs whose camera is late by these times."""
    others = SOUND | hidden
    recordings = [
        two_wheels.drive(7300 + i, 20.0, in_step=True, **others | {"late_s": late}) for i, late in enumerate(late_s)
    ]
    return check(two_wheels.model(), recordings).findings


@pytest.mark.first_case
@pytest.mark.parametrize("usual_s", [0.0, 0.06])
def test_it_is_found_beside_a_larger_wheel_and_set_by_the_difference(usual_s):
    (finding,) = findings([usual_s, usual_s + 0.1, usual_s], left_share=0.03)
    assert (finding.fault, finding.channel, finding.runs) == ("clock_offset", "kinect", (1,))
    assert finding.repairs[0].offset_s == pytest.approx(-0.1, abs=0.0101)


def test_a_clock_that_jumps_by_less_than_a_usual_latency_is_told_with_its_jump():
    fast = SOUND | {"in_step": True, "speeds_m_s": (-0.5, 0.5), "rates_rad_s": (-1.5, 1.5)}
    first, second = (two_wheels.drive(7310 + i, 40.0, **fast) for i in range(2))
    kinect = first.channels["kinect"]
    later = replace(kinect, t=kinect.t + np.where(kinect.t > 20.0, 0.15, 0.0))
    first = replace(first, channels=first.channels | {"kinect": later})
    (finding,) = check(two_wheels.model(), [first, second]).findings
    assert (finding.fault, finding.runs) == ("clock_jump", (0,)) and abs(finding.from_s - 20.0) < 1.5
    assert finding.repairs[0].offset_s == pytest.approx(-0.15, abs=0.03)


@pytest.mark.slow
@pytest.mark.parametrize("seed, later_s", [(8300, 0.15), (8300, 0.2), (8330, 0.2)])
def test_a_jump_within_a_window_is_no_drift_and_no_robot_that_is_carried(seed, later_s):
    fast = SOUND | {"in_step": True, "speeds_m_s": (-0.5, 0.5), "rates_rad_s": (-1.0, 1.0)}
    first, second = (two_wheels.drive(seed + i, 40.0, **fast) for i in range(2))
    kinect = first.channels["kinect"]
    later = replace(kinect, t=kinect.t + np.where(kinect.t > 20.0, later_s, 0.0))
    first = replace(first, channels=first.channels | {"kinect": later})
    (finding,) = check(two_wheels.model(), [first, second]).findings
    assert (finding.fault, finding.runs) == ("clock_jump", (0,)) and finding.from_s == pytest.approx(20.2, abs=0.4)
    assert finding.repairs[0].offset_s == pytest.approx(-later_s, abs=0.0101)


@pytest.mark.first_case
@pytest.mark.parametrize("late_s", [(0.0, 0.1), (0.1, 0.1, 0.1), (0.0, 0.03, 0.0)])
def test_nothing_is_found_without_most_runs_that_differ_from_it_clearly(late_s):
    assert not findings(late_s)


def clocks_of_short_runs(seed, late_s, seconds=5.0):
    """What is found of the camera's clock in runs of 5 s, of which a few windows tell; late_s: of each."""
    settings, found = two_wheels.model().rover, []
    for i, late in enumerate(late_s):
        run = moved(two_wheels.drive(seed + i, seconds, in_step=True, **SOUND), "kinect", late)
        base = base_of(run, robots()["rover"], settings)
        found.append((i, link_of(run, base, "kinect"), base))
    return clocks(found)


@pytest.mark.parametrize("seed, seconds, late_s", [(7450, 4.95, 0.05)])
def test_windows_that_only_some_lags_have_are_no_evidence_for_these(seed, seconds, late_s):
    """Cameras that are late by less than is told: another window comes in at another lag of each."""
    assert not clocks_of_short_runs(seed, late_s * np.array([0.0, 1.0, 0.4, 0.9, 0.7]), seconds)


@pytest.mark.parametrize("late_s", [0.1, -0.1])
def test_in_short_runs_a_clock_that_is_off_is_told_by_the_right_time(late_s):
    (finding,) = clocks_of_short_runs(7400, [0.0, 0.0, late_s, 0.0, 0.0])
    assert finding.runs == (2,) and finding.repairs[0].offset_s == pytest.approx(-late_s, abs=0.0101)


def test_lags_that_hardly_tell_are_no_finding():
    scores = [20.0 - 10.0 * np.abs(LATENCIES_S - lag_s) for lag_s in (0.0, 0.1, 0.0)]
    assert not list(other_latencies("kinect", [0, 1, 2], scores))
    (finding,) = other_latencies("kinect", [0, 1, 2], [100.0 * of_run for of_run in scores])
    assert finding.runs == (1,)


def test_runs_that_tell_no_latency_speak_against_none():
    told = -1000.0 * np.abs(LATENCIES_S)
    vague = -10.0 * np.abs(LATENCIES_S - 0.1)
    assert not list(other_latencies("kinect", [0, 1, 2], [told, vague, vague]))


def test_where_no_latency_is_that_of_most_runs_nothing_is_said():
    scores = [-1000.0 * np.abs(LATENCIES_S - lag_s) for lag_s in (-0.1, 0.0, 0.1, 0.2)]
    assert not list(other_latencies("kinect", range(4), scores))


@pytest.mark.parametrize("lag_s, is_told", [(-0.15, True), (0.15, False)])
def test_a_drive_may_follow_later_but_not_before_its_command(lag_s, is_told):
    scores = [-1000.0 * np.abs(LATENCIES_S - lag) for lag in (0.0, lag_s, 0.0)]
    assert bool(list(other_latencies("command", range(3), scores))) is is_told


def test_runs_that_tell_no_time_have_no_part_in_what_is_usual():
    told, late = (1000.0 - 900.0 * np.abs(LATENCIES_S - at_s) for at_s in (0.0, -0.1))
    none = np.zeros(len(LATENCIES_S))
    scores = [told, told, late, none, none, none]
    (finding,) = other_latencies("kinect", range(6), scores)
    assert finding.runs == (2,) and finding.repairs[0].offset_s == pytest.approx(-0.1)


def test_a_command_that_may_as_well_be_no_earlier_than_the_wheels_is_no_finding():
    lags = 1000.0 - 900.0 * np.abs(LATENCIES_S - 0.15)
    vague, early = (1000.0 - scale * np.abs(LATENCIES_S + 0.1) for scale in (1.0, 900.0))
    steep = np.where(LATENCIES_S > 0.05, -200.0, 0.0)  # it is not as late as the others
    assert not list(other_latencies("command", [0, 1, 2], [lags, lags, vague + steep]))
    (finding,) = other_latencies("command", [0, 1, 2], [lags, lags, early])
    assert finding.runs == (2,)


@pytest.mark.slow
def test_outliers_are_left_out_by_the_clock_by_which_they_were_found():
    """Repairs act one after the other: fixes that are off are found before the clock of their run is."""
    first, second, late = (two_wheels.drive(7300 + i, 20.0, in_step=True, **SOUND | {"late_s": lag}) for i, lag in (
        (0, 0.0), (1, 0.0), (2, 0.15),
    ))
    kinect = late.channels["kinect"]
    off = np.isin(np.arange(len(kinect.t)), [200, 300, 400])
    values = kinect.values + 3.0 * off[:, None] * np.array([1.0, 0.0, 0.0])
    late = replace(late, channels=late.channels | {"kinect": replace(kinect, values=values)})
    checked = check(two_wheels.model(), [first, second, late])
    assert {finding.fault for finding in checked.findings} == {"camera_outliers", "clock_offset"}
    assert not checked.serious
    ((_,), (_,), (kept,)) = checked.masked([first, second, late])
    assert np.array_equal(kept.channels["kinect"].values, kinect.values[~off])
    assert np.allclose(kept.channels["kinect"].t, kinect.t[~off] - 0.15, atol=0.0101)


def moved(run, channel, by_s):
    """The run with a channel whose stamps are off."""
    there = run.channels[channel]
    return replace(run, channels=run.channels | {channel: replace(there, t=there.t + by_s)})


@pytest.mark.first_case
@pytest.mark.parametrize("off_s", [0.3, -0.4])
def test_a_clock_is_off_by_what_all_windows_say_and_not_by_where_one_more_comes_in(off_s):
    exact = SOUND | {"in_step": True}
    runs = [moved(two_wheels.drive(7320 + i, 12.0, **exact), "kinect", off_s) for i in range(2)]
    (finding,) = check(two_wheels.model(), runs).findings
    assert finding.channel == "kinect" and finding.repairs[0].offset_s == pytest.approx(-off_s, abs=0.0101)


@pytest.mark.first_case
@pytest.mark.parametrize("off_s", [0.3, 1.0, -0.5])
def test_camera_and_command_that_are_off_alike_are_a_clock_of_the_encoders(off_s):
    lagging = SOUND | {"lag_s": 0.1, "in_step": True}
    runs = [moved(two_wheels.drive(7330 + i, 20.0, **lagging), "encoder", off_s) for i in range(2)]
    (finding,) = [one for one in check(two_wheels.model(), runs).findings if one.fault == "clock_offset"]
    assert finding.channel == "encoder" and finding.repairs[0].offset_s == pytest.approx(-off_s, abs=0.0201)


def with_gyro(run):
    """The run with an IMU that feels how its wheels turn the robot."""
    encoder, random = run.channels["encoder"], np.random.default_rng(3)
    wide = 2.0 * two_wheels.HALF_TRACK_M / two_wheels.RADIUS_M
    rates = random.normal(0.0, 0.005, (len(encoder.t), 6)) + [0.0, 0.0, 9.81, 0.0, 0.0, 0.0]
    rates[:, 5] += np.gradient(gaussian_filter1d((encoder.values[:, 0] - encoder.values[:, 1]) / wide, 1.0), encoder.t)
    imu = Channel(encoder.t, ("ax", "ay", "az", "wx", "wy", "wz"), rates)
    return replace(run, channels=run.channels | {"imu": imu})


@pytest.mark.slow
@pytest.mark.parametrize("late_s", [0.25, 0.3])
def test_sensors_that_agree_need_no_command_to_tell_of_the_encoders(late_s):
    """A drive that is late adds to what the command is off by."""
    slow = SOUND | {"others": {"delay_s": late_s}, "in_step": True}
    runs = [moved(with_gyro(two_wheels.drive(7340 + i, 20.0, **slow)), "encoder", 0.5) for i in range(2)]
    channels = {one.channel for one in check(two_wheels.model(), runs).findings if one.fault == "clock_offset"}
    assert channels == {"encoder"}


@pytest.mark.slow
def test_a_gyro_that_agrees_with_the_wheels_speaks_for_their_clock():
    slow = SOUND | {"others": {"delay_s": 0.3}, "in_step": True}
    runs = [moved(with_gyro(two_wheels.drive(7350 + i, 20.0, **slow)), "kinect", -0.3) for i in range(2)]
    channels = {one.channel for one in check(two_wheels.model(), runs).findings if one.fault == "clock_offset"}
    assert channels == {"kinect"}


def test_a_camera_that_is_early_by_what_no_drive_takes_has_a_clock_of_its_own():
    lagging = SOUND | {"lag_s": 0.1, "in_step": True}
    runs = [moved(two_wheels.drive(7330 + i, 20.0, **lagging), "kinect", -0.4) for i in range(2)]
    (finding,) = check(two_wheels.model(), runs).findings
    assert (finding.fault, finding.channel) == ("clock_offset", "kinect")
