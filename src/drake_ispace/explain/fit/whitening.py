"""Noise of residuals: per stream a vector autoregression with a long memory, by which they become independent."""

import itertools
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

from drake_ispace.explain.fit.directions import Directions
from drake_ispace.explain.fit.memory import Memory
from drake_ispace.explain.predict.prediction import RESTING, Residuals

_FEW = 100
_MEMORY = {"motion": (8, (0.06, 0.02, 0.006)), "room": (4, (0.2, 0.05))}  # lags, rates of exponential means, per row
#: Least standard deviations where every row stands alone: of placing the robot together with one fix [m, m, rad], and
#: of the share of missed captures.
_SINGLE = {"start": np.array([0.006, 0.006, 0.026]), "looks": np.array([0.02])}


@dataclass(frozen=True)
class Noise:
    """y_t = sum_k A_k p_k,t + e_t with e of covariance C C', p_k the last rows and slower and slower means of the past.

    A few means reach as far back as hundreds of lags would: forces on a robot have memories from a few ticks to
    seconds, and where the noise model forgets too early, feedback makes what the controller did look like its cause.

    Attributes:
        lags: how many of the last rows. means: rates of the exponential means, per row. a: (p (lags + means), p).
        unit: C^-1 (p, p). sizes: (classes, p), how much larger e is in each class of motion, infinite in those
            that are not scored.
    """

    lags: int
    means: tuple[float, ...]
    a: np.ndarray
    unit: np.ndarray
    sizes: np.ndarray

    def rows(self, y: np.ndarray) -> int:
        """How many rows are left of `y` once whitened."""
        return max(len(y) - self.lags, 0)

    def whiten(self, y: np.ndarray, classes: np.ndarray | None = None) -> np.ndarray:
        """(rows - lags, p) independent numbers of unit variance; also of a signature, as it is linear."""
        if len(y) <= self.lags:
            return np.empty((0, y.shape[1]))
        e = y[self.lags :] - past(y, self.lags, self.means) @ self.a if len(self.a) else y.copy()
        if classes is not None:
            e = e / self.sizes[classes[self.lags :]]
        return e @ self.unit.T

    def past_of(self, y: np.ndarray, classes: np.ndarray | None = None) -> np.ndarray:
        """(rows - lags, p (lags + means)) what `whiten` predicts each row from, over the noise's size there."""
        before = past(y, self.lags, self.means)
        if classes is None:
            return before
        return before / np.exp(np.mean(np.log(self.sizes), axis=1))[classes[self.lags :], None]


def past(y: np.ndarray, lags: int, means: Sequence[float]) -> np.ndarray:
    """(rows - lags, p (lags + means)) the last rows, and exponential means of all rows before."""
    columns = [y[lags - k : len(y) - k] for k in range(1, lags + 1)]
    for rate in means:
        mean = lfilter([0.0, rate], [1.0, rate - 1.0], y, axis=0)
        columns.append(mean[lags:])
    return np.hstack(columns)


def fit_noise(
    runs: Sequence[np.ndarray], stream: str, classes: Sequence[np.ndarray | None], spent: int = 0
) -> Noise:
    """Least squares over all runs of a stream, `spent` degrees of freedom having gone into the residuals before."""
    p = runs[0].shape[1]
    one, none = np.ones((1, p)), np.empty((0, p))
    if stream in _SINGLE:
        rows = np.vstack([run for run in runs if len(run)] or [none])
        spread = rows.std(axis=0, ddof=1) if len(rows) > 2 else np.zeros(p)
        return Noise(0, (), none, np.diag(1.0 / np.maximum(spread, _SINGLE[stream][:p])), one)
    lags, means = _MEMORY[stream]
    longest = max(len(run) for run in runs)
    if longest < 12 * p * (lags + len(means)):
        lags, means = (1, ()) if longest > 12 * p else (0, ())
    a, whole = none, np.vstack([run[lags:] for run in runs])
    sizes, scored = one, np.ones(len(whole), bool)
    if classes[0] is not None:
        of = np.concatenate([c[lags:] for c in classes])
        scored = of >= RESTING
        if scored.sum() < 0.1 * len(scored):
            scored[:] = True
    if lags:
        before = np.vstack([past(run, lags, means) for run in runs if len(run) > lags])
        a = np.linalg.lstsq(before[scored], whole[scored], rcond=None)[0]
        whole = whole - before @ a
    if classes[0] is not None:
        sizes = _sizes(whole, of)
        whole = whole / sizes[of]
    freedom = max(scored.sum() - len(a) - spent / p, 0.5 * scored.sum(), 1.0)
    covariance = whole[scored].T @ whole[scored] / freedom
    floor = 1e-12 * np.trace(covariance) / p + 1e-30
    return Noise(lags, means, a, np.linalg.inv(np.linalg.cholesky(covariance + floor * np.eye(p))), sizes)


def _sizes(e, classes):
    """(classes, p) root mean square of e in each class over that of all; classes with few rows count as all."""
    whole = np.sqrt(np.mean(e[classes >= RESTING] ** 2, axis=0)) + 1e-30
    sizes = np.ones((max(int(classes.max()) + 1, RESTING), e.shape[1]))
    sizes[:RESTING] = np.inf
    for c in range(RESTING, len(sizes)):
        own = e[classes == c]
        if len(own) > _FEW:
            sizes[c] = np.maximum(np.sqrt(np.mean(own**2, axis=0)) / whole, 0.1)
    return sizes


def _orthonormal(columns):
    """(n, q) of the space of `columns`, directions that nearly vanish left out."""
    values, vectors = np.linalg.eigh(columns.T @ columns)
    kept = values > 1e-10 * values[-1]
    return columns @ (vectors[:, kept] / np.sqrt(values[kept]))


class Whitening:
    """The noise of every stream, and residuals of all runs as one long vector."""

    def __init__(self, residuals: Residuals, classes: Sequence[dict[str, np.ndarray]], spent: int = 0):
        self.classes = list(classes)
        self.noise = {
            name: fit_noise([run[name] for run in residuals], name, [c.get(name) for c in classes], spent)
            for name in residuals[0] if residuals[0][name].shape[1] and any(len(run[name]) for run in residuals)
        }

    def __call__(self, residuals: Residuals) -> np.ndarray:
        return np.concatenate([self.one(i, run) for i, run in enumerate(residuals)])

    def plain(self, residuals: Residuals) -> np.ndarray:
        """The numbers of the long vector as they were, NaN where they are not scored."""
        found = []
        for i, run in enumerate(residuals):
            for name, noise in self.noise.items():
                rows, classes = run[name][noise.lags :].copy(), self.classes[i].get(name)
                if classes is not None:
                    rows[classes[noise.lags :] < RESTING] = np.nan
                found.append(rows.ravel())
        return np.concatenate(found)

    def one(self, i: int, run: dict[str, np.ndarray]) -> np.ndarray:
        """Of run `i` alone."""
        return np.concatenate([
            noise.whiten(run[name], self.classes[i].get(name)).ravel() for name, noise in self.noise.items()
        ])

    def directions(
        self, residuals: Residuals, changes: Sequence[Residuals],
        offsets: Sequence[tuple[int, dict[str, np.ndarray]]] = (), pool: ThreadPoolExecutor | None = None,
    ) -> Directions:
        """Changes of all residuals, and offsets (run, change of its own) with the runs in order, whitened."""
        starts = self.starts(residuals)
        everywhere = np.empty((len(changes), starts[-1]))
        for row, whitened in zip(everywhere, (pool.map if pool else map)(self, changes), strict=True):
            row[:] = whitened
        grouped = [(i, [change for _, change in group]) for i, group in itertools.groupby(offsets, lambda o: o[0])]
        parts = (pool.map if pool else map)(lambda group: np.stack([self.one(group[0], c) for c in group[1]]), grouped)
        return Directions(everywhere, [(starts[i], part) for (i, _), part in zip(grouped, parts, strict=True)])

    def memory(self, residuals: Residuals) -> list[Memory]:
        """What the past of each stream that remembers could do to any of its channels, were the noise's own
        coefficients a little different."""
        places, pasts, at = {}, {}, 0
        for i, run in enumerate(residuals):
            for name, noise in self.noise.items():
                rows, p = noise.rows(run[name]), run[name].shape[1]
                if rows and len(noise.a):
                    places.setdefault(name, []).append((at, at + rows * p))
                    pasts.setdefault(name, []).append(noise.past_of(run[name], self.classes[i].get(name)))
                at += rows * p
        found = []
        for name in places:
            ends = np.cumsum([len(part) for part in pasts[name]])
            bases = np.split(_orthonormal(np.vstack(pasts[name])), ends[:-1])
            found.append(Memory(residuals[0][name].shape[1], places[name], bases))
        return found

    def starts(self, residuals: Residuals) -> np.ndarray:
        """(runs + 1,) where each run begins in the long vector, and its length."""
        sizes = [sum(n.rows(run[name]) * run[name].shape[1] for name, n in self.noise.items()) for run in residuals]
        return np.cumsum([0, *sizes])

    def instants(self, residuals: Residuals, together: Mapping[str, int] | None = None) -> np.ndarray:
        """(rows,) for each number of the long vector, which instant of which run and stream it belongs to, ascending.

        together: stream -> so many rows one after the other count as one.
        """
        found, start = [], 0
        for run in residuals:
            for name, noise in self.noise.items():
                rows, p = noise.rows(run[name]), run[name].shape[1]
                number = np.arange(rows) // (together or {}).get(name, 1)
                found.append(start + np.repeat(number, p))
                start += int(number[-1]) + 1 if rows else 0
        return np.concatenate(found)
