"""Sizes without the rows of a run, and how uncertain they are."""

from types import SimpleNamespace

import numpy as np
import pytest

from drake_ispace.explain.fit.likelihood import Likelihood, fit
from drake_ispace.explain.fit.whitening import Whitening
from drake_ispace.explain.prove.errors.left_out import sizes_without
from stand_ins.dense import Dense
from stand_ins.linear import RUNS, Linear, made, noise, pattern, streams

TILT, DRAG = made("tilt", "drag")


def found(shapes, shared=()):
    """Of each run left out (tilt, drag) and the root of their covariance; truth is 0.7 and -0.4.

    shared: (RUNS, ROWS) nuisances that all runs share.
    """
    measured = noise() + 0.7 * shapes["tilt"] - 0.4 * shapes["drag"]
    prediction = Linear(measured, shapes)
    whitening = Whitening(Linear(noise(), shapes).residuals({}), [{}, {}])
    w = whitening(streams(measured))
    everywhere = np.array([whitening(streams(measured + change)) - w for change in shared]).reshape(-1, len(w))
    likelihood = Likelihood(prediction, whitening, Dense(everywhere), {TILT: [1.0], DRAG: [1.0]})
    best = fit(likelihood, {TILT: [0.1], DRAG: [0.1]})
    decision = SimpleNamespace(end=SimpleNamespace(likelihood=likelihood), named=best)
    runs = np.repeat(np.arange(RUNS), len(w) // RUNS)
    return [(np.ravel([*point.values()]), root) for point, root in sizes_without(decision, runs)]


def test_sizes_are_those_that_the_other_run_shows():
    shapes = {"tilt": pattern(3), "drag": pattern(5)}
    for run, (sizes, root) in enumerate(found(shapes)):
        columns = np.column_stack([shapes[name][1 - run] for name in shapes])
        measured = noise()[1 - run] + columns @ [0.7, -0.4]
        assert sizes == pytest.approx(np.linalg.lstsq(columns, measured, rcond=None)[0], abs=0.01)
        assert root @ root.T == pytest.approx(np.linalg.inv(columns.T @ columns), rel=0.1, abs=1e-4)


@pytest.mark.parametrize("shared", [(), (50.0 * pattern(9),), (50.0 * pattern(5) + pattern(9),)])
def test_what_one_run_alone_shows_is_uncertain_without_it(shared):
    """Whatever else all runs share."""
    only = np.array([0.0, 1.0])[:, None]
    (_, first), (_, second) = found({"tilt": pattern(3), "drag": only * pattern(5)}, shared)
    assert np.abs(first).max() < 1.0 and np.abs(second[1]).max() > 1e3 and np.abs(second[0]).max() < 1.0
