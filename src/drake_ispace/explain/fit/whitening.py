"""The noise of residuals, per stream a vector autoregression with a long memory; it whitens the residuals."""

from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

from drake_ispace.blocks.kernels import kernel
from drake_ispace.explain.fit.memory import Memory
from drake_ispace.explain.predict.prediction import Residuals
from drake_ispace.explain.threads import each

_LEAST_ROWS = 100  # of a class of motion whose noise has a size of its own
#: Stream -> lags, in rows, and rates of exponential means, per tick or fix.
_MEMORY = {"motion": (8, (0.06, 0.02, 0.006)), "room": (4, (0.2, 0.05))}
#: Least standard deviations of the stream "start", of placing the robot together with one fix [m, m, rad].
_LEAST_START_STD = (0.006, 0.006, 0.026)


@dataclass(frozen=True)
class Noise:
    """A vector autoregression y_t = sum_k A_k p_k,t + e_t, e of covariance C C'.

    The regressors p_k are the last rows, and exponential means of the past, each slower than the one before. A few
    means reach as far back as hundreds of lags would. Forces on a robot have memories from a few ticks to seconds;
    where the noise model forgets too early, feedback makes what the controller did look like the cause of the forces.

    Attributes:
        lags: how many of the last rows.
        means: rates of the exponential means, per row.
        a: (p (lags + means), p) coefficients.
        unit: C^-1 (p, p).
        sizes: (classes, p) how much larger e is in each class of motion; infinite in class 0, at rest.
    """

    lags: int
    means: tuple[float, ...]
    a: np.ndarray
    unit: np.ndarray
    sizes: np.ndarray

    def rows(self, y: np.ndarray) -> int:
        """The number of rows of `y` (rows, p) once whitened."""
        return max(len(y) - self.lags, 0)

    def whiten(self, y: np.ndarray, classes: np.ndarray | None = None) -> np.ndarray:
        """(rows - lags, p) independent numbers of unit variance. Linear in `y` (rows, p): changes are whitened alike.

        y: or (k, rows, p), several at once. classes: (rows,) class of motion of each row; None: all rows are alike.
        """
        several = y if y.ndim == 3 else y[None]
        rows, p = self.rows(several[0]), y.shape[-1]
        out = np.empty((len(several), rows * p))
        for one, whitened in zip(several, out, strict=True):
            self.whiten_into(one, classes, whitened)
        return out.reshape(*y.shape[:-2], rows, p)

    def whiten_into(self, y: np.ndarray, classes: np.ndarray | None, out: np.ndarray) -> None:
        """Write what `whiten` gives of `y` (rows, p), one row after the other, into `out`."""
        if len(out):
            classes = np.zeros(len(y), int) if classes is None else classes
            a, rates = np.ascontiguousarray(self.a), np.array(self.means)
            whiten(np.ascontiguousarray(y), classes, a, 1.0 / self.sizes, self.unit, rates, out)

    def transposed(self, z: np.ndarray, classes: np.ndarray | None = None) -> np.ndarray:
        """(rows, p) the transpose of `whiten` times `z` (rows - lags, p): its products with any y are those of z with
        y whitened."""
        rows = len(z) + self.lags
        y = np.zeros((rows, z.shape[1]))
        if len(z):
            classes = np.zeros(rows, int) if classes is None else classes
            a, rates = np.ascontiguousarray(self.a.T), np.array(self.means)
            transpose(np.ascontiguousarray(z), classes, a, 1.0 / self.sizes, self.unit, rates, y)
        return y

    def log_volume(self, rows: int, classes: np.ndarray | None = None) -> float:
        """Twice the log of the volume that `whiten` makes 1, of `rows` rows: with the sum of squares of what it gives,
        -2 log of the density of all rows that are scored, but for a factor that depends on their number alone."""
        of_a_row = -2.0 * np.linalg.slogdet(self.unit)[1]
        if classes is None:
            return max(rows - self.lags, 0) * of_a_row
        scored = classes[self.lags :][classes[self.lags :] > 0]
        return len(scored) * of_a_row + 2.0 * float(np.sum(np.log(self.sizes[scored])))

    def past_of(self, y: np.ndarray, classes: np.ndarray | None = None) -> np.ndarray:
        """(rows - lags, p (lags + means)) regressors of `whiten`, each row over the size of the noise in it."""
        before = past(y, self.lags, self.means)
        if classes is None:
            return before
        return before / np.exp(np.mean(np.log(self.sizes), axis=1))[classes[self.lags :], None]


@kernel(nogil=True)
def whiten(y, classes, a, shrink, unit, rates, out):
    """Write `Noise.whiten` of residuals into `out`.

    y (rows, p), classes (rows,), a (p (lags + means), p), shrink (classes, p): 1 over the size of the noise, unit
    (p, p), rates (means,), out ((rows - lags) p,).
    """
    rows, p, count = y.shape[0], y.shape[1], rates.shape[0]
    lags = rows - out.shape[0] // p
    own, past, mean = np.empty((rows, p)), np.empty((rows, count * p)), np.zeros(count * p)
    of_lags, e = np.empty((lags * p, p)), np.empty((rows, p))
    # loops, because an assignment of slices takes ten seconds to compile
    for k in range(lags):  # the oldest row first, as in y
        for j in range(p):
            for i in range(p):
                of_lags[(lags - 1 - k) * p + j, i] = a[k * p + j, i]
    for t in range(rows):
        for i in range(p):
            own[t, i] = e[t, i] = y[t, i]  # y may be of single precision
        for m in range(count):
            for i in range(p):
                past[t, m * p + i] = mean[m * p + i]
                mean[m * p + i] += rates[m] * (own[t, i] - mean[m * p + i])
    if count:
        predicted = np.dot(past, a[lags * p :])
        for t in range(rows):
            for i in range(p):
                e[t, i] -= predicted[t, i]
    for first in range(lags):  # every lags-th row, whose last rows lie one after the other
        windows = (rows - 1 - first) // lags
        if windows > 0:
            predicted = np.dot(own[first : first + windows * lags].reshape(windows, lags * p), of_lags)
            for w in range(windows):
                for i in range(p):
                    e[first + (w + 1) * lags, i] -= predicted[w, i]
    for t in range(lags, rows):
        for i in range(p):
            e[t, i] *= shrink[classes[t], i]
    np.dot(e[lags:], unit.T, out.reshape(rows - lags, p))


@kernel(nogil=True)
def transpose(z, classes, a, shrink, unit, rates, y):
    """Write `Noise.transposed` into `y`.

    z (rows - lags, p), a (p, p (lags + means)), y (rows, p); others as of `whiten`.
    """
    rows, p, count = y.shape[0], y.shape[1], rates.shape[0]
    lags = rows - z.shape[0]
    e, later = np.zeros((rows, p)), np.zeros(count * p)
    np.dot(z, unit, e[lags:])
    for t in range(lags, rows):
        for i in range(p):
            e[t, i] *= shrink[classes[t], i]
    into_past = np.dot(e, a)
    for t in range(rows - 1, -1, -1):
        for i in range(p):
            y[t, i] = e[t, i]
        for k in range(min(lags, rows - 1 - t)):
            for i in range(p):
                y[t, i] -= into_past[t + 1 + k, k * p + i]
        for m in range(count):
            for i in range(p):
                y[t, i] -= rates[m] * later[m * p + i]
                later[m * p + i] = into_past[t, (lags + m) * p + i] + (1.0 - rates[m]) * later[m * p + i]


def past(y: np.ndarray, lags: int, means: Sequence[float]) -> np.ndarray:
    """(rows - lags, p (lags + means)) the last rows of `y` (rows, p), then exponential means of all rows before."""
    columns = [y[lags - k : len(y) - k] for k in range(1, lags + 1)]
    for rate in means:
        mean = lfilter([0.0, rate], [1.0, rate - 1.0], y, axis=0)
        columns.append(mean[lags:])
    return np.hstack(columns)


def is_bounded(stream: str) -> bool:
    """Whether the noise of a stream has a least size that is known: rows are independent then."""
    return stream in ("start", "looks")


def fit_noise(
    runs: Sequence[np.ndarray], stream: str, classes: Sequence[np.ndarray | None],
    spent: int = 0, ticks: int = 1, errors: Sequence[Sequence[np.ndarray]] = (),
) -> Noise:
    """Fit the noise of a stream by least squares over all runs.

    Args:
        runs: (rows, p) residuals of each run. stream: its name.
        classes: (rows,) class of motion of each row, per run; None: all rows are alike.
        spent: degrees of freedom of fits that the residuals have gone through before.
        ticks: from row to row of the motion.
        errors: of what these fits took away, each as `runs`. What their products add up to counts as noise, too.
    """
    p = runs[0].shape[1]
    equal, none = np.ones((1, p)), np.empty((0, p))
    if is_bounded(stream):
        rows = np.vstack([run for run in runs if len(run)] or [none])
        spread = rows.std(axis=0, ddof=1) if len(rows) > 2 else np.zeros(p)
        least = _LEAST_START_STD[:p] if stream == "start" else len(rows) ** -0.5  # as if one of the captures was missed
        return Noise(0, (), none, np.diag(1.0 / np.maximum(spread, least)), equal)
    lags, means = _MEMORY[stream]
    if stream == "motion" and ticks > 1:
        means = tuple(1.0 - (1.0 - rate) ** ticks for rate in means)
    longest = max(len(run) for run in runs)
    if longest < 12 * p * (lags + len(means)):
        lags, means = (1, ()) if longest > 12 * p else (0, ())
    every, times = [run for some in (runs, *errors) for run in some], 1 + len(errors)
    a, e = none, np.vstack([run[lags:] for run in every])
    sizes, scored = equal, np.ones(len(e), bool)
    if classes[0] is not None:
        class_of = np.concatenate([c[lags:] for c in times * list(classes)])
        scored = class_of > 0
    if lags:
        before = np.vstack([past(run, lags, means) for run in every if len(run) > lags])
        learned = scored if scored.sum() >= 0.1 * len(scored) else slice(None)
        a = np.linalg.lstsq(before[learned], e[learned], rcond=None)[0]
        e = e - before @ a
    if classes[0] is not None:
        sizes = _sizes(e, class_of, times * _LEAST_ROWS)
        e = e / sizes[class_of]
    rows = scored.sum() / times
    freedom = max(rows - len(a) - spent / p, 0.5 * rows, 1.0)
    covariance = e[scored].T @ e[scored] / freedom
    floor = 1e-12 * np.trace(covariance) / p + 1e-30
    return Noise(lags, means, a, np.linalg.inv(np.linalg.cholesky(covariance + floor * np.eye(p))), sizes)


def _sizes(e, classes, least):
    """(classes, p) root mean square of e in each class over that of all scored rows; 1 for classes of `least` rows."""
    scored = e[classes > 0]  # none in a run at rest
    overall = np.sqrt(np.sum(scored**2, axis=0) / max(len(scored), 1)) + 1e-30
    sizes = np.ones((int(classes.max()) + 1, e.shape[1]))
    sizes[0] = np.inf
    for c in range(1, len(sizes)):
        own = e[classes == c]
        if len(own) > least:
            sizes[c] = np.maximum(np.sqrt(np.mean(own**2, axis=0)) / overall, 0.1)
    return sizes


def _orthonormal(columns):
    """(n, q) orthonormal basis of the space of `columns`, without directions that nearly vanish."""
    values, vectors = np.linalg.eigh(columns.T @ columns)
    kept = values > 1e-10 * values[-1]
    return columns @ (vectors[:, kept] / np.sqrt(values[kept]))


class Whitening:
    """The noise of every stream, by which residuals of all runs become one long vector of independent numbers.

    Args:
        residuals: that the noise is fitted to.
        classes: per run, stream -> (rows,) class of motion; streams that are missing have none.
        spent: degrees of freedom of fits that the residuals have gone through before.
        ticks: from row to row of the motion.
        errors: of what these fits took away, each as `residuals`; as in `fit_noise`.

    Attributes:
        classes: as given. noise: stream -> its Noise.
    """

    def __init__(
        self, residuals: Residuals, classes: Sequence[dict[str, np.ndarray]], spent: int = 0, ticks: int = 1,
        errors: Sequence[Residuals] = (),
    ):
        self.classes = list(classes)
        self.noise = {}
        for name in residuals[0]:
            if residuals[0][name].shape[1] and any(len(run[name]) for run in residuals):
                own, *of_errors = ([run[name] for run in runs] for runs in (residuals, *errors))
                self.noise[name] = fit_noise(own, name, [c.get(name) for c in classes], spent, ticks, of_errors)

    def __call__(self, residuals: Residuals) -> np.ndarray:
        """(n,) the whitened residuals of all runs, one run after the other."""
        return np.concatenate(each(self.one, range(len(residuals)), residuals))

    def plain(self, residuals: Residuals) -> np.ndarray:
        """(n,) the numbers of the long vector before whitening, NaN where they are not scored."""
        parts = []
        for i, run in enumerate(residuals):
            for name, noise in self.noise.items():
                rows, classes = run[name][noise.lags :].copy(), self.classes[i].get(name)
                if classes is not None:
                    rows[classes[noise.lags :] == 0] = np.nan
                parts.append(rows.ravel())
        return np.concatenate(parts)

    def one(self, i: int, run: dict[str, np.ndarray]) -> np.ndarray:
        """(n_i,) the whitened residuals of run `i`, one stream after the other."""
        return self.several(i, [run])[0]

    def several(
        self, i: int, runs: Sequence[dict[str, np.ndarray]], out: np.ndarray | None = None
    ) -> np.ndarray:
        """(k, n_i) the same of several residuals of run `i`, in `out` or in a new array."""
        sizes = [noise.rows(runs[0][name]) * runs[0][name].shape[1] for name, noise in self.noise.items()]
        ends = np.cumsum([0, *sizes])
        out = np.empty((len(runs), ends[-1])) if out is None else out
        for run, whitened in zip(runs, out, strict=True):
            for (name, noise), start, end in zip(self.noise.items(), ends[:-1], ends[1:], strict=True):
                noise.whiten_into(run[name], self.classes[i].get(name), whitened[start:end])
        return out

    def transposed(self, w: np.ndarray, residuals: Residuals) -> Residuals:
        """The transpose of the whitening times `w` (n,); residuals: of all runs, only their sizes are used."""
        found, at = [], 0
        for run, classes in zip(residuals, self.classes, strict=True):
            found.append({})
            for name, noise in self.noise.items():
                rows, p = noise.rows(run[name]), run[name].shape[1]
                z = w[at : at + rows * p].reshape(rows, p)
                found[-1][name] = noise.transposed(z, classes.get(name)) if rows else np.zeros(run[name].shape)
                at += rows * p
        return found

    def scoring_as(self, other: "Whitening") -> "Whitening":
        """The Whitening that does not score what `other` does not score either."""
        scoring = copy(self)
        scoring.classes = [
            {name: np.where(theirs[name] > 0, own[name], 0) for name in own}
            for own, theirs in zip(self.classes, other.classes, strict=True)
        ]
        return scoring

    def log_volume(self, residuals: Residuals) -> float:
        """What is missing in the sum of squares of whitened residuals to -2 log likelihood, but for a number that is
        the same under every noise; residuals: only their sizes are used."""
        return sum(
            noise.log_volume(len(run[name]), classes.get(name))
            for run, classes in zip(residuals, self.classes, strict=True) for name, noise in self.noise.items()
        )

    def memory(self, residuals: Residuals) -> list[Memory]:
        """The Memory of each stream whose noise has one: what slightly different coefficients could explain."""
        places, pasts, at = {}, {}, 0
        for i, run in enumerate(residuals):
            for name, noise in self.noise.items():
                rows, p = noise.rows(run[name]), run[name].shape[1]
                if rows and len(noise.a):
                    places.setdefault(name, []).append((at, at + rows * p))
                    pasts.setdefault(name, []).append(noise.past_of(run[name], self.classes[i].get(name)))
                at += rows * p
        memories = []
        for name in places:
            ends = np.cumsum([len(part) for part in pasts[name]])
            bases = np.split(_orthonormal(np.vstack(pasts[name])), ends[:-1])
            memories.append(Memory(residuals[0][name].shape[1], places[name], bases))
        return memories

    def of_stream(self, residuals: Residuals, name: str) -> np.ndarray:
        """(n,) which numbers of the long vector are those of a stream."""
        return np.concatenate([
            np.full(noise.rows(run[stream]) * run[stream].shape[1], stream == name)
            for run in residuals for stream, noise in self.noise.items()
        ])

    def starts(self, residuals: Residuals) -> np.ndarray:
        """(runs + 1,) where each run begins in the long vector, and its length."""
        sizes = [sum(n.rows(run[name]) * run[name].shape[1] for name, n in self.noise.items()) for run in residuals]
        return np.cumsum([0, *sizes])

    def late(self, residuals: Residuals) -> np.ndarray:
        """(n,) whether each number of the long vector belongs to the second half of its run."""
        rows = [(noise.rows(run[name]), run[name].shape[1]) for run in residuals for name, noise in self.noise.items()]
        return np.concatenate([np.repeat(2 * np.arange(n) >= n, p) for n, p in rows])

    def instants(self, residuals: Residuals, together: Mapping[str, int] | None = None) -> np.ndarray:
        """(n,) the instant of each number of the long vector, counted upwards over all runs and streams.

        together: stream -> number of successive rows that count as one instant.
        """
        parts, start = [], 0
        for run in residuals:
            for name, noise in self.noise.items():
                rows, p = noise.rows(run[name]), run[name].shape[1]
                number = np.arange(rows) // (together or {}).get(name, 1)
                parts.append(start + np.repeat(number, p))
                start += int(number[-1]) + 1 if rows else 0
        return np.concatenate(parts)
