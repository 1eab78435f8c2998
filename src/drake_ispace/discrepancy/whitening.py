"""Noise of residuals: a vector autoregression per stream, by which residuals become independent and of unit size."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from drake_ispace.discrepancy.predict import Residuals

_FEW = 100
_ORDERS = {"motion": 10, "room": 6, "start": 0, "looks": 0}
_START_STD = np.array([0.006, 0.006, 0.026])  # of placing the robot and of one fix [m, m, rad]
_SEEN_STD = 0.02  # of the share of missed captures, where the scenario has none


@dataclass(frozen=True)
class Noise:
    """y_t = sum_k A_k y_t-k + e_t with e of covariance C C'.

    Attributes:
        lags: (order, p, p); root: C (p, p), lower; sizes: (classes, p), how much larger e is in each class of motion.
    """

    lags: np.ndarray
    root: np.ndarray
    sizes: np.ndarray

    def whiten(self, y: np.ndarray, classes: np.ndarray | None = None) -> np.ndarray:
        """(rows - order, p) independent numbers of unit variance; also of a signature, as it is linear."""
        order = len(self.lags)
        if len(y) <= order:
            return np.empty((0, y.shape[1]))
        e = y[order:].copy()
        for k, lag in enumerate(self.lags, 1):
            e -= y[order - k : len(y) - k] @ lag.T
        if classes is not None:
            e /= self.sizes[classes[order:]]
        return np.linalg.solve(self.root, e.T).T


def fit_noise(runs: Sequence[np.ndarray], stream: str, classes: Sequence[np.ndarray | None], spent: int = 0) -> Noise:
    """Least squares over all runs of a stream, `spent` degrees of freedom having gone into the residuals before."""
    p = runs[0].shape[1]
    one = np.ones((1, p))
    if stream == "start":
        rows = np.vstack([run for run in runs if len(run)] or [np.zeros((0, p))])
        spread = rows.std(axis=0, ddof=1) if len(rows) > 2 else np.zeros(p)
        return Noise(np.zeros((0, p, p)), np.diag(np.maximum(spread, _START_STD[:p])), one)
    if stream == "looks":
        rows = np.vstack([run for run in runs if len(run)] or [np.zeros((0, p))])
        spread = rows.std(axis=0) if len(rows) else np.zeros(p)
        return Noise(np.zeros((0, p, p)), np.diag(np.maximum(spread, _SEEN_STD)), one)
    longest = max(len(run) for run in runs)
    order = min(_ORDERS[stream], max((longest - 20) // (4 * p), 0))
    now, past = [], []
    for run in runs:
        if len(run) > order:
            now.append(run[order:])
            past.append(np.hstack([run[order - k : len(run) - k] for k in range(1, order + 1)] or [run[:, :0]]))
    now, past = np.vstack(now), np.vstack(past)
    lags = np.zeros((order, p, p))
    if order:
        solution = np.linalg.lstsq(past, now, rcond=None)[0]
        lags = solution.T.reshape(p, order, p).transpose(1, 0, 2)
        now = now - past @ solution
    sizes = one
    if classes[0] is not None:
        of = np.concatenate([c[order:] for c, run in zip(classes, runs, strict=True) if len(run) > order])
        sizes = _sizes(now, of)
        now = now / sizes[of]
    freedom = max(len(now) - order * p - spent / p, 0.5 * len(now), 1.0)
    covariance = now.T @ now / freedom
    floor = 1e-12 * np.trace(covariance) / p + 1e-30
    return Noise(lags, np.linalg.cholesky(covariance + floor * np.eye(p)), sizes)


def _sizes(e, classes):
    """(classes, p) root mean square of e in each class over that of all; classes with few rows count as all."""
    whole = np.sqrt(np.mean(e**2, axis=0)) + 1e-30
    sizes = np.ones((int(classes.max()) + 1, e.shape[1]))
    for c in range(len(sizes)):
        own = e[classes == c]
        if len(own) > _FEW:
            sizes[c] = np.maximum(np.sqrt(np.mean(own**2, axis=0)) / whole, 0.1)
    return sizes


class Whitening:
    """The noise of every stream, and residuals of all runs as one long vector."""

    def __init__(self, residuals: Residuals, classes: Sequence[dict[str, np.ndarray]], spent: int = 0):
        self.classes = list(classes)
        self.noise = {
            name: fit_noise([run[name] for run in residuals], name, [c.get(name) for c in classes], spent)
            for name in residuals[0] if residuals[0][name].shape[1] and any(len(run[name]) for run in residuals)
        }

    def __call__(self, residuals: Residuals) -> np.ndarray:
        return np.concatenate([
            noise.whiten(run[name], classes.get(name)).ravel()
            for run, classes in zip(residuals, self.classes, strict=True) for name, noise in self.noise.items()
        ])

    def instants(self, residuals: Residuals) -> np.ndarray:
        """(rows,) for each number of the long vector, which instant of which run and stream it belongs to."""
        found, start = [], 0
        for run in residuals:
            for name, noise in self.noise.items():
                rows, p = max(len(run[name]) - len(noise.lags), 0), run[name].shape[1]
                found.append(start + np.repeat(np.arange(rows), p))
                start += rows
        return np.concatenate(found)
