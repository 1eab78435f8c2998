"""From commanded to real wheel torque."""

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator

from drake_ispace.blocks.rates import TICK_S
from drake_ispace.plants.actuator import Actuator, TorqueActuator

COMMAND = [0.123456789, -3.0e-5]


def run(actuator, command=COMMAND, ticks=1, seed=0, where="actuator", port="torque"):
    """The torque (ticks, n) in the middle of each of the first `ticks` ticks."""
    block = TorqueActuator(actuator, len(command), seed, where)
    simulator = Simulator(block)
    block.get_input_port().FixValue(simulator.get_mutable_context(), command)
    rows = []
    for tick in range(ticks):
        simulator.AdvanceTo((tick + 0.5) * TICK_S)
        rows.append(block.GetOutputPort(port).Eval(simulator.get_context()).copy())
    return np.array(rows)


def test_a_neutral_actuator_passes_torque_bit_for_bit():
    assert list(run(Actuator())[0]) == COMMAND


def test_torque_is_held_until_the_next_tick():
    block = TorqueActuator(Actuator(), 1)
    simulator = Simulator(block)
    context, port = simulator.get_mutable_context(), block.GetOutputPort("torque")
    block.get_input_port().FixValue(context, [1.0])
    assert port.Eval(context)[0] == 0.0  # nothing commanded yet
    simulator.AdvanceTo(0.5 * TICK_S)
    block.get_input_port().FixValue(context, [2.0])
    simulator.AdvanceTo(0.9 * TICK_S)
    assert port.Eval(context)[0] == 1.0
    simulator.AdvanceTo(1.1 * TICK_S)
    assert port.Eval(context)[0] == 2.0


def test_the_actuator_is_no_feed_through():
    block = TorqueActuator(Actuator(), 2)
    assert not any(block.HasDirectFeedthrough(0, port) for port in range(2))


def test_torque_is_limited_both_ways():
    assert list(run(Actuator(limit_n_m=0.5), [2.0, -2.0, 0.4])[0]) == [0.5, -0.5, 0.4]


def test_the_converter_rounds_to_its_steps():
    torque = run(Actuator(resolution_n_m=0.01), [0.0149, 0.0151, -0.0149, 0.004])[0]
    assert torque == pytest.approx([0.01, 0.02, -0.01, 0.0])


def test_rounding_never_passes_the_limit():
    assert list(run(Actuator(limit_n_m=0.25, resolution_n_m=0.1), [1.0, -1.0])[0]) == [0.25, -0.25]


def test_the_driver_is_a_first_order_lag():
    ticks = 200
    torque = run(Actuator(time_constant_s=0.05), [1.0], ticks)[:, 0]
    # a step commanded at t = 0; what is held over tick k is the lag's value at the tick's end
    expected = 1.0 - np.exp(-(np.arange(ticks) + 1.0) * TICK_S / 0.05)
    assert torque == pytest.approx(expected, rel=1e-12)


def test_noise_has_the_standard_deviation_asked_for():
    torque = run(Actuator(noise_std_n_m=0.02), [1.0, -1.0], 4000)
    error = torque - [1.0, -1.0]
    assert error.std(axis=0) == pytest.approx([0.02, 0.02], rel=0.06)
    assert np.abs(error.mean(axis=0)).max() < 5.0 * 0.02 / np.sqrt(4000)
    assert abs(np.corrcoef(error.T)[0, 1]) < 5.0 / np.sqrt(4000)


def test_noise_is_redrawn_every_tick_and_repeats_with_the_seed():
    noisy = Actuator(noise_std_n_m=0.02)
    first = run(noisy, ticks=50, seed=3)
    assert len(set(first[:, 0])) == 50
    assert np.array_equal(first, run(noisy, ticks=50, seed=3))
    assert not np.array_equal(first, run(noisy, ticks=50, seed=4))
    assert not np.array_equal(first, run(noisy, ticks=50, seed=3, where="omni.actuator"))


def test_noise_and_lag_do_not_show_in_the_held_command():
    actuator = Actuator(limit_n_m=0.5, time_constant_s=0.05, noise_std_n_m=0.02)
    assert list(run(actuator, [2.0, 0.25], port="held_command")[0]) == [0.5, 0.25]


def test_the_lag_does_not_filter_the_noise_into_its_memory():
    lagged = run(Actuator(time_constant_s=0.05), [1.0], 20)
    noisy = run(Actuator(time_constant_s=0.05, noise_std_n_m=0.02), [1.0], 20)
    fresh = run(Actuator(noise_std_n_m=0.02), [1.0], 20)
    assert noisy - lagged == pytest.approx(fresh - 1.0, abs=1e-15)
