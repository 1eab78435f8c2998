"""Angles are brought into [-pi, pi), and vectors rotated by them."""

import numpy as np
import pytest

from drake_ispace.blocks.frames import rotated, wrap


@pytest.mark.parametrize("angle, wrapped", [
    (0.0, 0.0), (1.5, 1.5), (np.pi, -np.pi), (-np.pi, -np.pi), (1.5 * np.pi, -0.5 * np.pi), (-1.5 * np.pi, 0.5 * np.pi),
    (7.0, 7.0 - 2.0 * np.pi), (100.0, 100.0 - 32.0 * np.pi),
])
def test_known_angles(angle, wrapped):
    assert wrap(angle) == pytest.approx(wrapped, abs=1e-13)


def test_the_result_lies_in_the_half_open_turn():
    for angle in np.linspace(-50.0, 50.0, 4001):
        assert -np.pi <= wrap(angle) < np.pi


def test_the_direction_is_kept():
    for angle in np.linspace(-50.0, 50.0, 4001):
        assert abs(np.exp(1j * wrap(angle)) - np.exp(1j * angle)) < 1e-13


def test_an_angle_inside_the_turn_is_left_alone():
    for angle in np.linspace(-3.14, 3.14, 101):
        assert wrap(angle) == angle


def test_vectors_are_rotated_counterclockwise_and_back():
    vectors, angles = np.array([[1.0, 0.0], [0.0, 2.0], [0.3, -0.4]]), np.array([0.5 * np.pi, np.pi, 0.7])
    turned = rotated(vectors, angles)
    assert turned[:2] == pytest.approx(np.array([[0.0, 1.0], [0.0, -2.0]]), abs=1e-15)
    assert rotated(turned, -angles) == pytest.approx(vectors, abs=1e-15)
    assert rotated(vectors, 0.5 * np.pi)[:, 1] == pytest.approx(vectors[:, 0])
