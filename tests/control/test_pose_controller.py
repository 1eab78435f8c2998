"""Feedback of the omni robot, (6.23), with the thesis's gains and numbers by hand."""

import numpy as np
import pytest
from messages import way_point

from drake_ispace.control.feedback.pose_controller import PoseController

K_P, K_D, MASS = np.diag([2.45, 2.45, 1.23]), np.diag([10.0, 10.0, 4.0]), [7.31, 7.31, 0.0729]


@pytest.fixture
def force(drive):
    def of(pose=(0.0, 0.0, 0.0), velocity=(0.0, 0.0, 0.0), target=None, k_p=K_P, k_d=K_D, **feed_forward):
        inputs = {"estimate": [0.0, *pose], "body_velocity": velocity, "way_point": target or way_point()}
        return drive(PoseController(k_p, k_d, MASS, **feed_forward), "force", [inputs])[0]

    return of


def test_force_points_to_the_way_point(force):
    assert force((0.1, 0.2, 0.0), target=way_point(1.1, -0.3)) == pytest.approx([2.45, -1.225, 0.0])


def test_velocity_brakes(force):
    assert force(velocity=(0.2, -0.1, 0.5)) == pytest.approx([-2.0, 1.0, -2.0])


def test_velocity_is_turned_to_the_world(force):
    # facing y, moving forward: braking along -y
    braking = force((0.0, 0.0, np.pi / 2.0), (0.2, 0.0, 0.0), way_point(phi=np.pi / 2.0))
    assert braking == pytest.approx([0.0, -2.0, 0.0], abs=1e-15)


def test_heading_error_is_wrapped(force):
    assert force((0.0, 0.0, 3.0), target=way_point(phi=-3.0))[2] == pytest.approx(1.23 * (2.0 * np.pi - 6.0))


def test_without_feed_forward_the_way_points_speed_does_not_count(force):
    target = way_point(rates=(0.25, 0.0, 0.1), accelerations=(0.1, 0.0, 0.2))
    assert list(force(target=target)) == [0.0, 0.0, 0.0]


def test_velocity_feed_forward(force):
    target = way_point(rates=(0.25, 0.0, 0.1))
    assert force(velocity=(0.25, 0.0, 0.0), target=target, velocity_feed_forward=True) == pytest.approx([0.0, 0.0, 0.4])


def test_acceleration_feed_forward(force):
    target = way_point(accelerations=(0.1, -0.2, 1.0))
    assert force(target=target, acceleration_feed_forward=True) == pytest.approx([0.731, -1.462, 0.0729])


def test_gains_are_read_row_by_row(force):
    k_p = np.arange(9.0).reshape(3, 3)
    assert force(target=way_point(1.0, 0.0, 0.0), k_p=k_p) == pytest.approx([0.0, 3.0, 6.0])
    assert force(velocity=(0.0, 1.0, 0.0), k_d=k_p) == pytest.approx([-1.0, -4.0, -7.0])


def test_before_the_first_way_point_there_is_no_force(force):
    assert list(force((1.0, 1.0, 1.0), (1.0, 1.0, 1.0), way_point(tick=-1))) == [0.0, 0.0, 0.0]
