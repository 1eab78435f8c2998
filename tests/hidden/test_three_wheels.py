"""A robot on three omni wheels under commanded velocity, whose truth is plain numpy."""

import pytest

import drake_ispace as di
from hidden import three_wheels

ALIKE = ("constant_slip", "camera_scale", "camera_distortion", "wheel_radius_errors", "encoder_eccentricity")


def told(effects=None, **hidden):
    runs = [three_wheels.drive(20 + i, 10.0, **hidden) for i in range(4)]
    return di.explain(three_wheels.model(), runs[:3], runs[3:], effects and [di.effects()[name] for name in effects])


@pytest.mark.slow
def test_a_sound_robot_lacks_nothing():
    assert told().verdict == "none"


def test_a_wheel_that_is_turned_is_no_slip():
    found = told(("wheel_toe", "constant_slip", "camera_scale"), toe_rad=(0.0, 0.04, 0.0))
    (effect,) = found.effects
    assert found.verdict == "named" and effect.name == "wheel_toe" and effect.parameters["wheel"].estimate == 2
    assert effect.parameters["angle_rad"].estimate == pytest.approx(0.04, abs=2e-3)


@pytest.mark.slow
def test_a_turn_that_is_lost_at_speed_is_no_wrong_track():
    found = told(understeer_s2_m2=-0.2)
    assert found.verdict == "unknown" and found.unknown.driver == "speed and turning"


@pytest.mark.slow
@pytest.mark.parametrize(("hidden", "driver"), [
    ({"roller_slip": 0.05}, "direction of motion"), ({"slip_s": 0.05}, "yaw rate"),
])
def test_slip_that_comes_and_goes_is_no_constant_slip(hidden, driver):
    found = told(ALIKE, **hidden)
    assert found.verdict == "unknown" and found.unknown.driver == driver


@pytest.mark.slow
def test_encoders_that_ripple_twice_a_turn_are_not_eccentric():
    found = told(ALIKE, ripple_rad=0.015)
    assert not found.effects and found.detection.p_value < 1e-10
