"""Whose clock is off, the encoders' or another channel's? A third one tells, or the stamps that a jump leaves out."""

from dataclasses import replace

import numpy as np
import pytest

from drake_ispace.explain.check.check import check
from hidden import two_wheels

LAGGING = {"left_share": 0.0, "late_s": 0.0, "lag_s": 0.1, "in_step": True}


def drift(t):
    return 1.02 * t


def jump(t):
    return t + 0.8 * (t > 10.0)


def later(t):
    return t + 0.1


def earlier(t):
    return t - 0.1


@pytest.fixture(scope="module")
def sound():
    return [two_wheels.drive(500 + i, 20.0, **LAGGING) for i in range(3)]


def moved(runs, channel, clock, which, without=()):
    """The runs with the clock of a channel off in those of these numbers, and without some channels."""
    changed = []
    for i, run in enumerate(runs):
        channels = {name: one for name, one in run.channels.items() if name not in without}
        if i in which:
            channels[channel] = replace(channels[channel], t=clock(channels[channel].t))
        changed.append(replace(run, channels=channels))
    return changed


def checked(runs):
    return check(two_wheels.model(), runs)


@pytest.mark.first_case
@pytest.mark.parametrize("which", [(0, 1, 2), (1,)])
def test_encoders_whose_clock_is_fast_against_camera_and_command_are_accused(sound, which):
    found = checked(moved(sound, "encoder", drift, which))
    assert {(one.fault, one.channel) for one in found.findings} == {("clock_drift", "encoder")}
    assert sorted(i for one in found.findings for i in one.runs) == list(which)
    for one in found.findings:
        assert "2 % fast against kinect and command" in one.what and not one.rivals
        assert one.repairs[0].rate == pytest.approx(1.0 / 1.02, abs=1e-3)
        assert one.repairs[0].offset_s == 0.0  # two clocks are set when a recording begins
    assert not checked(found.repaired).findings


@pytest.mark.slow
def test_a_fast_clock_that_is_off_as_well_is_set_where_both_show_the_same_time(sound):
    found = checked(moved(sound, "encoder", lambda t: drift(t + 50.0) - 50.0, range(3)))  # 1 s late at the begin
    assert {one.channel for one in found.findings} == {"encoder"}
    for run, right in zip(found.repaired, sound, strict=True):
        assert run.channels["encoder"].t == pytest.approx(right.channels["encoder"].t, abs=0.03)


@pytest.mark.parametrize("which", [(0, 1, 2), pytest.param((1,), marks=pytest.mark.slow)])
def test_of_two_channels_either_clock_may_be_off(sound, which):
    found = checked(moved(sound, "encoder", drift, which, without=["command"])).findings
    assert sorted(i for one in found for i in one.runs) == list(which)
    for one in found:
        assert (one.fault, one.channel, one.rivals) == ("clock_drift", "kinect", ("clock_drift of encoder",))
        assert "(or clock_drift of encoder); repair: kinect: t = 1.0" in str(one)


@pytest.mark.parametrize("clock, which", [
    (drift, (0, 1, 2)), pytest.param(drift, (1,), marks=pytest.mark.slow), (earlier, (1,)),
    pytest.param(later, (1,), marks=pytest.mark.slow),
    pytest.param(lambda t: t + 0.6, (0, 1, 2), marks=pytest.mark.slow),
])
def test_a_command_that_goes_by_the_wheels_speaks_for_them(sound, clock, which):
    found = checked(moved(sound, "kinect", clock, which)).findings
    assert found and {one.channel for one in found} == {"kinect"}
    assert not any("encoder" in rival for one in found for rival in one.rivals)


@pytest.mark.first_case
@pytest.mark.parametrize("clock, which, off_s", [
    (later, (1,), 0.1), (lambda t: t - 0.3, (0, 1, 2), -0.3), (lambda t: t + 0.6, (0, 2), 0.6),
])
def test_encoders_that_are_off_against_both_are_accused(sound, clock, which, off_s):
    """A tenth of a second is told by what other runs say, and an offset forth by a command that the wheels lead."""
    found = checked(moved(sound, "encoder", clock, which)).findings
    assert {(one.fault, one.channel) for one in found} == {("clock_offset", "encoder")}
    assert sorted(i for one in found for i in one.runs) == list(which)
    assert all(one.repairs[0].offset_s == pytest.approx(-off_s, abs=0.0201) for one in found)


@pytest.mark.parametrize("without", [(), pytest.param(("command",), marks=pytest.mark.slow)])
def test_a_clock_that_jumps_ahead_leaves_out_stamps_and_no_rows_are_missing(sound, without):
    (found,) = checked(moved(sound, "encoder", jump, [1], without)).findings
    assert (found.fault, found.channel, found.runs) == ("clock_jump", "encoder", (1,))
    assert found.repairs[0].offset_s == pytest.approx(-0.8, abs=0.01)
    assert found.repairs[0].since_s == pytest.approx(10.82, abs=0.03)


@pytest.mark.slow
def test_a_camera_that_jumps_ahead_leaves_out_stamps_of_its_own(sound):
    found = checked(moved(sound, "kinect", jump, [1])).findings
    assert {(one.fault, one.channel) for one in found} == {("clock_jump", "kinect")}


@pytest.mark.slow
def test_rows_that_are_missing_while_a_camera_jumps_back_elsewhere_are_no_jump(sound):
    runs = moved(sound, "kinect", lambda t: np.where(t > 5.0, t + 0.8, t), [1])
    encoder = runs[1].channels["encoder"]
    kept = (encoder.t < 12.0) | (encoder.t > 12.8)
    lost = replace(encoder, t=encoder.t[kept], values=encoder.values[kept])
    runs[1] = replace(runs[1], channels=runs[1].channels | {"encoder": lost})
    found = {(one.fault, one.channel) for one in checked(runs).findings}
    assert found == {("clock_jump", "kinect"), ("rows_missing", "encoder")}
