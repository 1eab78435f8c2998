"""Runs as they would have been counted, had each encoder stood elsewhere within its count."""

import dataclasses

import numpy as np
import pytest

from drake_ispace.explain.predict.case import prepare
from drake_ispace.explain.prove.noise.counting import Recounting
from drake_ispace.explain.prove.noise.noise import sensor_noise
from hidden import two_wheels

COUNTS = 64
COUNT = 2.0 * np.pi / COUNTS


@pytest.fixture(scope="module")
def case():
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(two_wheels, "COUNTS", COUNTS)
        run = two_wheels.drive(3, 30.0, 0.0, 0.0, 0.0)
    return prepare(two_wheels.model(), [run])


@pytest.fixture
def track(case):
    return case.prediction.tracks[0]


def drawn(track, number=200):
    recounting = Recounting(track, 2, COUNT)
    return [recounting.drawn(np.random.default_rng(k)) for k in range(number)]


def test_the_counts_are_those_that_the_runs_show(case):
    assert sensor_noise(case.scenario, case.prediction, 0).count_rad == pytest.approx(COUNT)


def test_what_is_shown_changes_by_as_much_as_rounding(track):
    off = np.array([(one.measured - track.measured)[track.reads] for one in drawn(track)])
    assert np.abs(off).max() <= 0.5 * COUNT * (1.0 + 1e-9)
    assert np.sqrt(np.mean(off**2)) == pytest.approx(COUNT / np.sqrt(12.0), rel=0.05)


def test_a_wheel_at_rest_passes_one_count_at_most(track):
    resting = track.reads[track.reads < 380]  # the robot stands for two seconds
    for one in drawn(track, 5):
        steps = np.abs(np.diff(one.measured[resting], axis=0)) > 0.5 * COUNT
        assert steps.sum(axis=0).max() <= 1


def test_the_wheels_turn_as_straight_as_the_new_counts_allow(track):
    off = np.array([one.turned - track.turned for one in drawn(track, 20)])
    assert 0.05 * COUNT < np.sqrt(np.mean(off**2)) < COUNT / np.sqrt(12.0)


def test_where_the_model_follows_the_straightest_motion_so_does_what_is_drawn(track):
    followed = dataclasses.replace(track, measured=track.turned, rounding=None)
    for one, other in zip(drawn(followed, 3), drawn(track, 3), strict=True):
        assert one.measured == pytest.approx(other.turned, abs=1e-9)
