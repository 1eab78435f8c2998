"""The gains by which the room view follows fixes, and what they make of cameras with noisy headings."""

import dataclasses

import numpy as np
import pytest

import drake_ispace as di
from drake_ispace.explain.predict.case import prepare
from hidden import two_wheels


def with_noisy_headings(run, noise_rad, seed):
    """The recording with headings of the camera that have further noise of this standard deviation."""
    camera = run.channels["kinect"]
    noise = np.random.default_rng(seed).normal(0.0, noise_rad, len(camera.t))
    noisy = camera.values + noise[:, None] * [0.0, 0.0, 1.0]
    return dataclasses.replace(run, channels=run.channels | {"kinect": dataclasses.replace(camera, values=noisy)})


def runs(noise_rad, count, seconds, **hidden):
    hidden = {"left_share": 0.0, "late_s": 0.0, "lag_s": 0.0} | hidden
    drives = [two_wheels.drive(9000 + i, seconds, in_step=True, **hidden) for i in range(count)]
    return [with_noisy_headings(run, noise_rad, i) for i, run in enumerate(drives)]


def gains(noise_rad):
    replay = prepare(two_wheels.model(), runs(noise_rad, 2, 10.0)).prediction.replay
    return [replay.rollout.parameters[replay.rollout.index(f"rover_view.gain[{which}]")] for which in (0, 1)]


def test_the_noisier_the_headings_the_less_they_are_followed():
    quiet, noisy = gains(0.0)[1], gains(0.1)[1]
    assert noisy < 0.1 and noisy < quiet


def test_noise_of_headings_is_no_reason_to_take_every_place_for_exact():
    assert gains(0.03)[0] < 0.5


@pytest.mark.slow
def test_a_marker_is_named_whatever_the_noise_of_the_headings():
    *training, unseen = runs(0.1, 3, 12.0, others={"marker_x_m": 0.03})
    some = [di.effects()[name] for name in ("marker_offset", "constant_slip", "track_error", "camera_latency")]
    answer = di.explain(two_wheels.model(), training, [unseen], some)
    assert [effect.name for effect in answer.effects] == ["marker_offset"]
