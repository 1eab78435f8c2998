"""Effects between motor and wheel: numbers by hand."""

import math

import numpy as np
import pytest
from passing import passed
from rail import rail

from drake_ispace.blocks.rates import TICK_S
from drake_ispace.effects.effect import body_of
from drake_ispace.effects.places.transmission import EFFECTS, lead, motor_angle, remember_bent, rubbed
from drake_ispace.plants.friction import friction_parameters, friction_torque
from drake_ispace.robots.library import robots
from drake_ispace.scenario import load_scenario

BY_NAME = {effect.card.name: effect for effect in EFFECTS}
RAIL = rail(3)


def given(name, torque, wheel_rate, **values):
    """The torque that a block on a bare Context lets through."""
    return passed(name, RAIL, torque, {"wheel_rate": wheel_rate}, **values)


def test_viscous_friction_grows_with_speed():
    assert given("viscous_friction", [1, 1, 1], [0, 2, -4], coefficient_n_m_s=0.1) == pytest.approx([1.0, 0.8, 1.4])


def test_coulomb_friction_is_of_one_size_and_smooth_at_standstill():
    assert given("coulomb_friction", [1, 1, 1], [0, 9, -9], torque_n_m=0.2) == pytest.approx([1.0, 0.8, 1.2])
    (slow, *_) = given("coulomb_friction", [0, 0, 0], [0.05, 0, 0], torque_n_m=0.2)
    assert slow == pytest.approx(-0.2 * math.tanh(1.0))


@pytest.mark.parametrize("torque_n_m, rubbing", [(-0.0061, 0.0), (-0.004, 0.0021)])
def test_coulomb_friction_takes_the_plants_own_away_at_every_speed(torque_n_m, rubbing):
    """Both together are the friction of a plant that has less, of the same width."""
    robot = body_of(load_scenario("pendulum_multirate"), robots()["pendulum"])
    own = friction_parameters(robot.plant.friction, robot.robot.mobility(robot.plant), "plant.friction")
    numbers = np.array([*(own | {"viscous": 0.0}).values()])
    for rate in (-3.0, -0.2, -0.02, 0.0, 0.05, 0.5):
        (left, _) = passed("coulomb_friction", robot, [0, 0], {"wheel_rate": [rate, rate]}, torque_n_m=torque_n_m)
        whole = friction_torque(rate, 0.0, numbers) - left
        assert whole == pytest.approx(rubbing * math.tanh(rate / own["speed_scale"]), abs=1e-12)


def test_one_wheel_alone_has_friction_of_its_own():
    left = given("single_wheel_friction", [1, 1, 1], [9, -9, 9], wheel=2, torque_n_m=0.2)
    assert left == pytest.approx([1.0, 1.2, 1.0])


def test_one_wheel_alone_has_viscous_friction_of_its_own():
    left = given("single_wheel_viscous_friction", [1, 1, 1], [9, -9, 9], wheel=2, coefficient_n_m_s=0.02)
    assert left == pytest.approx([1.0, 1.18, 1.0])


def test_friction_in_one_direction_leaves_the_other_alone():
    assert given("directional_friction", [1, 1, 1], [9, -9, 0], torque_n_m=0.2) == pytest.approx([0.8, 1.0, 0.9])
    assert given("directional_friction", [1, 1, 1], [9, -9, 0], torque_n_m=-0.2) == pytest.approx([1.0, 1.2, 1.1])


def test_drag_of_a_wheel_grows_with_the_square_of_its_speed():
    assert given("wheel_drag", [1, 1, 1], [1, 2, -3], coefficient_n_m_s2=0.1) == pytest.approx([0.9, 0.6, 1.9])


def test_the_stribeck_bump_fades_with_speed():
    left = given("stribeck_friction", [0, 0, 0], [1, 2, -2], bump_n_m=0.2, speed_rad_s=2.0)
    assert left == pytest.approx([-0.2 * math.exp(-0.25), -0.2 * math.exp(-1), 0.2 * math.exp(-1)])


def test_load_dependent_friction_weakens_the_drive_and_helps_the_brake():
    assert given("load_dependent_friction", [1, -1, 0], [9, 9, 9], share=0.2) == pytest.approx([0.8, -1.2, 0.0])


def test_backlash_leads_by_half_a_gap_and_crosses_it_as_the_torque_drives():
    half, rate, wheel, xd, leads = 0.05, 4.0 / TICK_S, np.array([1.0]), np.zeros(1), []
    for torque in (0.0, 0.01, 0.01, 0.0, -0.01, -0.01, -0.01):
        out, after = np.empty(1), np.empty(1)
        motor_angle(xd, wheel, np.array([torque]), half, rate, out)
        lead(xd, np.array([torque]), half, rate, after)
        assert out == wheel + after  # what the encoder reads is what is remembered
        leads.append(after[0])
        xd = after
    assert leads == pytest.approx([0.0, 0.04, 0.05, 0.05, 0.01, -0.03, -0.05])


def bristles(rates, size=0.2, reach=0.5):
    """The torques that presliding friction leaves of none, tick by tick, of a wheel that turns at `rates`."""
    xd, left = np.zeros(1), []
    for rate in rates:
        out, after = np.empty(1), np.empty(1)
        rubbed(xd, np.zeros(1), np.array([rate]), size, reach, out)
        remember_bent(xd, np.array([rate]), size, reach, after)
        left.append(out[0])
        xd = after
    return np.array(left)


def test_presliding_friction_comes_on_over_an_angle_after_a_reversal():
    rate = 0.05 / TICK_S
    there, back = np.split(bristles([rate] * 100 + [-rate] * 100), 2)
    turned = 0.05 * (np.arange(100) + 0.5)  # the middle of each tick
    assert there == pytest.approx(-0.2 * (1.0 - np.exp(-turned / 0.5)))
    assert back == pytest.approx(0.2 * (1.0 - 2.0 * np.exp(-turned / 0.5)), abs=1e-4)


def test_presliding_friction_holds_a_wheel_at_rest():
    assert bristles([0.5 / TICK_S, 0.0, 0.0])[1:] == pytest.approx([-0.2 * (1.0 - math.exp(-1.0))] * 2)


def test_presliding_friction_of_a_fast_wheel_is_coulomb_friction():
    assert bristles([500.0, 500.0, -500.0], reach=0.02) == pytest.approx([-0.2, -0.2, 0.2])
