"""Effects that no library names: never called sound where they show, and said where they show."""

import numpy as np
import pytest

from drake_ispace.effects.library import library
from drake_ispace.explain.explain import explain
from hidden.outside import TYPICAL, cases, draw, recorded
from hidden.outside_campaign import outside

FEW = ["floor_tilt", "coulomb_friction", "viscous_friction", "mass_error", "wheel_radius_error"]


def told(robot, effect, size, names=FEW, seconds=12.0):
    motions = ("square", "eight", "circle")
    runs = [recorded(robot, motion, effect, size, 70 + i, seconds) for i, motion in enumerate(motions)]
    return explain(f"{robot}_multirate", runs[:2], runs[2:], names and [library()[name] for name in names])


def test_the_cases_are_those_that_were_drawn():
    assert cases() == draw()


def test_each_case_says_where_it_must_show():
    assert {(case["robot"], case["effect"]) for case in cases()} == set(TYPICAL)
    assert all(case["channel"] and case["driver"] for case in cases())


@pytest.mark.slow
def test_an_effect_outside_of_the_library_is_not_called_sound():
    answer = told("omni", "cable_pull", 1.2)
    assert answer.verdict in ("incomplete", "unknown"), answer


@pytest.mark.slow
def test_a_motor_that_warms_up_is_no_battery_that_charges():
    answer = told("omni", "motor_warm_up_gain", 0.5, names=None)
    assert answer.verdict == "unknown" and "time" in answer.unknown.driver, answer


@pytest.mark.slow
@pytest.mark.parametrize("robot", ["omni", "pendulum"])
def test_a_supply_that_drops_half_way_is_no_battery_that_sags(robot):
    names = [*FEW, "battery_sag_time", "torque_gain_error", "battery_sag_load"]
    answer = told(robot, "supply_drop", 0.25, names)
    assert answer.verdict == "unknown" and answer.unknown.driver == "time and command", answer
    before, after = ([share for t_s, share, _ in answer.unknown.course if abs(t_s - at) < 2.0] for at in (4.0, 10.0))
    assert np.mean(after) == pytest.approx(np.mean(before) - 0.25, abs=0.07)
    assert "more than in the model, as a smooth curve:" in str(answer)


@pytest.mark.slow
@pytest.mark.parametrize(("robot", "size"), [("omni", 0.01), ("pendulum", 0.015)])
def test_bearings_that_seize_half_way_show_in_the_second_half(robot, size):
    answer = told(robot, "seized_bearings", size, seconds=16.0)
    (said,) = answer.drifts
    assert answer.verdict == "unknown" and "other half contradicts it" in said, answer
    assert said.startswith("the second half of the runs by itself is explained best by coulomb_friction (torque_n_m")


@pytest.mark.slow
def test_a_mirrored_room_is_a_mistake_of_the_data():
    answer = told("omni", "mirrored_room", 1.0)
    assert answer.verdict == "data" and answer.data[0].fault == "camera_axis_mirrored"


@pytest.mark.slow
def test_a_sound_robot_is_called_sound():
    assert told("omni", None, 0.0).verdict == "none"


@pytest.mark.hidden
@pytest.mark.parametrize("k", range(60))
def test_an_effect_that_shows_is_never_called_sound(k):
    row = outside(k, cases()[k])
    assert row is None or row["ratio"] < 2.0 or row["verdict"] != "none"
