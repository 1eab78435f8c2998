"""How much of an error a measured variable predicts, in runs from which this was not learned."""

from collections.abc import Sequence

import numpy as np

from drake_ispace.explain.prove.errors.free_run import Measure, rms, seconds_of
from drake_ispace.explain.prove.errors.left_out import MOST_BLOCKS
from drake_ispace.explain.prove.left.remainder import Remainder, Series, going_with

PREDICTED = 0.2  # share of the squared error that a variable may predict in runs from which this was not learned


def predicted(
    m: Measure, runs: Sequence[tuple[str, Series]], least: float, among: Sequence[str] | None = None
) -> Remainder | None:
    """The variable that predicts most of an error in runs from which this was not learned.

    None where it is a small part of the error, or smaller than `least`, such as the usual error of a sound robot:
    pixels and counts repeat themselves with the place.

    runs: name and errors of each. among: the variables; None: all.
    """
    series = [run for _, run in runs]
    if len(series) == 1 and np.ptp(series[0].t) < (MOST_BLOCKS - 1) * seconds_of(m.horizon):
        return None  # each fold must have a window to itself
    shares = {d: predicted_share([(run.drivers[d], run.errors) for run in series]) for d in among or series[0].drivers}
    driver = max(shares, key=shares.get)
    share = shares[driver]
    size = rms([run.errors for run in series]) * float(np.sqrt(max(share, 0.0)))
    if share < PREDICTED or size < least:
        return None
    because = f"{100 * share:.0f} % of the squared error over {m.horizon} goes with {driver}"
    return going_with(m, runs, driver, size, share / PREDICTED, because)


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
