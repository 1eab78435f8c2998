"""tau = J' F, (2.65)."""

import numpy as np
import pytest

from drake_ispace.control.feedback.jacobian_transpose import JacobianTranspose
from drake_ispace.plants.wheels import mecanum, omni3, omni4

THESIS = omni4(0.024, 0.36)
GEOMETRIES = pytest.mark.parametrize("geometry", [THESIS, omni3(0.024, 0.18), mecanum(0.05, 0.2, 0.15)])


@pytest.fixture
def torques(drive):
    def of(geometry, force, phi):
        return drive(JacobianTranspose(geometry), "torque", [{"force": force, "estimate": [0.0, 0.0, 0.0, phi]}])[0]

    return of


def test_by_hand(torques):
    # wheels at 0, 90, 180, 270 degrees: a push of 1 N along x is shared by the second and fourth, r / 2 each
    assert torques(THESIS, [1.0, 0.0, 0.0], 0.0) == pytest.approx([0.0, -0.012, 0.0, 0.012], abs=1e-15)
    assert torques(THESIS, [0.0, 1.0, 0.0], 0.0) == pytest.approx([0.012, 0.0, -0.012, 0.0], abs=1e-15)
    # a moment of 0.36 N m: 0.5 N at each of four wheels 0.18 m from the middle
    assert torques(THESIS, [0.0, 0.0, 0.36], 0.0) == pytest.approx([0.012] * 4)


def test_at_another_heading(torques):
    # facing y, a push along the world's y is one forward
    assert torques(THESIS, [0.0, 1.0, 0.0], np.pi / 2.0) == pytest.approx([0.0, -0.012, 0.0, 0.012], abs=1e-15)


@GEOMETRIES
@pytest.mark.parametrize("phi", [0.0, 0.7, -2.5])
def test_the_wheels_give_back_the_force(torques, geometry, phi):
    # E J' = I: force in W of the torques, E = R G'
    c, s = np.cos(phi), np.sin(phi)
    effort = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) @ geometry.inverse.T
    columns = np.column_stack([torques(geometry, axis, phi) for axis in np.eye(3)])
    assert effort @ columns == pytest.approx(np.eye(3), abs=1e-12)


@GEOMETRIES
def test_power_at_the_wheels_is_power_of_the_force(torques, geometry):
    force, velocity, phi = np.array([1.0, -2.0, 0.3]), np.array([0.2, 0.5, -1.0]), 0.9
    c, s = np.cos(phi), np.sin(phi)
    omega = geometry.inverse @ (np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]) @ velocity)
    assert torques(geometry, force, phi) @ omega == pytest.approx(force @ velocity)
