"""Torques that are stamped late are told by wheels that turn before; what the model lacks is no lateness."""

import numpy as np
import pytest
from tried import FEW

import drake_ispace as di
from drake_ispace.blocks.rates import TICK_S
from drake_ispace.explain.decide.lead import with_lead_undone
from drake_ispace.explain.predict.case import prepare
from drake_ispace.faults.repair import Clock
from hidden import two_wheels
from hidden.generator import generate


def runs_of(robot, effects=None, late=0):
    runs = [generate(robot, motion, effects or {}, 8.0, 80 + i) for i, motion in enumerate(("eight", "square"))]
    return [Clock("torque", 1.0, late * TICK_S).apply(run) for run in runs]


@pytest.mark.parametrize("robot", ["omni", "pendulum"])
@pytest.mark.parametrize("late", [1, 2, 5])
def test_a_late_torque_is_told_to_the_tick_and_undone(robot, late):
    model, runs = f"{robot}_multirate", runs_of(robot, {"viscous_friction": {"coefficient_n_m_s": 0.003}}, late)
    case, (finding,) = with_lead_undone(prepare(model, runs, (), FEW), ["a", "b"])
    assert (finding.fault, finding.channel, finding.run) == ("clock_offset", "torque", "all")
    assert finding.repairs[0].offset_s == pytest.approx(-late * TICK_S)
    sound = prepare(model, runs_of(robot, {"viscous_friction": {"coefficient_n_m_s": 0.003}}), (), FEW)
    for found, expected in zip(case.prediction.tracks, sound.prediction.tracks, strict=True):
        middle = slice(200, found.ticks - 200)
        assert np.array_equal(found.command[middle], expected.command[middle])
    assert case.runs[0].channels["torque"].t[-1] == pytest.approx(sound.runs[0].channels["torque"].t[-1])


@pytest.mark.parametrize("robot", ["omni", "pendulum"])
@pytest.mark.parametrize("effects", [
    {}, {"command_delay": {"delay_s": 0.008}}, {"motor_lag": {"time_constant_s": 0.02}},
    {"viscous_friction": {"coefficient_n_m_s": 0.008}}, {"mass_error": {"share": 0.3}},
    {"transmission_backlash": {"gap_rad": 0.1}}, {"torque_gain_error": {"share": -0.2}},
], ids=lambda effects: next(iter(effects), "sound"))
def test_whatever_the_model_lacks_no_torque_is_late(robot, effects):
    case = prepare(f"{robot}_multirate", runs_of(robot, effects), (), FEW)
    assert with_lead_undone(case, ["a", "b"]) == (case, [])


def test_a_model_with_a_late_torque_lacks_nothing_and_its_controller_is_its_own():
    found = di.explain("pendulum_multirate", runs_of("pendulum", late=2), effects=FEW)
    assert found.verdict == "none" and [f.fault for f in found.data] == ["clock_offset"]
    assert found.controller is not None and found.controller.unexplained < 0.12
    assert "torque in all runs: a clock that is off" in str(found)


def test_robots_that_take_a_velocity_are_not_asked():
    case = prepare(two_wheels.model(), [two_wheels.drive(1, 8.0)], (), [di.effects()["velocity_lag"]])
    assert with_lead_undone(case, ["a"]) == (case, [])


def test_data_that_are_trusted_are_left_as_they_are():
    found = di.explain("omni_multirate", runs_of("omni", late=2), effects=FEW, trust_data=True)
    assert not found.data
