"""Rows that stop while the robot goes on, slowly or back and forth."""

from dataclasses import replace

import numpy as np
import pytest

from drake_ispace.explain.check.check import check
from drake_ispace.files.recording import Channel, Recording
from hidden import two_wheels

SOUND = {"left_share": 0.0, "late_s": 0.0, "lag_s": 0.0, "in_step": True}
SLOW = {"speeds_m_s": (0.0, 0.08), "rates_rad_s": (-0.3, 0.3)}


def changed(run, channel, change):
    """The run with other values (n, d) of a channel at its times (n,)."""
    there = run.channels[channel]
    values = change(there.t, there.values.copy())
    return replace(run, channels=run.channels | {channel: replace(there, values=values)})


def frozen(run, channel, since_s, until_s):
    """The run with rows that repeat for a while."""
    def hold(t, values):
        first, end = np.searchsorted(t, [since_s, until_s])
        values[first:end] = values[first]
        return values
    return changed(run, channel, hold)


def faults(*runs):
    findings = check(two_wheels.model(), list(runs)).findings
    return [(finding.fault, finding.channel, finding.runs) for finding in findings]


@pytest.mark.first_case
@pytest.mark.parametrize(("given", "since_s", "lasts_s"), [
    (SLOW, 9.0, 2.0), (SLOW, 12.0, 1.0), (SLOW | {"camera_hz": 5.0}, 9.0, 2.0),
    ({"speeds_m_s": (0.0, 0.0), "rates_rad_s": (-0.2, 0.2)}, 9.0, 2.0), ({}, 12.0, 1.0),
])
def test_a_camera_that_stops_is_told_however_slow_the_robot(given, since_s, lasts_s):
    runs = [two_wheels.drive(60 + i, 20.0, **SOUND | given) for i in range(2)]
    stops = frozen(runs[1], "kinect", since_s, since_s + lasts_s)
    assert faults(runs[0], stops) == [("channel_frozen", "kinect", (1,))]


@pytest.mark.parametrize(("creeps_m", "told"), [(4e-4, False), (4e-2, True)])
def test_fixes_may_repeat_while_the_robot_moves_by_less_than_their_last_digit(creeps_m, told):
    t = 0.02 * np.arange(900)
    way = np.interp(t, [0.0, 8.0, 11.0, 18.0], [0.0, 1.6, 1.6 + creeps_m, 3.0 + creeps_m])
    wheels = np.column_stack([way, way]) / two_wheels.RADIUS_M
    x = np.where((t > 8.0) & (t < 11.0), 1.6, way)
    fixes = np.column_stack([np.round(x, 3), np.zeros(900), np.zeros(900)])
    run = Recording("mine", "velocity_base", {
        "encoder": Channel(t, ("theta_1", "theta_2"), wheels),
        "kinect": Channel(t[::3], ("x", "y", "phi"), fixes[::3]),
    })
    assert (("channel_frozen", "kinect", (0,)) in faults(run)) == told


def test_a_camera_that_passes_small_motions_over_does_not_stop():
    """Its driver sends the last pose again until a place has moved by 5 mm."""
    def steady(t, values):
        for i in range(1, len(values)):
            if np.hypot(*(values[i] - values[i - 1])[:2]) < 5e-3 and abs(values[i, 2] - values[i - 1, 2]) < 0.02:
                values[i] = values[i - 1]
        return values

    starts_and_stops = {"moves": 0.5, "speeds_m_s": (0.0, 0.1), "rates_rad_s": (-0.2, 0.2), "camera_hz": 15.0}
    runs = [two_wheels.drive(60 + i, 20.0, **SOUND | starts_and_stops) for i in range(2)]
    assert "channel_frozen" not in {fault for fault, _, _ in faults(*(changed(run, "kinect", steady) for run in runs))}


@pytest.mark.first_case
@pytest.mark.parametrize(("seed", "since_s"), [(61, 24.34), (61, 20.0), (62, 10.0)])
def test_wheels_that_stop_being_read_while_they_turn_round_are_no_counter_that_starts_anew(seed, since_s):
    back_and_forth = {"speeds_m_s": (-0.4, 0.4), "camera_hz": 15.0}
    runs = [two_wheels.drive(one, 30.0, **SOUND | back_and_forth) for one in (60, seed)]
    found = faults(runs[0], frozen(runs[1], "encoder", since_s, since_s + 2.0))
    assert found == [("channel_frozen", "encoder", (1,))]


@pytest.mark.first_case
@pytest.mark.parametrize("turn", [2.0 * np.pi, 2.0**11 * 2.0 * np.pi / two_wheels.COUNTS * 4.0])
def test_a_counter_that_starts_anew_right_after_a_rest_is_told(turn):
    runs = [two_wheels.drive(60 + i, 20.0, **SOUND | {"speeds_m_s": (-0.4, 0.1)}) for i in range(2)]
    wrapped = changed(runs[1], "encoder", lambda t, v: np.mod(v - v[0], turn))
    fault = "angle_wrap" if turn < 7.0 else "counter_wrap"
    assert [finding[0] for finding in faults(runs[0], wrapped)] == [fault]


def test_a_row_that_is_wrong_does_not_hide_that_angles_start_anew():
    runs = [two_wheels.drive(60 + i, 20.0, **SOUND) for i in range(2)]

    def with_a_spike(t, values):
        values = np.mod(values, 2.0 * np.pi)
        values[500, 0] += 30.0
        return values

    assert "angle_wrap" in {fault for fault, _, _ in faults(runs[0], changed(runs[1], "encoder", with_a_spike))}
