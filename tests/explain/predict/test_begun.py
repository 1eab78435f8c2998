"""A replay that begins at a tick until which the inputs are those of another one is that of the whole run."""

from dataclasses import replace

import numpy as np
import pytest

from drake_ispace.explain.predict.begun import Begun
from drake_ispace.explain.predict.case import prepare
from hidden import two_wheels
from hidden.generator import generate

FROM = 237


@pytest.mark.parametrize("robot", ["omni", "pendulum"])
def test_a_run_begun_from_a_state_is_the_whole_one_to_the_last_bit(robot):
    prediction = prepare(f"{robot}_multirate", [generate(robot, "square", {}, 3.0, 1)]).prediction
    run, start, replay = prediction.tracks[0], prediction.starts[0], prediction.replay
    numbers = replay.parameters({"camera_latency": {"latency_s": 0.02}, "command_delay": {"delay_s": 0.01}})
    begun = Begun(replay, run, start, numbers, [0, FROM, 400])
    force, offset = np.zeros((len(run.command), 3)), np.zeros(run.measured.shape)
    force[FROM:, 0] = offset[FROM:, 0] = 0.05
    for other in (replay.pushed(run, force), replace(run, measured=run.measured + offset)):
        for found, whole in zip(begun.run(other, FROM), replay.run(other, start, numbers), strict=True):
            assert np.array_equal(found, whole, equal_nan=True)
    assert not np.array_equal(begun.run(other, FROM)[0], replay.run(run, start, numbers)[0])


def test_inputs_of_a_run_are_packed_anew_for_other_scales_of_the_encoders_only():
    recordings = [two_wheels.drive(1, 4.0, late_s=0.0, lag_s=0.0)]
    recordings[0].channels.pop("command")
    prediction = prepare(two_wheels.model(), recordings).prediction
    run, replay = prediction.tracks[0], prediction.replay
    plain, scaled, late = (replay.parameters(values) for values in (
        {}, {"encoder_scale": {"share": 0.05}}, {"camera_latency": {"latency_s": 0.02}},
    ))
    packed = replay.packed(run, plain, replay.inputs)
    assert replay.packed(run, late, replay.inputs) is packed
    other = replay.packed(run, scaled, replay.inputs)
    assert not np.array_equal(other, packed)
    assert np.array_equal(replay.packed(run, plain, replay.inputs), packed)
    pushed = replace(run, measured=run.measured + 0.1)
    assert not np.array_equal(replay.packed(pushed, plain, replay.inputs), packed)
