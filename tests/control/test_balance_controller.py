"""Feedback of the pendulum, (6.39): every sign by hand."""

import numpy as np
import pytest

from drake_ispace.control.feedback.balance_controller import BalanceController, from_printed

# s, phi, theta, s', phi', theta' for the right and the left wheel
GAIN = np.array([[-1.0, 2.0, -3.0, -4.0, 5.0, -6.0], [-1.0, -2.0, -3.0, -4.0, -5.0, -6.0]])


@pytest.fixture
def torque(drive):
    def of(error=(0.0, 0.0, 0.0), tilt=(0.0, 0.0), velocity=(0.0, 0.0), gain=GAIN):
        inputs = {"error": error, "tilt": [0.0, *tilt, 0.0], "velocity": velocity}
        return list(drive(BalanceController(gain), "torque", [inputs])[0])

    return of


def test_each_state_meets_its_gain(torque):
    # the state is minus the error, and u = -K x
    assert torque(error=(0.1, 0.0, 0.0)) == pytest.approx([-0.1, -0.1])
    assert torque(error=(0.0, 0.1, 0.0)) == pytest.approx([0.2, -0.2])
    assert torque(tilt=(0.1, 0.0)) == pytest.approx([0.3, 0.3])
    assert torque(tilt=(0.0, 0.1)) == pytest.approx([0.6, 0.6])
    assert torque(velocity=(0.1, 0.0)) == pytest.approx([0.4, 0.4])
    assert torque(velocity=(0.0, 0.1)) == pytest.approx([-0.5, 0.5])


def test_each_wheel_has_a_row_of_its_own(torque):
    gain = np.arange(1.0, 13.0).reshape(2, 6)
    assert torque(error=(0.1, 0.0, 0.0), gain=gain) == pytest.approx([0.1, 0.7])
    assert torque(error=(0.0, 0.1, 0.0), gain=gain) == pytest.approx([0.2, 0.8])
    assert torque(tilt=(0.1, 0.0), gain=gain) == pytest.approx([-0.3, -0.9])
    assert torque(velocity=(0.1, 0.0), gain=gain) == pytest.approx([-0.4, -1.0])
    assert torque(velocity=(0.0, 0.1), gain=gain) == pytest.approx([-0.5, -1.1])
    assert torque(tilt=(0.0, 0.1), gain=gain) == pytest.approx([-0.6, -1.2])


def test_the_speed_fed_forward_is_not_braked(torque):
    assert torque(error=(0.0, 0.0, 0.25), velocity=(0.25, 0.0)) == [0.0, 0.0]


def test_the_bias_of_the_gyro_is_not_fed_back(drive):
    inputs = {"error": [0.0] * 3, "tilt": [5.0, 0.0, 0.0, 9.0], "velocity": [0.0, 0.0]}
    assert not drive(BalanceController(GAIN), "torque", [inputs]).any()


def test_printed_gains_drive_forward_when_the_robot_leans_forward(torque):
    # (6.42)-(6.43)
    k = [[0.4351, -0.2217], [0.4351, 0.2217]]
    f1 = [[1.3328, 0.5548, -0.0843, 0.2023], [1.3328, 0.5548, 0.0843, 0.2023]]
    gain = from_printed(k, f1)
    assert torque(tilt=(0.1, 0.0), gain=gain) == pytest.approx([0.13328, 0.13328])
    assert torque(tilt=(0.0, 0.1), gain=gain) == pytest.approx([0.02023, 0.02023])
    # tau = -K (P_d - P): a point ahead first makes it roll back and so lean forward
    assert torque(error=(0.1, 0.0, 0.0), gain=gain) == pytest.approx([-0.04351, -0.04351])
    # a point to the left: the right wheel forward, the left one back
    assert torque(error=(0.0, 0.1, 0.0), gain=gain) == pytest.approx([0.02217, -0.02217])
    # + F1 x2: turning left is braked by the right wheel
    assert torque(velocity=(0.1, 0.1), gain=gain) == pytest.approx([0.05548 - 0.00843, 0.05548 + 0.00843])
