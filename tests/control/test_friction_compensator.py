"""Friction compensation: a dead band, the sign of motion, and nothing at all where it is not wanted."""

import numpy as np
import pytest

from drake_ispace.control.feedback.friction_compensator import FrictionCompensation, FrictionCompensator


@pytest.fixture
def compensated(drive):
    def of(torque, rates, **keywords):
        wide = {"dead_band_rad_s": 0.1, "speed_scale_rad_s": 0.2}
        block = FrictionCompensator(FrictionCompensation(**wide | keywords), len(torque))
        encoder = [0.0, *np.zeros(len(torque)), *rates]
        return drive(block, "torque", [{"torque": torque, "encoder": encoder}])[0]

    return of


def test_well_beyond_the_dead_band_it_is_coulomb_and_viscous_friction(compensated):
    # Table 4.2: 0.0061 + 0.0106 * 5 = 0.0591
    assert compensated([0.1, -0.1], [5.0, 5.0]) == pytest.approx([0.1591, -0.0409], abs=1e-12)


def test_within_the_dead_band_nothing_is_added(compensated):
    assert list(compensated([0.1, 0.2, 0.3], [0.1, -0.1, 0.0])) == [0.1, 0.2, 0.3]


def test_beyond_the_dead_band_the_sign_fades_in(compensated):
    # 0.2 rad/s beyond it: tanh(1) of the Coulomb part
    (added,) = compensated([0.0], [0.3])
    assert added == pytest.approx(0.0061 * np.tanh(1.0) + 0.0106 * 0.3)


def test_it_is_odd(compensated):
    rates = np.array([0.05, 0.15, 0.3, 2.0, 20.0])
    assert np.array_equal(compensated(np.zeros(5), -rates), -compensated(np.zeros(5), rates))


def test_where_it_is_not_enabled_torque_passes_bit_for_bit(compensated):
    torque = [0.123456789, -1e-300, 3.0]
    assert list(compensated(torque, [9.0, -9.0, 0.05], enabled=False)) == torque
