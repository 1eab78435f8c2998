"""Vectors kept by run give the numbers of the full ones; what a memory explains is taken once and for all."""

import numpy as np
import pytest

from drake_ispace.explain.fit.directions import Directions, amounts_of, spent_on
from drake_ispace.explain.fit.memory import Memory, alike

RNG = np.random.default_rng(0)
OWN = [(0, RNG.standard_normal((2, 40))), (40, RNG.standard_normal((3, 60)))]
DIRECTIONS = Directions(RNG.standard_normal((4, 100)), OWN)
DENSE = np.vstack([DIRECTIONS.everywhere, *(np.pad(part, ((0, 0), (a, 100 - a - part.shape[1]))) for a, part in OWN)])


def removed(known, vectors):
    """The vectors without what a memory explains of them."""
    left = vectors.copy()
    known.subtract(known.amounts(vectors), left)
    return left


def memory():
    """Of two channels, a run of 20 instants and one of 30."""
    basis = np.linalg.qr(RNG.standard_normal((50, 5)))[0]
    return Memory(2, [(0, 40), (40, 100)], [basis[:20], basis[20:]])


def nearest(directions, y):
    """The amounts whose sum comes nearest to `y`."""
    return amounts_of(directions.gram(), directions.dot(y))


def test_products_are_those_of_the_full_vectors():
    vectors = RNG.standard_normal((6, 100))
    assert len(DIRECTIONS) == len(DENSE) == 9
    assert DIRECTIONS.dot(vectors) == pytest.approx(vectors @ DENSE.T)
    assert DIRECTIONS.dot(vectors[0]) == pytest.approx(DENSE @ vectors[0])
    assert DIRECTIONS.gram() == pytest.approx(DENSE @ DENSE.T)


def test_sums_are_those_of_the_full_vectors():
    amounts = RNG.standard_normal((6, 9))
    assert DIRECTIONS.combined(amounts) == pytest.approx(amounts @ DENSE)
    assert DIRECTIONS.combined(amounts[0]) == pytest.approx(amounts[0] @ DENSE)


def test_least_squares_finds_what_was_put_in():
    amounts, rest = RNG.standard_normal(9), RNG.standard_normal(100)
    rest -= DENSE.T @ np.linalg.lstsq(DENSE.T, rest, rcond=None)[0]
    assert nearest(DIRECTIONS, DENSE.T @ amounts + rest) == pytest.approx(amounts)


def test_of_three_directions_in_a_plane_none_runs_away():
    one, other = RNG.standard_normal((2, 100))
    found = nearest(Directions(np.array([one, other, one + other])), 3.0 * one)
    assert np.abs(found).max() < 4.0
    assert found @ np.array([one, other, one + other]) == pytest.approx(3.0 * one)


@pytest.mark.parametrize("copies", [(1, 1, 0, 0), (0, 0, 0, 1), (1, 1, 1, 0)])
def test_directions_that_coincide_in_groups_share_within_each(copies):
    pair = RNG.standard_normal((2, 100))
    found = nearest(Directions(pair[list(copies)]), 3.0 * pair[0] - 2.0 * pair[1])
    for which, amount in ((0, 3.0), (1, -2.0)):
        own = [a for a, copy in zip(found, copies, strict=True) if copy == which]
        assert own == pytest.approx([amount / len(own)] * len(own), abs=1e-6)


def test_directions_that_all_coincide_share():
    one = RNG.standard_normal(100)
    assert nearest(Directions(np.array([one, one, one])), one) == pytest.approx([1.0 / 3.0] * 3)


def test_directions_that_coincide_share():
    one = RNG.standard_normal(100)
    assert nearest(Directions(np.array([one, one])), one) == pytest.approx([0.5, 0.5])


def test_a_memory_takes_each_channel_by_the_same_basis_and_nothing_twice():
    known = memory()
    vectors = RNG.standard_normal((3, 100))
    once = removed(known, vectors)
    basis = np.vstack(known.bases)
    for channel in range(2):
        x = vectors[:, channel::2]
        assert once[:, channel::2] == pytest.approx(x - x @ basis @ basis.T)
    assert removed(known, once) == pytest.approx(once)


def test_products_less_memory_are_those_of_vectors_less_memory():
    known = memory()
    left, amounts = removed(known, DENSE), known.amounts_in(DIRECTIONS)
    assert DIRECTIONS.gram() - alike(amounts, amounts) == pytest.approx(left @ left.T, abs=1e-9)


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
