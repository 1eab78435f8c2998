"""Is a command that is held told from a setpoint that moves on between its samples?"""

import numpy as np
import pytest

import drake_ispace as di
from drake_ispace.explain.check.check import check
from drake_ispace.faults.repair import Interpolated
from drake_ispace.files.recording import Channel, Recording
from hidden import two_wheels

RAMPS = {"ramp_s": 3.0, "encoder_hz": 20.0, "left_share": 0.0, "late_s": 0.0}


def runs_of(robot, seconds=30.0):
    return [two_wheels.drive(seed, seconds, **RAMPS | robot) for seed in range(2)]


def faults_of(robot):
    return [finding.fault for finding in check(two_wheels.model(), runs_of(robot)).findings]


@pytest.mark.first_case
@pytest.mark.parametrize("lag_s", [0.0, 0.01, 0.2])
def test_wheels_that_lead_their_command_follow_a_setpoint(lag_s):
    assert faults_of({"lag_s": lag_s}) == ["command_sampled"]


@pytest.mark.first_case
@pytest.mark.parametrize("robot", [
    {"lag_s": 0.0}, {"lag_s": 0.2}, {"lag_s": 0.03, "others": {"delay_s": 0.03}}, {"lag_s": 0.1, "encoder_hz": 100.0},
])
def test_a_command_that_changes_at_every_sample_and_is_held_is_sound(robot):
    assert faults_of(robot | {"in_step": True}) == []


def test_a_command_that_steps_now_and_then_is_no_curve():
    assert "command_sampled" not in faults_of({"lag_s": 0.0, "ramp_s": 0.0})


@pytest.mark.slow
def test_a_lag_of_half_a_sample_hides_that_a_setpoint_is_sampled():
    assert faults_of({"lag_s": 0.03}) == []


@pytest.mark.slow
def test_a_late_setpoint_is_not_told_from_a_late_command():
    assert faults_of({"lag_s": 0.0, "others": {"delay_s": 0.05}}) == []


@pytest.mark.slow
def test_the_lag_behind_a_setpoint_is_not_short_by_half_a_sample():
    few = [di.effects()[name] for name in ("velocity_lag", "velocity_delay", "velocity_gain")]
    answer = di.explain(two_wheels.model(), runs_of({"lag_s": 0.1}, 20.0), effects=few)
    assert answer.verdict in ("named", "set") and [effect.name for effect in answer.effects] == ["velocity_lag"]
    assert answer.effects[0].parameters["time_constant_s"].estimate == pytest.approx(0.1, rel=0.06)
    assert [finding.fault for finding in answer.data] == ["command_sampled"]


def test_a_curve_goes_through_ramps_and_holds_what_comes_before_a_gap():
    t = np.array([0.0, 0.1, 0.2, 0.3, 0.4, 1.4, 1.5, 1.6])
    command = Channel(t, ("vx",), np.array([[0.0], [0.1], [0.2], [0.3], [0.4], [0.9], [0.9], [0.9]]))
    smooth = Interpolated("command", 0.05).apply(Recording("mine", "velocity_base", {"command": command}, ""))
    values = dict(zip(smooth.channels["command"].t.round(3), smooth.channels["command"].values[:, 0], strict=True))
    assert values[0.1] == pytest.approx(0.125) and values[0.9] == pytest.approx(0.4, abs=0.02)
    assert values[1.5] == pytest.approx(0.9)
