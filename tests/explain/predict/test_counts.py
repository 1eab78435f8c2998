"""Counts of encoders: told from exact angles, and the straightest motion between them."""

import dataclasses

import numpy as np
import pytest

import drake_ispace as di
from drake_ispace.explain.counts import count_of, straightened
from drake_ispace.explain.decide.survey.survey import fit_with_noise, survey
from drake_ispace.explain.fit.candidates import candidates
from drake_ispace.explain.predict.case import prepare
from drake_ispace.explain.predict.filters import filters_of
from drake_ispace.robots.library import robots
from hidden import two_wheels

COUNT = 2.0 * np.pi / 256
T = np.cumsum(np.random.default_rng(5).uniform(0.002, 0.02, 2000))
WANDERING = np.column_stack([8.0 * np.sin(0.7 * T) + 3.0 * T, 4.0 * np.cos(1.3 * T)])


def counted(angles, count=COUNT):
    return count * np.floor(angles / count)


@pytest.mark.parametrize("turns_per_s", [0.5, 40.0])
def test_a_count_is_found_also_where_no_step_is_a_single_one(turns_per_s):
    angles = counted(2.0 * np.pi * turns_per_s * T + WANDERING[:, 0])
    assert count_of(angles) == pytest.approx(COUNT, rel=1e-9)


@pytest.mark.parametrize("angles", [WANDERING, np.zeros((10, 2)), 0.5 * np.arange(200.0) ** 1.01], ids=str)
def test_angles_that_are_not_counted_have_no_count_and_stay_as_they_are(angles):
    assert count_of(angles) == 0.0
    columns = angles.reshape(len(angles), -1)
    assert np.array_equal(straightened(np.arange(float(len(angles))), columns), columns)


def test_a_straightened_motion_agrees_with_the_counts():
    measured = counted(WANDERING)
    assert np.abs(straightened(T, measured) - measured).max() <= 0.5 * COUNT * (1.0 + 1e-9)


@pytest.mark.parametrize("samples, share", [(1, 0.2), (30, 0.7)])
def test_its_error_changes_less_than_that_of_the_counts(samples, share):
    measured = counted(WANDERING)
    changed, before = (
        np.std(np.subtract(angles, WANDERING)[samples:] - np.subtract(angles, WANDERING)[:-samples], axis=0)
        for angles in (straightened(T, measured), measured)
    )
    assert np.all(changed < share * before)


def test_no_motion_within_the_counts_is_shorter():
    measured, random = counted(WANDERING[:300]), np.random.default_rng(8)
    found = straightened(T[:300], measured)

    def length(angles):
        return np.hypot(np.diff(T[:300])[:, None], np.diff(angles, axis=0)).sum()

    for _ in range(500):
        other, first, size = found.copy(), random.integers(1, 299), random.integers(1, 40)
        other[first : first + size] += random.normal(0.0, 0.3 * COUNT)
        other[1:-1] = np.clip(other, measured - 0.5 * COUNT, measured + 0.5 * COUNT)[1:-1]
        other[[0, -1]] = found[[0, -1]]
        assert length(other) >= length(found) * (1.0 - 1e-12)


def test_wheels_that_always_turn_alike_are_straight():
    found = straightened(T, counted(np.column_stack([3.0 * T, -5.0 * T])))
    assert np.abs(np.diff(np.diff(found, axis=0) / np.diff(T)[:, None], axis=0))[20:-20].max() < 0.05


def test_a_coarse_encoder_is_trusted_less():
    scenario, robot = two_wheels.model(), robots()["rover"]
    has = frozenset({"command", "encoder", "kinect"})
    gains = [
        np.linalg.norm(filters_of(scenario, robot, has, count_rad=count)(scenario.rover.plant).gain)
        for count in (0.0, COUNT)
    ]
    assert gains[1] < gains[0]


def without_command(run):
    return dataclasses.replace(run, channels={name: c for name, c in run.channels.items() if name != "command"})


@pytest.mark.parametrize("encoder_hz, off", [(200.0, 0.0), (50.0, 1e-12)])
def test_wheels_lead_to_the_fixes_whether_or_not_the_command_was_logged(encoder_hz, off):
    run = two_wheels.drive(5, 8.0, 0.04, 0.08, 0.06, camera_hz=10.0, encoder_hz=encoder_hz)
    found = [prepare(two_wheels.model(), [one]).prediction for one in (run, without_command(run))]
    for effects in ({}, {"wheel_radius_error": {"share": 0.05}, "camera_latency": {"latency_s": 0.1}}):
        (logged,), (alone,) = (prediction.residuals(effects) for prediction in found)
        assert logged["motion"].any() and logged["room"] == pytest.approx(alone["room"], rel=0.0, abs=off)


@pytest.mark.slow
@pytest.mark.parametrize("has_command", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_coarse_counts_are_no_camera_that_is_late(has_command, monkeypatch):
    monkeypatch.setattr(two_wheels, "COUNTS", 256)
    monkeypatch.setattr(two_wheels, "FIX_RMS", (1e-4, 1e-4, 4e-4))
    runs = [
        two_wheels.drive(700 + i, 20.0, 0.0, 0.0, 0.0, camera_hz=10.0, encoder_hz=200.0, in_step=True) for i in range(3)
    ]
    if not has_command:
        runs = [without_command(run) for run in runs]
    answer = di.explain(two_wheels.model(), runs[:2], runs[2:])
    assert answer.verdict == "none" and not answer.data, answer


@pytest.mark.first_case
@pytest.mark.parametrize("has_command", [False, True])
def test_a_few_counts_a_turn_that_nobody_stated_are_not_missing(has_command, monkeypatch):
    monkeypatch.setattr(two_wheels, "COUNTS", 20)
    runs = [two_wheels.drive(700 + i, 20.0, 0.0, 0.0, 0.0) for i in range(3)]
    if not has_command:
        runs = [without_command(run) for run in runs]
    tried = [di.effects()[name] for name in ("clock_offset", "camera_latency", "wheel_radius_error", "track_error")]
    answer = di.explain(two_wheels.model(), runs[:2], runs[2:], tried)
    assert answer.verdict == "none", answer


@pytest.mark.slow
def test_a_gain_is_found_though_what_another_filter_leaves_looks_like_it_where_it_is_missing(monkeypatch):
    monkeypatch.setattr(two_wheels, "COUNTS", 64)
    runs = [two_wheels.drive(700 + i, 20.0, 0.0, 0.0, 0.0, others={"gain_share": 0.05}) for i in range(2)]
    prediction = prepare(two_wheels.model(), runs).prediction
    every = candidates(prediction.replay.effects, prediction.replay.body)
    (gain,) = (one for one in every if one.name == "velocity_gain")
    for start in (0.03, 0.07):
        _, best = fit_with_noise(survey(prediction, {}, every).view, {gain: [start, start]})
        assert np.array(best.point[gain]) == pytest.approx(0.05, abs=0.002)
