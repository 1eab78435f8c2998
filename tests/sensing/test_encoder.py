"""Encoders: counts, the velocity made from them, stamps, and the phase in which they sample."""

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ZeroOrderHold

from drake_ispace.blocks.block import Block, Output, Spec
from drake_ispace.blocks.rates import TICK_S
from drake_ispace.sensing.encoder import Encoder, WheelEncoder

COUNT_RAD = 2.0 * np.pi / 108


class Wheel(Block):
    """A wheel that stands at `start` until tick 0 and turns by `step` per tick from then on; it claims a rate of 7."""

    def __init__(self, step, start=0.0):
        super().__init__(Spec(
            outputs={"angle": Output(1, turned), "rate": Output(1, claimed)}, parameters={"step": step, "start": start},
        ))


def turned(tick, step, start, out):
    out[0] = start + step * tick


def claimed(out):
    out[0] = 7.0


def messages(encoder, step, start=0.0, ticks=10):
    """(ticks, 3): tick, theta, omega as a block that computes in tick 0, 1, ... sees them."""
    builder = DiagramBuilder()
    wheel = builder.AddSystem(Wheel(step, start))
    sensor = builder.AddSystem(WheelEncoder(encoder, 1))
    reader = builder.AddSystem(ZeroOrderHold(TICK_S, 3))
    builder.Connect(wheel.GetOutputPort("angle"), sensor.GetInputPort("wheel_angle"))
    builder.Connect(wheel.GetOutputPort("rate"), sensor.GetInputPort("wheel_rate"))
    builder.Connect(sensor.GetOutputPort("message"), reader.get_input_port())
    simulator = Simulator(builder.Build())
    rows = []
    for tick in range(ticks):
        simulator.AdvanceTo((tick + 0.5) * TICK_S)
        rows.append(reader.get_output_port().Eval(reader.GetMyContextFromRoot(simulator.get_context())).copy())
    return np.array(rows)


@pytest.mark.parametrize("share, counts", [(0.49, 0), (0.51, 1), (-0.49, 0), (-0.51, -1), (1.49, 1), (1.51, 2)])
def test_a_wheel_starts_in_the_middle_of_a_count(share, counts):
    angle = messages(Encoder(), 0.0, share * COUNT_RAD, 1)[0, 1]
    assert angle == pytest.approx(counts * COUNT_RAD, abs=1e-15)


def test_one_turn_is_108_counts():
    assert messages(Encoder(), 0.0, 2.0 * np.pi, 1)[0, 1] / COUNT_RAD == pytest.approx(108.0, abs=1e-12)


def test_without_counts_the_angle_is_exact():
    assert messages(Encoder(counts_per_turn=0), 0.0, 0.123456789, 1)[0, 1] == 0.123456789


def test_samples_are_taken_before_controllers_compute_and_carry_their_tick():
    rows = messages(Encoder(counts_per_turn=0), 0.001)
    assert list(rows[:, 0]) == list(range(10))
    assert np.array_equal(rows[:, 1], 0.001 * np.arange(10))


def test_the_tick_port_is_the_robots_clock():
    block = WheelEncoder(Encoder(), 2)
    context = block.CreateDefaultContext()
    assert block.GetOutputPort("tick").Eval(context)[0] == -1.0
    context.SetDiscreteState([41.0, 0, 0, 0, 0])
    assert block.GetOutputPort("tick").Eval(context)[0] == 41.0


def test_a_new_encoder_has_no_sample():
    block = WheelEncoder(Encoder(), 2)
    assert list(block.GetOutputPort("message").Eval(block.CreateDefaultContext())) == [-1, 0, 0, 0, 0]


def test_the_filtered_velocity_reaches_63_percent_in_20_ms():
    rate = messages(Encoder(counts_per_turn=0), 1.0 * TICK_S)[:, 2]  # 1 rad/s
    # the first sample has no difference; 4 differences later 20 ms have passed
    assert rate[4] == pytest.approx(1.0 - np.exp(-1.0), abs=1e-8)
    assert rate == pytest.approx(1.0 - np.exp(-0.25 * np.arange(10)), abs=1e-8)


def test_the_raw_velocity_jumps_by_one_count_in_one_tick():
    rate = messages(Encoder(velocity="raw"), 0.1 * COUNT_RAD)[:, 2]
    # 0.058 rad / 5 ms = 11.6 rad/s, which is 0.28 m/s at the omni robot's wheel
    assert rate[5] == pytest.approx(11.636, abs=0.001)
    assert rate[5] * 0.024 == pytest.approx(0.279, abs=0.001)
    assert np.count_nonzero(rate) == 1


def test_the_exact_velocity_is_the_plants():
    assert set(messages(Encoder(velocity="exact"), 0.3)[:, 2]) == {7.0}


@pytest.mark.parametrize("velocity", ["filtered", "raw"])
def test_a_wheel_that_stands_anywhere_gives_no_spike_at_the_first_sample(velocity):
    assert not messages(Encoder(velocity=velocity), 0.0, start=50.0)[:, 2].any()


def test_every_wheel_has_its_own_filter():
    block = WheelEncoder(Encoder(counts_per_turn=0, velocity="raw"), 2)
    simulator = Simulator(block)
    for tick, angles in enumerate([[1.0, -2.0], [1.5, -3.0]]):
        context = simulator.get_mutable_context()
        block.GetInputPort("wheel_angle").FixValue(context, angles)
        block.GetInputPort("wheel_rate").FixValue(context, [0.0, 0.0])
        simulator.AdvanceTo((tick + 0.5) * TICK_S)
    message = block.GetOutputPort("message").Eval(simulator.get_context())
    assert message == pytest.approx([1.0, 1.5, -3.0, 100.0, -200.0], rel=1e-8)
