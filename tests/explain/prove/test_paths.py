"""Errors of paths, against numbers that can be checked by hand and against dead reckoning in a few lines."""

import numpy as np
import pytest

from drake_ispace.explain.prove.errors.paths import (
    absolute_errors,
    aligned,
    chained,
    compose,
    pairs,
    relative,
    relative_errors,
)

RANDOM = np.random.default_rng(0)
POSES = RANDOM.uniform(-2.0, 2.0, (20, 3))


def test_relative_undoes_compose():
    others = RANDOM.uniform(-2.0, 2.0, (20, 3))
    assert np.allclose(relative(POSES, compose(POSES, others)), others)


def test_a_motion_along_the_heading_is_along_x():
    begin, end = np.array([1.0, 1.0, np.pi / 2]), np.array([1.0, 3.0, np.pi])
    assert np.allclose(relative(begin, end), [[2.0, 0.0, np.pi / 2]])


def test_motions_in_a_chain_lead_along_the_path():
    assert np.allclose(chained(POSES[0], relative(POSES[:-1], POSES[1:])), POSES)


def test_alignment_finds_where_a_path_began():
    start = np.array([0.4, -0.7, 2.0])
    assert np.allclose(aligned(POSES, compose(start, POSES)), start)


def test_absolute_errors_are_not_aligned():
    moved = POSES + [0.03, 0.04, 0.0]
    errors = absolute_errors(moved, POSES)
    assert np.allclose(np.hypot(errors[:, 0], errors[:, 1]), 0.05) and np.allclose(errors[:, 2], 0.0)


def test_relative_errors_do_not_see_where_a_path_begins():
    other = compose(np.array([5.0, -3.0, 1.0]), POSES)
    assert np.allclose(relative_errors((other[:-1], other[1:]), (POSES[:-1], POSES[1:])), 0.0)


def test_a_scale_of_one_per_cent_is_a_relative_error_of_one_per_cent():
    line = np.column_stack([np.arange(5.0), np.zeros(5), np.zeros(5)])
    errors = relative_errors((1.01 * line[:-1], 1.01 * line[1:]), (line[:-1], line[1:]))
    assert np.allclose(errors, [[0.01, 0.0, 0.0]] * 4)


def test_pairs_are_a_horizon_apart_and_begin_no_denser_than_asked():
    times = 0.095 * np.arange(100)
    chosen = pairs(times, 1.0, 0.5)
    lengths, begins = times[chosen[:, 1]] - times[chosen[:, 0]], times[chosen[:, 0]]
    assert np.abs(lengths - 1.0).max() <= 0.0475 + 1e-9 and np.diff(begins).min() >= 0.5
    assert len(pairs(times, 20.0, 1.0)) == 0 and len(pairs(times[:1], 1.0, 1.0)) == 0


def test_a_gap_in_the_fixes_has_no_pairs():
    times = np.array([0.0, 0.1, 0.2, 3.0, 3.1])
    assert pairs(times, 1.0, 0.0).tolist() == []
    assert pairs(times, 0.1, 0.0) == pytest.approx(np.array([[0, 1], [1, 2], [3, 4]]))
