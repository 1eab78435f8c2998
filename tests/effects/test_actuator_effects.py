"""Effects between command and motor: numbers by hand."""

import math

import numpy as np
import pytest
from passing import passed
from rail import rail

from drake_ispace.blocks.kernels import arguments
from drake_ispace.blocks.rates import TICK_S
from drake_ispace.effects.effect import EffectBlock
from drake_ispace.effects.places.actuator import EFFECTS

BY_NAME = {effect.card.name: effect for effect in EFFECTS}


def given(name, torques, **values):
    """What a block makes of held commands (ticks, n), tick after tick: sense what was held, then hold the next."""
    torques = np.asarray(torques, dtype=float).reshape(len(torques), -1)
    own = rail(torques.shape[1])
    spec = BY_NAME[name].spec(own, BY_NAME[name].neutral(own) | values)
    ports = dict(spec.parameters)
    ports["xd"] = np.empty(0) if spec.discrete_state is None else spec.discrete_state
    ports["torque"], rows = np.zeros(own.wheels), []
    for tick, torque in enumerate(torques):
        ports["tick"] = tick
        for update in spec.updates:
            ports["xd"] = called(update.kernel, ports, len(ports["xd"]))
        ports["torque"] = torque
        rows.append(called(spec.outputs["torque"].kernel, ports, own.wheels))
    return np.squeeze(rows, axis=1) if own.wheels == 1 else np.array(rows)


def called(kernel, ports, size):
    out = np.empty(size)
    kernel(*[ports[name] for name in arguments(kernel)], out)
    return out


def test_they_act_in_this_order():
    assert list(BY_NAME) == [
        "command_delay", "torque_saturation", "torque_slew_limit", "actuator_dead_zone", "torque_gain_error",
        "weak_motor", "motor_offset", "battery_sag_time", "battery_sag_load", "motor_lag",
    ]


def test_an_offset_pushes_one_motor_whatever_its_command():
    pushed = passed("motor_offset", rail(3), [1.0, -1.0, 0.0], wheel=2, offset_n_m=0.25)
    assert pushed == pytest.approx([1.0, -0.75, 0.0])


def test_a_block_has_its_output_on_a_bare_context():
    block = EffectBlock(BY_NAME["actuator_dead_zone"], rail(3), {"width_n_m": 0.5})
    context = block.CreateDefaultContext()
    block.GetInputPort("torque").FixValue(context, [2.0, 0.3, -2.0])
    assert list(block.GetOutputPort("torque").Eval(context)) == [1.5, 0.0, -1.5]


def test_a_delay_of_whole_ticks_shifts():
    assert list(given("command_delay", [1, 2, 3, 4], delay_s=0.005)) == [0, 1, 2, 3]
    assert list(given("command_delay", [1, 2, 3, 4], delay_s=0.0)) == [1, 2, 3, 4]


def test_a_delay_of_a_part_of_a_tick_is_the_mean_of_two_commands():
    assert given("command_delay", [1, 2, 3, 4], delay_s=0.00625) == pytest.approx([0, 0.75, 1.75, 2.75], abs=1e-6)


def test_the_longest_delay_is_twelve_ticks():
    assert given("command_delay", [[1, -1]] * 14, delay_s=0.06)[11:].tolist() == [[0, 0], [1, -1], [1, -1]]


def test_saturation_clips():
    assert list(given("torque_saturation", [0.5, 2, -3], limit_n_m=1.0)) == [0.5, 1.0, -1.0]


def test_a_slew_limit_makes_a_ramp_of_a_step():
    rate = 0.25 / TICK_S
    assert given("torque_slew_limit", [1, 1, 1, 1, 1, 0], rate_n_m_s=rate) == pytest.approx(
        [0.25, 0.5, 0.75, 1.0, 1.0, 0.75]
    )


def test_gains_scale_all_wheels_or_one():
    assert given("torque_gain_error", [[1, 2]], share=0.5).tolist() == [[1.5, 3.0]]
    assert given("weak_motor", [[1, 2]], wheel=2, loss=0.25).tolist() == [[1.0, 1.5]]


def test_a_weak_motor_needs_a_stronger_one_beside_it():
    assert BY_NAME["weak_motor"].applies_to(rail(2)) and not BY_NAME["weak_motor"].applies_to(rail(1))


def test_a_battery_sags_with_the_time_of_the_tick():
    sagged = given("battery_sag_time", np.ones(201), rate_per_s=0.02)
    assert sagged[[0, 100, 200]] == pytest.approx([1.0, 1.0 - 0.02 * 0.5, 1.0 - 0.02 * 1.0])


def test_a_battery_sags_with_the_load_of_all_wheels_and_not_below_nothing():
    assert given("battery_sag_load", [[1, -3]], share_per_n_m=0.1) == pytest.approx(np.array([[0.6, -1.8]]))
    assert given("battery_sag_load", [[1, -3]], share_per_n_m=0.5).tolist() == [[0.0, 0.0]]


def test_a_lag_gives_the_mean_over_each_tick():
    # time constant = tick: a step reaches 1 - exp(-k) after k ticks; its mean over the first is exp(-1)
    means = [1.0 - (math.exp(-k) - math.exp(-k - 1)) for k in range(4)]
    assert given("motor_lag", np.ones(4), time_constant_s=TICK_S) == pytest.approx(means)
    # what is missing of a long step is its time constant, as of a delay
    assert TICK_S * np.sum(1.0 - given("motor_lag", np.ones(400), time_constant_s=0.03)) == pytest.approx(0.03)
