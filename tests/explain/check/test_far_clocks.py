"""Clocks that are off by more than a few seconds, as GPS time is against UTC."""

from dataclasses import replace

import numpy as np
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


def leapt(run, at_s, by_s, *channels, rows=None):
    """The run with stamps of some channels later from a moment on; rows: no more than so many of each."""
    changed = {}
    for name in channels:
        there = run.channels[name]
        first = int(np.searchsorted(there.t, at_s))
        t = there.t.copy()
        t[first : None if rows is None else first + rows] += by_s
        order = np.argsort(t)
        changed[name] = replace(there, t=t[order], values=there.values[order], period_s=None)
    return replace(run, channels=run.channels | changed)


@pytest.mark.first_case
@pytest.mark.parametrize("by_s", [600.0, 40.0])
@pytest.mark.parametrize("channel", ["kinect", "encoder", "command"])
def test_a_clock_that_jumps_beyond_the_end_of_the_run_is_set_back(runs, channel, by_s):
    (finding,) = check(two_wheels.model(), [runs[0], leapt(runs[1], 15.0, by_s, channel)]).findings
    assert (finding.fault, finding.channel, finding.runs) == ("clock_jump", channel, (1,))
    assert finding.repairs[0].offset_s == pytest.approx(-by_s, abs=0.05)


@pytest.mark.parametrize("by_s", [-100.0, 100.0])
def test_a_command_may_come_long_before_or_after_the_run(runs, by_s):
    told = runs[1].channels["command"]
    still = np.append(told.t, told.t[-1] + by_s) if by_s > 0.0 else np.append(told.t[0] + by_s, told.t)
    values = np.insert(told.values, len(told.t) if by_s > 0.0 else 0, 0.0, axis=0)
    told = replace(told, t=still, values=values, period_s=None)
    longer = replace(runs[1], channels=runs[1].channels | {"command": told})
    assert check(two_wheels.model(), [runs[0], longer]).findings == []


def test_clocks_that_jump_in_all_runs_are_told_of_each(runs):
    found = check(two_wheels.model(), [leapt(run, 15.0, 600.0, "kinect") for run in runs]).findings
    assert sorted((finding.fault, finding.channel, finding.runs) for finding in found) == [
        ("clock_jump", "kinect", (0,)), ("clock_jump", "kinect", (1,)),
    ]


@pytest.mark.first_case
@pytest.mark.parametrize("channels", [("encoder", "kinect", "command"), ("encoder",), ("kinect",), ("command",)])
def test_a_clock_that_is_set_from_another_epoch_is_set_back(runs, channels):
    checked = check(two_wheels.model(), [runs[0], leapt(runs[1], 15.0, 1.7e9, *channels)])
    assert {(finding.fault, finding.channel) for finding in checked.findings} == {
        ("epoch_stamps", channel) for channel in channels
    }
    for name, channel in checked.repaired[1].channels.items():
        assert channel.t == pytest.approx(runs[1].channels[name].t, abs=0.02)


def test_a_clock_that_is_set_twice_is_set_back_twice(runs):
    later = leapt(runs[1], 15.0, 1e7, "kinect")
    at_s = float(later.channels["kinect"].t[900])
    twice = leapt(later, at_s, 1e8, "kinect")
    checked = check(two_wheels.model(), [runs[0], twice])
    assert [finding.fault for finding in checked.findings] == ["epoch_stamps"] * 2
    assert checked.repaired[1].channels["kinect"].t == pytest.approx(runs[1].channels["kinect"].t, abs=0.01)


def test_fixes_of_the_same_motion_after_the_wheels_were_logged_are_not_moved_before_earlier_ones(runs):
    """The robot repeats what it did, the camera sees nothing for a while, and the wheels are logged no longer."""
    kinect = runs[1].channels["kinect"]
    again = kinect.t >= 20.0
    noise = np.random.default_rng(3).normal(0.0, two_wheels.FIX_RMS, (again.sum(), 3))
    seen = replace(
        kinect, t=np.append(kinect.t[kinect.t < 39.0], kinect.t[again] + 25.0),
        values=np.vstack([kinect.values[kinect.t < 39.0], kinect.values[again] + noise]),
    )
    longer = replace(runs[1], channels=runs[1].channels | {"kinect": seen})
    assert check(two_wheels.model(), [runs[0], longer]).findings == []


def test_motion_that_the_wheels_did_not_make_is_not_set_back(runs):
    foreign = two_wheels.drive(950, 40.0, **SOUND).channels["kinect"]
    late = leapt(replace(runs[1], channels=runs[1].channels | {"kinect": foreign}), 15.0, 600.0, "kinect")
    before, after = runs[1].channels["kinect"], late.channels["kinect"]
    mixed = replace(
        after, values=np.where((after.t < 15.0)[:, None], before.values[: len(after.t)], after.values)
    )
    found = check(two_wheels.model(), [runs[0], replace(late, channels=late.channels | {"kinect": mixed})]).findings
    assert "clock_jump" not in {finding.fault for finding in found}


@pytest.mark.first_case
@pytest.mark.parametrize("by_s", [600.0, 150.0, 3600.0])
def test_a_long_pause_of_all_channels_is_a_gap(runs, by_s):
    (finding,) = check(two_wheels.model(), [runs[0], leapt(runs[1], 15.0, by_s, *runs[1].channels)]).findings
    assert (finding.fault, finding.channel) == ("rows_missing", "encoder")


@pytest.mark.first_case
@pytest.mark.parametrize(("channel", "by_s"), [
    ("command", 1e9), ("encoder", 1e9), ("kinect", 1e9), ("kinect", -1e9), ("kinect", 1e6),
])
def test_a_stamp_that_is_far_from_all_others_is_left_out(runs, channel, by_s):
    checked = check(two_wheels.model(), [runs[0], leapt(runs[1], 15.0, by_s, channel, rows=1)])
    (finding,) = checked.findings
    assert (finding.fault, finding.channel, finding.limited) == ("clocks_disjoint", channel, True)
    assert len(checked.repaired[1].channels[channel].t) == len(runs[1].channels[channel].t) - 1
