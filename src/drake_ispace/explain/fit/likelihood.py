"""Misfit of any effects to the runs: whitened residuals, the runs' own offsets fitted under their priors.

The noise's coefficients are estimates too, found while an effect was missing or of another size. Where a controller
reacts to noise, an effect of its command looks much like a noise that remembers; so near the best point what other
coefficients could explain is taken from residuals and signatures alike, which makes of a fit what a joint fit of both
would give. Far from it the residuals' past is mostly the effect itself, and this would hide it.
"""

from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field

import numpy as np

from drake_ispace.explain.fit.candidates import Candidate
from drake_ispace.explain.fit.directions import Directions
from drake_ispace.explain.fit.memory import Memory, gram
from drake_ispace.explain.fit.whitening import Whitening
from drake_ispace.explain.predict.prediction import Prediction, Residuals

Point = dict[Candidate, list[float]]  # effects and their coordinates
_STEP = 0.05  # of a probe, for slopes
_HALVINGS = 6


def merged(point: Mapping[Candidate, Sequence[float]]) -> dict[str, dict[str, float]]:
    """The point as values by effect."""
    return {candidate.name: candidate.values(z) for candidate, z in point.items()}


@dataclass
class Likelihood:
    """Minus twice the log likelihood of the runs, but for a constant, as a sum of squares.

    Attributes:
        prediction: model and runs. whitening: of their noise. offsets: nuisance directions, whitened, each
            one prior standard deviation long. memory: of the noise, see Whitening.memory.
        sizes: candidate -> a natural size of each of its coordinates.
    """

    prediction: Prediction
    whitening: Whitening
    offsets: Directions
    sizes: Mapping[Candidate, Sequence[float]]
    pool: ThreadPoolExecutor | None = None
    memory: Sequence[Memory] = ()
    _inner: np.ndarray = field(init=False, repr=False)

    def __post_init__(self):
        self._inner = np.linalg.inv(gram(self.memory, self.offsets) + np.eye(len(self.offsets)))

    def raw(self, point: Point) -> Residuals:
        return self.prediction.residuals(merged(point), self.pool)

    def whitened(self, point: Point) -> np.ndarray:
        return self.whitening(self.raw(point))

    def marginalised(self, vectors: np.ndarray) -> np.ndarray:
        """What neither the noise's memory nor offsets can explain of (rows,) or (k, rows): M (I - N (N'MN + 1)^-1 N' M)
        with M what memory leaves and N the offsets."""
        left = np.array(vectors, ndmin=2)
        self._forget(left)
        left -= self.offsets.combined(self.offsets.dot(left) @ self._inner)
        self._forget(left)
        return left.reshape(vectors.shape)

    def offsets_in(self, w: np.ndarray) -> np.ndarray:
        """(q,) the best amount of every offset in whitened residuals, in prior standard deviations."""
        left = w[None].copy()
        self._forget(left)
        return self.offsets.dot(left[0]) @ self._inner

    def _forget(self, vectors):
        for memory in self.memory:
            memory.take(vectors)

    def deviance(self, w: np.ndarray) -> float:
        """Sum of squares of whitened residuals with the best offsets, priors included."""
        return float(self.parts(w).sum())

    def parts(self, w: np.ndarray) -> np.ndarray:
        """(rows,) what each row adds to the deviance."""
        return w * self.marginalised(w)

    def slopes(self, point: Point, moved: Sequence[tuple[Candidate, int]], w: np.ndarray) -> np.ndarray:
        """(len(moved), rows) change of the whitened residuals per natural size of a coordinate."""
        found = []
        for candidate, i in moved:
            low, high = candidate.bounds[i]
            z, size = point[candidate][i], self.sizes[candidate][i]
            step = _STEP * max(abs(z - candidate.neutral[i]), size)
            if z + step > high:
                step = -step
            if z + step < low:
                step = high - z or low - z
            for to in (step, -step):  # backwards where the model runs away
                z_new = [*point[candidate][:i], z + to, *point[candidate][i + 1 :]]
                change = (self.whitened({**point, candidate: z_new}) - w) * (size / to)
                if np.isfinite(change).all():
                    break
            found.append(np.nan_to_num(change, nan=0.0, posinf=0.0, neginf=0.0))
        return np.stack(found) if found else np.empty((0, len(w)))


@dataclass(frozen=True)
class Fit:
    """The best point found, its deviance, and the covariance of its coordinates in natural sizes.

    order: which coordinate each row of `covariance` is.
    """

    point: Point
    deviance: float
    covariance: np.ndarray
    order: list[tuple[Candidate, int]]
    w: np.ndarray = field(repr=False)

    def std(self, candidate: Candidate, i: int, sizes) -> float:
        """Standard deviation of a coordinate."""
        at = self.order.index((candidate, i))
        return float(np.sqrt(max(self.covariance[at, at], 0.0)) * sizes[candidate][i])


def fit(
    likelihood: Likelihood, start: Point, iterations: int = 12, tolerance: float = 0.02,
    held: tuple[Candidate, int] | None = None,
) -> Fit:
    """Levenberg and Marquardt from `start`, within bounds, until the deviance falls by less than `tolerance`; held: a
    coordinate that stays."""
    point = {candidate: list(z) for candidate, z in start.items()}
    order = [(c, i) for c in point for i in range(len(c.parameters)) if (c, i) != held]
    w = likelihood.whitened(point)
    for _ in range(_HALVINGS):  # a start at which the model runs away
        if np.isfinite(w).all() or held is not None:
            break
        point = {c: [n + 0.5 * (a - n) for a, n in zip(z, c.neutral, strict=True)] for c, z in point.items()}
        w = likelihood.whitened(point)
    deviance, damping = likelihood.deviance(w), 1e-3
    if not order:
        return Fit(point, deviance, np.empty((0, 0)), order, w)
    for _ in range(iterations):
        slopes = likelihood.slopes(point, order, w)
        marginalised = likelihood.marginalised(slopes)
        normal, gradient = slopes @ marginalised.T, marginalised @ w
        free = _free(point, order, gradient)
        gained = 0.0
        for _ in range(6):
            step = np.zeros(len(order))
            damped = normal + damping * np.diag(np.diag(normal) + 1e-12)
            step[free] = -np.linalg.lstsq(damped[np.ix_(free, free)], gradient[free], rcond=None)[0]
            moved = _moved(likelihood, point, order, step)
            w_new = likelihood.whitened(moved)
            new = likelihood.deviance(w_new) if np.isfinite(w_new).all() else np.inf
            if new < deviance:
                gained, point, w, deviance, damping = deviance - new, moved, w_new, new, max(damping / 5.0, 1e-7)
                break
            damping *= 8.0
        if gained < tolerance:
            break
    slopes = likelihood.slopes(point, order, w)
    normal = slopes @ likelihood.marginalised(slopes).T
    return Fit(point, deviance, np.linalg.pinv(normal, rcond=1e-10), order, w)


def _free(point, order, gradient):
    """Coordinates that do not sit on a bound from which the gradient pushes outwards."""
    free = []
    for at, (candidate, i) in enumerate(order):
        low, high = candidate.bounds[i]
        z = point[candidate][i]
        if not ((z <= low and gradient[at] > 0.0) or (z >= high and gradient[at] < 0.0)):
            free.append(at)
    return free


def _moved(likelihood, point, order, step):
    moved = {candidate: list(z) for candidate, z in point.items()}
    for (candidate, i), change in zip(order, step, strict=True):
        low, high = candidate.bounds[i]
        moved[candidate][i] = min(max(moved[candidate][i] + change * likelihood.sizes[candidate][i], low), high)
    return moved
