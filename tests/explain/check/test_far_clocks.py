"""Clocks that are off by more than a few seconds, as GPS time is against UTC."""

from dataclasses import replace

import pytest

from drake_ispace.explain.check.check import check
from drake_ispace.explain.check.compare.clocks.far import far_offsets
from drake_ispace.explain.check.compare.clocks.trial import trials_of
from drake_ispace.explain.check.compare.links import base_of, link_of
from drake_ispace.robots.library import robots
from hidden import two_wheels

SOUND = {"left_share": 0.0, "late_s": 0.0, "lag_s": 0.0, "in_step": True}


@pytest.fixture(scope="module")
def runs():
    return [two_wheels.drive(910 + i, 40.0, **SOUND) for i in range(2)]


def moved(run, late_s, channel="kinect"):
    """The run with a channel's stamps later."""
    there = run.channels[channel]
    return replace(run, channels=run.channels | {channel: replace(there, t=there.t + late_s)})


def swapped(run, other, channel):
    """The run with a channel of another one."""
    return replace(run, channels=run.channels | {channel: other.channels[channel]})


def far(run, channel):
    """Offsets [s] that are found far away."""
    base = base_of(run, robots()["rover"], two_wheels.model().rover)
    return [path.lag_s for _, path, _ in far_offsets(trials_of([(0, link_of(run, base, channel), base)]))]


@pytest.mark.first_case
@pytest.mark.parametrize("late_s", [18.0, 7.0, -5.6])
def test_a_camera_that_is_off_in_all_runs_is_told_once(runs, late_s):
    (finding,) = check(two_wheels.model(), [moved(run, late_s) for run in runs]).findings
    assert (finding.fault, finding.channel, finding.runs) == ("clock_offset", "kinect", (0, 1))
    assert finding.repairs[0].offset_s == pytest.approx(-late_s, abs=0.05)


def test_wheels_that_camera_and_command_are_off_against_by_the_same_are_told(runs):
    (finding,) = check(two_wheels.model(), [moved(run, 18.0, "encoder") for run in runs]).findings
    assert (finding.fault, finding.channel, finding.runs) == ("clock_offset", "encoder", (0, 1))
    assert finding.repairs[0].offset_s == pytest.approx(-18.0, abs=0.05)


def test_in_one_run_it_is_told_of_that_run(runs):
    (finding,) = check(two_wheels.model(), [runs[0], moved(runs[1], 11.0)]).findings
    assert (finding.fault, finding.channel, finding.runs) == ("clock_offset", "kinect", (1,))
    assert finding.repairs[0].offset_s == pytest.approx(-11.0, abs=0.05)


@pytest.mark.parametrize("late_s", [-15.0, 8.0, 1e4])
@pytest.mark.parametrize("channel", ["kinect", "command"])
def test_any_offset_is_found_at_which_half_of_the_run_overlaps(runs, channel, late_s):
    assert far(moved(runs[0], late_s, channel), channel) == [pytest.approx(-late_s, abs=0.05)]


@pytest.mark.parametrize("channel", ["kinect", "command"])
def test_a_channel_of_another_run_has_no_offset(channel):
    some = [two_wheels.drive(920 + i, 16.0, **SOUND) for i in range(4)]
    pairs = [(run, other) for run in some for other in some if run is not other]
    assert [far(swapped(run, other, channel), channel) for run, other in pairs] == [[]] * len(pairs)


def test_motion_that_comes_again_tells_no_time(runs):
    (run, _), again = runs, {"speeds_m_s": (0.2, 0.2), "rates_rad_s": (0.6, 0.6)}
    steady = two_wheels.drive(930, 40.0, **SOUND, **again)
    assert far(moved(steady, 18.0), "kinect") == [] and far(moved(run, 18.0), "kinect") != []


def test_a_sound_channel_is_not_looked_at(runs):
    assert far(runs[0], "kinect") == [] and far(moved(runs[0], 3.0), "kinect") == []
