"""How much of an error a measured variable predicts, in runs from which this was not learned."""

from collections.abc import Sequence

import numpy as np

from drake_ispace.explain.prove.free_run import Measure
from drake_ispace.explain.prove.gap import seconds
from drake_ispace.explain.prove.left_out import MOST_BLOCKS
from drake_ispace.explain.prove.remainder import Series

PREDICTED = 0.2  # share of the squared error that a variable may predict in runs from which this was not learned


def best_driver(m: Measure, series: Sequence[Series], among: Sequence[str]) -> tuple[str, float]:
    """The variable among these that predicts most of an error, and the share of its square; "", 0 where none can."""
    if len(series) == 1 and np.ptp(series[0].t) < (MOST_BLOCKS - 1) * seconds(m.horizon):
        return "", 0.0  # each fold must have a window to itself
    shares = {d: predicted_share([(run.drivers[d], run.errors) for run in series]) for d in among}
    driver = max(shares, key=shares.get)
    return driver, shares[driver]


def predicted_share(runs: Sequence[tuple[np.ndarray, np.ndarray]]) -> float:
    """Share of the squared errors that a variable predicts in runs from which this was not learned.

    runs: (functions of the variable (k, c), errors (k, d)) of each. Each is left out in turn; a single run is cut.
    """
    parts = [part for part in runs if len(part[0])]
    if len(parts) == 1:
        parts = list(zip(*(np.array_split(column, MOST_BLOCKS) for column in parts[0]), strict=True))
    if not parts:
        return 0.0
    scale = np.maximum(np.sqrt(np.mean(np.vstack([x for x, _ in parts]) ** 2, axis=0)), 1e-12)
    parts = [(x / scale, y) for x, y in parts]
    normals = [(x.T @ x, x.T @ y) for x, y in parts]
    total, products = sum(a for a, _ in normals), sum(b for _, b in normals)
    left = 0.0
    for (x, y), (own, product) in zip(parts, normals, strict=True):
        amounts = np.linalg.lstsq(total - own, products - product, rcond=1e-9)[0]
        left += np.sum((y - x @ amounts) ** 2)
    return 1.0 - float(left) / max(float(sum(np.sum(y**2) for _, y in parts)), 1e-300)
