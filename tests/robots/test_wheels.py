"""Wheel geometries: forward and inverse kinematics, (2.63)-(2.66)."""

import numpy as np
import pytest

from drake_ispace.plants.wheels import Wheel, WheelGeometry, differential, mecanum, omni3, omni4, rescaled

HOLONOMIC = {"omni4": omni4(0.024, 0.36), "omni3": omni3(0.05, 0.2), "mecanum": mecanum(0.05, 0.2, 0.15)}
RNG = np.random.default_rng(1)


@pytest.mark.parametrize("name", HOLONOMIC)
def test_forward_undoes_inverse(name):
    geometry = HOLONOMIC[name]
    np.testing.assert_allclose(geometry.forward @ geometry.inverse, np.eye(3), atol=1e-13)


@pytest.mark.parametrize("name", HOLONOMIC)
def test_a_holonomic_robot_holds_nothing_sideways(name):
    assert HOLONOMIC[name].sideways.shape == (0, 3)


@pytest.mark.parametrize("phi", [0.0, 0.5, np.pi / 2, 2.0, -2.8])
def test_omni4_is_the_jacobian_2_66(phi):
    r, b, s, c = 0.024, 0.36, np.sin(phi), np.cos(phi)
    printed = r / 2 * np.array([[-s, -c, s, c], [c, -s, -c, s], [1 / b, 1 / b, 1 / b, 1 / b]])
    turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    np.testing.assert_allclose(turn @ omni4(r, b).forward, printed, atol=1e-16)


def test_omni4_first_wheel_points_along_x_and_drives_along_y():
    np.testing.assert_allclose(omni4(0.024, 0.36).inverse[0], [0.0, 1 / 0.024, 0.18 / 0.024], atol=1e-13)


def test_omni3_by_hand():
    # wheel 2 of three lies at 180 degrees, drives along -y: r theta_dot = -vy + L wz
    np.testing.assert_allclose(omni3(0.05, 0.2).inverse[1], [0.0, -20.0, 4.0], atol=1e-13)
    # all three turning alike is pure yaw
    np.testing.assert_allclose(omni3(0.05, 0.2).forward @ [4.0, 4.0, 4.0], [0.0, 0.0, 1.0], atol=1e-14)


def test_mecanum_by_hand():
    # r = 0.1, a + b = 0.5: r theta_dot = vx -+ vy -+ (a + b) wz
    np.testing.assert_allclose(
        mecanum(0.1, 0.3, 0.2).inverse, [[10, -10, -5], [10, 10, 5], [10, 10, -5], [10, -10, 5]], atol=1e-13
    )


def test_mecanum_slides_to_the_left_when_diagonals_oppose():
    np.testing.assert_allclose(mecanum(0.1, 0.3, 0.2).forward @ [-1.0, 1.0, 1.0, -1.0], [0.0, 0.1, 0.0], atol=1e-15)


def test_differential_by_hand():
    geometry = differential(0.08, 0.2)
    # (2.35), (2.36): v = r/2 (right + left), yaw rate = r/(2 b) (right - left)
    np.testing.assert_allclose(geometry.forward, [[0.04, 0.04], [0.0, 0.0], [0.2, -0.2]], atol=1e-16)


def test_differential_never_moves_sideways():
    geometry = differential(0.08, 0.2)
    for _ in range(20):
        velocity = geometry.forward @ RNG.normal(size=2)
        assert np.abs(geometry.sideways @ velocity).max() < 1e-16


def test_differential_inverse_is_exact_for_motions_it_can_do():
    geometry = differential(0.08, 0.2)
    velocity = np.array([0.3, 0.0, -1.2])
    np.testing.assert_allclose(geometry.forward @ geometry.inverse @ velocity, velocity, atol=1e-15)


def test_a_plain_wheel_off_the_axis_is_held_across_its_drive():
    caster = Wheel(0.3, 0.1, 0.0, 0.05, holds_sideways=True)
    geometry = WheelGeometry((caster, Wheel(0.3, -0.1, 0.0, 0.05, holds_sideways=True)))
    # turning about the origin would drag the contact at x = 0.3 sideways at 0.3 m/s per rad/s
    np.testing.assert_allclose(geometry.sideways @ [0.0, 0.0, 1.0], [0.3, 0.3])
    assert np.abs(geometry.sideways @ geometry.forward).max() < 1e-15


def test_a_larger_wheel_turns_less_and_stays_where_it_is():
    grown = rescaled(differential(0.08, 0.2), [0.25, 0.0])
    # 1/0.1 and 1/0.08 per metre; 0.2 m from the middle
    np.testing.assert_allclose(grown.inverse, [[10.0, 0.0, 2.0], [12.5, 0.0, -2.5]], atol=1e-14)
    np.testing.assert_array_equal(grown.sideways, differential(0.08, 0.2).sideways)


def test_no_shares_change_no_bit():
    geometry = omni4(0.024, 0.36)
    assert rescaled(geometry, [0.0] * 4) == geometry


def test_shares_of_other_wheels_are_refused():
    with pytest.raises(ValueError, match="shorter"):
        rescaled(omni3(0.05, 0.2), [0.0, 0.1])


@pytest.mark.parametrize("wheels, message", [
    ((), "at least one wheel"),
    ((Wheel(0.1, 0.0, 0.0, 0.0),), "wheel 1: radius_m is 0.0"),
    ((Wheel(0.1, 0.0, 0.0, 0.05), Wheel(0.1, 0.0, 0.0, -0.05)), "wheel 2: radius_m is -0.05"),
    ((Wheel(0.1, 0.0, 0.0, float("nan")),), "wheel 1: radius_m is nan"),
    ((Wheel(0.1, 0.0, 0.0, 0.05, np.pi / 2),), "roller lies along the axle"),
    ((Wheel(0.1, 0.0, 0.0, 0.05),), "direction of motion unseen"),
    (tuple(Wheel(0.0, y, 0.0, 0.05) for y in (0.1, 0.1, -0.1)), "direction of motion unseen"),
])
def test_a_geometry_that_cannot_work_is_refused(wheels, message):
    with pytest.raises(ValueError, match=message):
        WheelGeometry(wheels)


def test_radial_wheels_do_not_feel_yaw_and_are_refused():
    radial = tuple(Wheel(0.2 * np.cos(a), 0.2 * np.sin(a), a, 0.05) for a in (0.0, 2.0, 4.0))
    with pytest.raises(ValueError, match="direction of motion unseen"):
        WheelGeometry(radial)
