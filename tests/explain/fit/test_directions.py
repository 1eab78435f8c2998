"""Least squares by vectors that nearly coincide; what a memory explains is taken once and for all."""

import numpy as np
import pytest

from drake_ispace.explain.fit.directions import Part, amounts_of, errors_of, spent_on
from drake_ispace.explain.fit.memory import Memory

RNG = np.random.default_rng(0)
VECTORS = RNG.standard_normal((9, 100))


def removed(known, vectors):
    """The vectors without what a memory explains of them."""
    left = vectors.copy()
    known.subtract(known.amounts(vectors), left)
    return left


def memory():
    """Of two channels, a run of 20 instants and one of 30."""
    basis = np.linalg.qr(RNG.standard_normal((50, 5)))[0]
    return Memory(2, [(0, 40), (40, 100)], [basis[:20], basis[20:]])


def nearest(vectors, y):
    """The amounts of vectors (k, n) whose sum comes nearest to `y`."""
    return amounts_of(vectors @ vectors.T, vectors @ y)


def test_some_of_many_vectors_are_these_the_others_being_zero():
    rows, places = VECTORS[:3], np.array([4, 0, 7])
    whole, part, others = np.zeros((9, 100)), Part(rows, places, 9), RNG.standard_normal((6, 100))
    whole[places] = rows
    assert part.dot(others) == pytest.approx(others @ whole.T) and part.gram() == pytest.approx(whole @ whole.T)
    assert part.combined(np.eye(9)) == pytest.approx(whole) and part.spread(rows) == pytest.approx(whole)


def test_least_squares_finds_what_was_put_in():
    amounts, rest = RNG.standard_normal(9), RNG.standard_normal(100)
    rest -= VECTORS.T @ np.linalg.lstsq(VECTORS.T, rest, rcond=None)[0]
    assert nearest(VECTORS, VECTORS.T @ amounts + rest) == pytest.approx(amounts)


def test_of_three_directions_in_a_plane_none_runs_away():
    one, other = RNG.standard_normal((2, 100))
    found = nearest(np.array([one, other, one + other]), 3.0 * one)
    assert np.abs(found).max() < 4.0
    assert found @ np.array([one, other, one + other]) == pytest.approx(3.0 * one)


@pytest.mark.parametrize("copies", [(1, 1, 0, 0), (0, 0, 0, 1), (1, 1, 1, 0)])
def test_directions_that_coincide_in_groups_share_within_each(copies):
    pair = RNG.standard_normal((2, 100))
    found = nearest(pair[list(copies)], 3.0 * pair[0] - 2.0 * pair[1])
    for which, amount in ((0, 3.0), (1, -2.0)):
        own = [a for a, copy in zip(found, copies, strict=True) if copy == which]
        assert own == pytest.approx([amount / len(own)] * len(own), abs=1e-6)


def test_directions_that_all_coincide_share():
    one = RNG.standard_normal(100)
    assert nearest(np.array([one, one, one]), one) == pytest.approx([1.0 / 3.0] * 3)


def test_directions_that_coincide_share():
    one = RNG.standard_normal(100)
    assert nearest(np.array([one, one]), one) == pytest.approx([0.5, 0.5])


def test_a_memory_takes_each_channel_by_the_same_basis_and_nothing_twice():
    known = memory()
    vectors = RNG.standard_normal((3, 100))
    once = removed(known, vectors)
    basis = np.vstack(known.bases)
    for channel in range(2):
        x = vectors[:, channel::2]
        assert once[:, channel::2] == pytest.approx(x - x @ basis @ basis.T)
    assert removed(known, once) == pytest.approx(once)


def test_errors_of_amounts_have_their_covariance():
    random = np.random.default_rng(4)
    vectors = np.vstack([random.standard_normal((6, 40)), np.zeros((1, 40))])
    vectors = np.vstack([vectors, vectors[0]])  # one vanishes, and two are the same
    each, few = (errors_of(vectors @ vectors.T, count) for count in (6, 2))
    assert each.T @ each == pytest.approx(np.linalg.pinv(vectors @ vectors.T), abs=1e-9)
    assert np.sum((few @ vectors) ** 2) == pytest.approx(6.0)


def test_a_fit_spends_as_many_numbers_as_it_has_vectors_and_more_of_them_where_these_are():
    random = np.random.default_rng(4)
    vectors = np.vstack([random.standard_normal((6, 40)), np.zeros((1, 40))])
    vectors = np.vstack([vectors, vectors[0]])  # one vanishes, and two are the same
    vectors[:, 30:] *= 1e-3
    gram = vectors @ vectors.T
    assert spent_on(gram, vectors) == pytest.approx(6.0, rel=1e-6)
    assert spent_on(gram, vectors[:, :30]) == pytest.approx(6.0, rel=1e-3)
    fitted = vectors[:6].T @ np.linalg.pinv(vectors[:6].T)
    assert spent_on(gram, vectors[:, :4]) == pytest.approx(np.trace(fitted[:4, :4]), rel=1e-6)
