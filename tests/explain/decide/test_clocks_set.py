"""Torques, commands and an IMU whose clock is off are told by the model's errors; what it lacks is no lateness."""

from dataclasses import replace

import numpy as np
import pytest

import drake_ispace as di
from drake_ispace.blocks.rates import TICK_S
from drake_ispace.explain.decide.clocks.clocks_set import with_clocks_set
from drake_ispace.explain.predict.case import prepare
from drake_ispace.faults.repair import Clock
from hidden import two_wheels
from hidden.generator import generate
from stand_ins.tried import FEW


def runs_of(robot, effects=None, late=0, channel="torque"):
    runs = [generate(robot, motion, effects or {}, 8.0, 80 + i) for i, motion in enumerate(("eight", "square"))]
    return [Clock(channel, 1.0, late * TICK_S).apply(run) for run in runs]


@pytest.mark.first_case
@pytest.mark.parametrize(("robot", "channel", "late"), [
    *[(robot, "torque", late) for robot in ("omni", "pendulum") for late in (1, 5)],
    *[("pendulum", "imu", late) for late in (-2, 1, 8)], *[("pendulum", "encoder", late) for late in (-4, 3)],
    *[pytest.param(robot, "torque", 2, marks=pytest.mark.slow) for robot in ("omni", "pendulum")],
    *[pytest.param("pendulum", "imu", late, marks=pytest.mark.slow) for late in (-1, 2, 3)],
])
def test_a_clock_that_is_off_is_told_to_the_tick_and_set(robot, channel, late):
    model, lacks = f"{robot}_multirate", {"viscous_friction": {"coefficient_n_m_s": 0.003}}
    case, (finding,) = with_clocks_set(prepare(model, runs_of(robot, lacks, late, channel), (), FEW), ["a", "b"])
    assert (finding.fault, finding.channel, finding.run) == ("clock_offset", channel, "all")
    assert finding.repairs[0].offset_s == pytest.approx(-late * TICK_S)
    sound = prepare(model, runs_of(robot, lacks), (), FEW)
    begun = max(-late, 0)  # a clock that begins before 0 s begins the run
    for found, expected in zip(case.prediction.tracks, sound.prediction.tracks, strict=True):
        own, other = (slice(200 + first, 1200 + first) for first in (begun, 0))
        assert np.array_equal(found.command[own], expected.command[other])
        assert np.array_equal(found.measured[own], expected.measured[other])
    assert case.runs[0].channels[channel].t[-1] == pytest.approx(sound.runs[0].channels[channel].t[-1])


@pytest.mark.first_case
@pytest.mark.parametrize("robot", [pytest.param("omni", marks=pytest.mark.slow), "pendulum"])
@pytest.mark.parametrize("effects", [
    {}, {"command_delay": {"delay_s": 0.008}}, {"motor_lag": {"time_constant_s": 0.02}},
    {"viscous_friction": {"coefficient_n_m_s": 0.008}}, {"mass_error": {"share": 0.3}},
    {"transmission_backlash": {"gap_rad": 0.1}}, {"torque_gain_error": {"share": -0.2}},
    {"wheel_radius_error": {"share": 0.05}}, {"encoder_eccentricity": {"wheel": 1, "sine_rad": 0.1, "cosine_rad": 0.1}},
], ids=lambda effects: next(iter(effects), "sound"))
def test_whatever_the_model_lacks_no_clock_is_off(robot, effects):
    case = prepare(f"{robot}_multirate", runs_of(robot, effects), (), FEW)
    assert with_clocks_set(case, ["a", "b"]) == (case, [])


@pytest.mark.slow
@pytest.mark.parametrize("channel", [pytest.param("torque", marks=pytest.mark.slow), "imu"])
def test_a_model_with_a_clock_that_is_off_lacks_nothing_and_its_controller_is_its_own(channel):
    found = di.explain("pendulum_multirate", runs_of("pendulum", late=2, channel=channel), effects=FEW)
    assert found.verdict == "none" and [f.fault for f in found.data] == ["clock_offset"]
    assert found.controller is not None and found.controller.unexplained < 0.12
    assert f"{channel} in all runs: a clock that is off" in str(found)


def rover(stamped_s=0.0, **robot):
    """Runs of a robot that takes a velocity, its commands stamped so late [s]; robot: what is hidden in it."""
    sound = {"left_share": 0.0, "late_s": 0.0, "lag_s": 0.0, "in_step": True}
    runs = [two_wheels.drive(seed, 12.0, **sound | robot) for seed in (1, 2)]
    return [Clock("command", 1.0, stamped_s).apply(run) for run in runs]


def cut(run, since_s):
    """The run from some time on."""
    channels = {name: replace(c, t=c.t[c.t >= since_s], values=c.values[c.t >= since_s])
                for name, c in run.channels.items()}
    return replace(run, channels=channels)


FOLLOWING = [di.effects()[name] for name in ("velocity_lag", "velocity_delay", "velocity_gain", "camera_latency")]


@pytest.mark.first_case
@pytest.mark.parametrize("late_s", [0.02, 0.05, 0.1])
def test_wheels_that_turn_before_their_command_tell_of_its_clock(late_s):
    _, (finding,) = with_clocks_set(prepare(two_wheels.model(), rover(late_s), (), FOLLOWING), ["a", "b"])
    assert (finding.fault, finding.channel) == ("clock_offset", "command")
    assert finding.repairs[0].offset_s == pytest.approx(-late_s, abs=TICK_S)


def test_a_late_command_is_told_of_encoders_that_are_read_rarely():
    runs = [
        Clock("command", 1.0, 0.19).apply(two_wheels.drive(
            seed, 20.0, left_share=0.0, late_s=0.0, lag_s=0.0, in_step=True, encoder_hz=4.0,
        )) for seed in (1, 2)
    ]
    _, (finding,) = with_clocks_set(prepare(two_wheels.model(), runs, (), FOLLOWING), ["a", "b"])
    assert (finding.fault, finding.channel) == ("clock_offset", "command")


@pytest.mark.first_case
@pytest.mark.parametrize("robot", [
    {}, {"lag_s": 0.1}, {"others": {"delay_s": 0.1}}, {"others": {"gain_share": 0.05}}, {"left_share": 0.04},
    {"late_s": 0.08}, {"in_step": False}, {"ramp_s": 3.0, "encoder_hz": 20.0, "lag_s": 0.1},
], ids=lambda robot: "-".join(robot) or "sound")
def test_wheels_that_follow_late_or_otherwise_than_told_do_not(robot):
    case = prepare(two_wheels.model(), rover(**robot), (), FOLLOWING)
    assert with_clocks_set(case, ["a", "b"]) == (case, [])


@pytest.mark.first_case
@pytest.mark.parametrize("lag_s", [0.1, 0.2, 0.3])
@pytest.mark.parametrize("seed", [1, 11])
def test_a_drive_that_lags_in_short_runs_does_not_either(seed, lag_s):
    """A change near the begin of a run would be left out with a command that is earlier."""
    lagging = {"left_share": 0.0, "late_s": 0.0, "lag_s": lag_s, "in_step": True}
    runs = [two_wheels.drive(seed + i, 5.0, **lagging) for i in range(3)]
    case = prepare(two_wheels.model(), [cut(run, 1.7) for run in runs], (), FOLLOWING)
    assert with_clocks_set(case, ["a", "b", "c"]) == (case, [])


@pytest.mark.slow
def test_a_late_command_is_told_beside_a_late_camera():
    runs = rover(0.04, late_s=0.08)
    found = di.explain(two_wheels.model(), runs, effects=FOLLOWING)
    assert [f.channel for f in found.data] == ["command"]
    assert [(e.name, round(e.parameters["latency_s"].estimate, 2)) for e in found.effects] == [("camera_latency", 0.08)]


def test_data_that_are_trusted_are_left_as_they_are():
    found = di.explain("omni_multirate", runs_of("omni", late=2), effects=FEW, trust_data=True)
    assert not found.data
