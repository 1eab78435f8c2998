"""Which moments are scored goes by the speeds of the wheels, and by the friction that the model has."""

import numpy as np
import pytest

from drake_ispace.effects.places.smooth import speed_scale
from drake_ispace.explain.predict.case import prepare
from drake_ispace.explain.predict.prediction import wheel_speeds
from hidden.generator import generate
from stand_ins.tried import FEW, OMNI


def friction(torque_n_m):
    return {"coulomb_friction": {"torque_n_m": torque_n_m}}


@pytest.fixture(scope="module")
def prediction():
    return prepare("omni_multirate", [generate("omni", "square", {}, 10.0, 1)], effects=FEW).prediction


@pytest.fixture(scope="module")
def slowest(prediction):
    (track,) = prediction.tracks
    return np.abs(wheel_speeds(track.measured[: track.ticks, :4])).min(axis=1)[track.settled :]


def scored(prediction, values):
    (classes,) = prediction.classes(values)
    return classes["motion"] > 0


def test_smooth_friction_is_nearly_whole_at_twice_its_width(prediction):
    assert prediction.replay.turning_rad_s({}) == 0.0
    assert prediction.replay.turning_rad_s(friction(0.1)) == pytest.approx(2.0 * speed_scale(OMNI, 0.1))


def test_a_wheel_too_slow_for_the_models_friction_is_not_scored(prediction, slowest):
    without, turning = scored(prediction, {}), prediction.replay.turning_rad_s(friction(0.05))
    assert (without & (slowest < turning)).any()
    assert scored(prediction, friction(0.05)).tolist() == (without & (slowest >= turning)).tolist()


def test_however_large_the_friction_is_fast_wheels_are_scored(prediction, slowest):
    (track,) = prediction.tracks
    fast = slowest > 0.4 * np.sqrt(np.mean(wheel_speeds(track.measured[: track.ticks, :4]) ** 2))
    assert fast.any() and scored(prediction, friction(100.0)).tolist() == fast.tolist()
