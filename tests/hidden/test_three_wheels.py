"""A robot on three omni wheels under commanded velocity, whose truth is plain numpy."""

import pytest

import drake_ispace as di
from hidden import three_wheels


def told(**hidden):
    runs = [three_wheels.drive(20 + i, 10.0, **hidden) for i in range(4)]
    return di.explain(three_wheels.model(), runs[:3], runs[3:])


def test_a_sound_robot_lacks_nothing():
    assert told().verdict == "none"


def test_a_wheel_that_is_turned_is_no_slip():
    found = told(toe_rad=(0.0, 0.04, 0.0))
    (effect,) = found.effects
    assert found.verdict == "named" and effect.name == "wheel_toe" and effect.parameters["wheel"].estimate == 2
    assert effect.parameters["angle_rad"].estimate == pytest.approx(0.04, abs=2e-3)


def test_a_turn_that_is_lost_at_speed_is_no_wrong_track():
    found = told(understeer_s2_m2=-0.2)
    assert found.verdict == "unknown" and found.unknown.driver == "speed and turning"
