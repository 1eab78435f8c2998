"""Tilt filter: converges, finds the gyro's bias, ignores repeated samples, and is good enough to drive on."""

import numpy as np
import pytest

from drake_ispace.robots.slip import GRAVITY
from drake_ispace.scenario import load_scenario
from drake_ispace.sensing.tilt_filter import TiltFilter, TiltKalmanFilter
from drake_ispace.simulation import simulate


def message(tick, tilt=0.0, rate=0.0):
    """A noise-free IMU on a body that does not accelerate."""
    return np.array([tick, -GRAVITY * np.sin(tilt), 0.0, GRAVITY * np.cos(tilt), 0.0, rate, 0.0])


def filtered(block, samples):
    """Rows tick, tilt, rate, bias after each sample; a second look at a sample must change nothing."""
    context = block.CreateDefaultContext()
    rows = []
    for sample in samples:
        block.get_input_port().FixValue(context, sample)
        rows.append(block.get_output_port().Eval(context).copy())
        context.SetDiscreteState(block.EvalUniquePeriodicDiscreteUpdate(context))
        assert np.array_equal(block.get_output_port().Eval(context), rows[-1])
        again = block.EvalUniquePeriodicDiscreteUpdate(context).get_vector().CopyToVector()
        assert np.array_equal(again, context.get_discrete_state_vector().CopyToVector())
    return np.array(rows)


def test_the_first_sample_acts_in_its_tick_and_passes_its_stamp_on():
    row = filtered(TiltKalmanFilter(TiltFilter()), [message(0, rate=1.0)])[0]
    assert row[0] == 0.0
    assert 0.5 < row[2] + row[3] < 1.0


def test_a_tilt_held_before_the_start_is_known():
    row = filtered(TiltKalmanFilter(TiltFilter(), 0.1), [message(0, 0.1)])[0]
    assert row[1] == pytest.approx(0.1, abs=1e-12)


def test_tilt_follows_a_turning_body():
    # 0.2 s at rest, then 0.5 rad/s for 1 s
    rest, turn = [message(k) for k in range(40)], [message(40 + k, 0.0025 * k, 0.5) for k in range(201)]
    rows = filtered(TiltKalmanFilter(TiltFilter()), rest + turn)
    assert rows[-1, 1] == pytest.approx(0.5, abs=0.01)
    assert rows[-1, 2] == pytest.approx(0.5, abs=0.01)


def test_a_wrong_start_is_forgotten():
    believed = TiltFilter(accelerometer_std_rad=0.1)
    rows = filtered(TiltKalmanFilter(believed), [message(k, 0.05) for k in range(6000)])
    assert abs(rows[0, 1] - 0.05) > 0.045
    assert rows[-1, 1] == pytest.approx(0.05, abs=1e-3)


def test_a_constant_gyro_bias_is_found():
    rows = filtered(TiltKalmanFilter(TiltFilter()), [message(k, 0.0, 0.02) for k in range(6000)])
    assert rows[-1, 3] == pytest.approx(0.02, abs=1e-3)
    assert rows[-1, 2] == pytest.approx(0.0, abs=1e-3)
    assert np.degrees(abs(rows[-1, 1])) < 0.5


def test_tilt_stays_within_half_a_degree_on_a_square():
    run = simulate(load_scenario("pendulum_multirate", ["seconds=22"]))
    truth, estimate = run.signals["pendulum_balance"][:-1, 0], run.signals["pendulum_tilt"][1:, 1]
    assert np.degrees(np.abs(truth).max()) > 2.0
    assert np.degrees(np.abs(estimate - truth).max()) < 0.5
