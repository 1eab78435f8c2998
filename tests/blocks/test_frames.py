"""Angles are brought into [-pi, pi)."""

import numpy as np
import pytest

from drake_ispace.blocks.frames import wrap


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
