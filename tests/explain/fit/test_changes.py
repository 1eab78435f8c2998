"""Products of whitened changes that exist for one run at a time are those of the long vectors."""

import itertools

import numpy as np
import pytest

from drake_ispace.explain.fit.changes import Changes, Marginal
from drake_ispace.explain.fit.likelihood import Likelihood
from drake_ispace.explain.fit.offsets import offsets_of, stacks_of, stacks_of_runs
from drake_ispace.explain.fit.whitening import Whitening

RNG = np.random.default_rng(0)
ROWS = (900, 700)


def residuals(scale=1.0):
    """Of two runs, each with two streams, correlated in time."""
    return [
        {"motion": scale * np.cumsum(RNG.standard_normal((n, 2)), axis=0), "room": RNG.standard_normal((n // 10, 3))}
        for n in ROWS
    ]


MEASURED = residuals()
CLASSES = [{"motion": RNG.integers(1, 5, n)} for n in ROWS]  # class 1 is not scored
WHITENING = Whitening(MEASURED, CLASSES)
FOUND = [residuals(0.1) for _ in range(5)]
OFFSETS = offsets_of(
    WHITENING, MEASURED, [stacks_of([residuals(0.2) for _ in range(3)], MEASURED)],
    stacks_of_runs([(i, residuals()[i]) for i in (0, 0, 1)], MEASURED),
)
CHANGES = Changes(WHITENING, MEASURED, FOUND)
X = np.array([WHITENING(change) for change in FOUND])
LIKELIHOOD = Likelihood(None, WHITENING, OFFSETS, {}, WHITENING.memory(MEASURED))
MARGINAL = Marginal(CHANGES, OFFSETS, LIKELIHOOD.memory, LIKELIHOOD.remembered, LIKELIHOOD.inner)


def test_the_transpose_has_the_products_of_the_whitened():
    w = RNG.standard_normal(X.shape[1])
    assert CHANGES.dot(w) == pytest.approx(X @ w, rel=1e-10)


def test_a_run_has_its_part_of_the_vectors():
    assert np.hstack([CHANGES.of_run(0), CHANGES.of_run(1)]) == pytest.approx(X)


def test_sums_are_those_of_the_vectors():
    amounts = RNG.standard_normal(len(X))
    assert CHANGES.combined(amounts) == pytest.approx(amounts @ X)


def test_the_gram_matrix_has_changes_and_offsets():
    every = np.vstack([X, OFFSETS.combined(np.eye(len(OFFSETS)))])
    assert MARGINAL.gram == pytest.approx(every @ every.T)
    w = RNG.standard_normal(X.shape[1])
    assert MARGINAL.least_squares(w) == pytest.approx(np.linalg.lstsq(every.T, w, rcond=None)[0], rel=1e-6)


def test_the_deviance_is_the_least_sum_of_squares_over_coefficients_and_offsets():
    w, offsets, pasts = RNG.standard_normal(X.shape[1]), OFFSETS.combined(np.eye(len(OFFSETS))), []
    for memory in LIKELIHOOD.memory:
        p, q = memory.shape
        past = np.zeros((p, q, len(w)))
        for channel, ((start, end), basis) in itertools.product(
            range(p), zip(memory.places, memory.bases, strict=True)
        ):
            past[channel, :, start + channel : end : p] = basis.T
        pasts += [*past.reshape(-1, len(w))]
    priors = np.hstack([np.zeros((len(offsets), len(pasts))), np.eye(len(offsets))])
    rows, y = np.vstack([np.vstack([*pasts, *offsets]).T, priors]), np.concatenate([w, np.zeros(len(offsets))])
    least = np.sum((y - rows @ np.linalg.lstsq(rows, y, rcond=None)[0]) ** 2)
    assert LIKELIHOOD.deviance(w) == pytest.approx(least, rel=1e-8)


def test_what_is_left_is_what_the_likelihood_leaves():
    left = LIKELIHOOD.marginalised(X)
    assert LIKELIHOOD.products(X) == pytest.approx(X @ left.T, rel=1e-8)
    assert MARGINAL.inner == pytest.approx(X @ left.T, rel=1e-8)
    w, instants = RNG.standard_normal(X.shape[1]), WHITENING.instants(MEASURED)
    sums = np.array([np.bincount(instants, row * w) for row in left])
    assert MARGINAL.by_instant(w, instants) == pytest.approx(sums, abs=1e-9)
