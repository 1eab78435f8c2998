"""The likelihood of any effects: whitened residuals, with the runs' offsets as nuisance parameters under priors.

The coefficients of the noise model are estimates too, made while an effect was missing or of another size. Where a
controller reacts to noise, an effect on its command looks much like noise with a memory. Near the best point, what
other coefficients could explain is therefore removed from residuals and signatures alike; a fit then gives what a joint
fit of effects and coefficients would. Far from the best point the past of the residuals is mostly the effect itself,
which the removal would hide.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from drake_ispace.explain.fit.candidates import Candidate
from drake_ispace.explain.fit.directions import inverse_of
from drake_ispace.explain.fit.memory import Memory, alike
from drake_ispace.explain.fit.offsets import Offsets
from drake_ispace.explain.fit.whitening import Whitening
from drake_ispace.explain.predict.prediction import Prediction, Residuals
from drake_ispace.explain.threads import each

Point = dict[Candidate, list[float]]  # effects and their coordinates
STEP = 0.05  # for slopes, as a share of a coordinate's distance from neutral, or of its natural size if larger
_LEVEL = 1e-10  # share of the largest curvature of the deviance, below which it is level
_SHORTENINGS = 6  # of a step that leads to a worse point, or of a start at which the model runs away
TIMES = (1.0, 3.0, 10.0, 30.0)  # how many times as narrow as its natural size a limit is tried


def merged(point: Mapping[Candidate, Sequence[float]]) -> dict[str, dict[str, float]]:
    """Effect -> parameter -> value at the point."""
    return {candidate.name: candidate.values(z) for candidate, z in point.items()}


@dataclass
class Likelihood:
    """The deviance of the runs, -2 log likelihood up to a constant, as a sum of squares.

    rows is the length of the whitened residuals of all runs, q the number of offsets.

    Attributes:
        prediction: the model and the runs.
        whitening: the noise model of the residuals.
        offsets: whitened changes of the residuals by nuisance parameters, one prior standard deviation each but for the
            last ones, which may have any size.
        sizes: candidate -> a natural size of each of its coordinates.
        memory: of the noise model, to be removed; empty: it is not removed.
        free: how many of the offsets these are.
        inner: (q, q) inverse of the products of the offsets, memory removed, plus 1 for the prior of each that has one.
        log_determinant: of the same before it is inverted, where all offsets have a prior.
        remembered: of each memory, the amounts of its basis in the offsets.
    """

    prediction: Prediction
    whitening: Whitening
    offsets: Offsets
    sizes: Mapping[Candidate, Sequence[float]]
    memory: Sequence[Memory] = ()
    free: int = 0
    inner: np.ndarray = field(init=False, repr=False)
    log_determinant: float = field(init=False, repr=False)
    remembered: list[np.ndarray] = field(init=False, repr=False)

    def __post_init__(self):
        gram, self.remembered = self.offsets.gram_and_amounts(self.memory)
        prior = (np.arange(len(gram)) < len(gram) - self.free).astype(float)
        products = gram - sum(alike(amounts, amounts) for amounts in self.remembered) + np.diag(prior)
        self.inner = inverse_of(products, squares=np.diag(gram) + prior)
        self.log_determinant = float(np.linalg.slogdet(products)[1])

    def freed(self, changes: np.ndarray) -> "Likelihood":
        """The Likelihood with further offsets, of any size: whitened changes (k, rows) of the residuals."""
        return replace(self, offsets=self.offsets.with_freed(changes), free=self.free + len(changes))

    def raw(self, point: Point) -> Residuals:
        """The residuals at `point`, not whitened."""
        return self.prediction.residuals(merged(point))

    def whitened(self, point: Point) -> np.ndarray:
        """(rows,) the whitened residuals at `point`."""
        return self.whitening(self.raw(point))

    def marginalised(self, vectors: np.ndarray) -> np.ndarray:
        """The part of (rows,) or (k, rows) vectors that neither the noise's memory nor the offsets can explain.

        It is (M - M N (N'MN + P)^-1 N' M) times each, M being the projection that removes the memory, N the offsets, P
        1 for each of them that has a prior.
        """
        remainder = np.array(vectors, ndmin=2)
        remembered, products = self._seen(remainder)
        used = products @ self.inner
        remainder -= self.offsets.combined(used)
        for memory, own, of_offsets in zip(self.memory, remembered, self.remembered, strict=True):
            memory.subtract(own - np.tensordot(used, of_offsets, axes=1), remainder)
        return remainder.reshape(vectors.shape)

    def products(self, vectors: np.ndarray) -> np.ndarray:
        """(k, k) scalar products of (k, rows) vectors with what is left of them when they are marginalised.

        Infinite or no numbers where the model runs away.
        """
        with np.errstate(over="ignore", invalid="ignore"):
            remembered, products = self._seen(vectors)
            explained = sum(alike(own, own) for own in remembered)
            return vectors @ vectors.T - explained - products @ self.inner @ products.T

    def _seen(self, vectors):
        """Amounts of every memory's basis in vectors (k, rows), and products (k, q) of what it leaves with offsets."""
        remembered = [memory.amounts(vectors) for memory in self.memory]
        explained = sum(alike(own, of) for own, of in zip(remembered, self.remembered, strict=True))
        return remembered, self.offsets.dot(vectors) - explained

    def deviance(self, w: np.ndarray) -> float:
        """Sum of squares of whitened residuals (rows,) with the best offsets, their priors included.

        Infinite or no number where the model runs away.
        """
        return float(self.products(w[None])[0, 0])

    def parts(self, w: np.ndarray) -> np.ndarray:
        """(rows,) what each of the whitened residuals (rows,) adds to the deviance."""
        return w * self.marginalised(w)

    def moved(self, point: Point, order: Sequence[tuple[Candidate, int]], step: np.ndarray) -> Point:
        """The point after a step (k,) of the coordinates `order`, in natural sizes, as far as bounds allow."""
        moved = {candidate: list(z) for candidate, z in point.items()}
        for (candidate, i), change in zip(order, step, strict=True):
            moved[candidate][i] += change * self.sizes[candidate][i]
        return {candidate: candidate.within(z) for candidate, z in moved.items()}

    def slopes(self, point: Point, moved: Sequence[tuple[Candidate, int]], w: np.ndarray) -> np.ndarray:
        """(len(moved), rows) changes of the whitened residuals per natural size of each coordinate; w: at `point`."""
        def slope(coordinate):
            candidate, i = coordinate
            low, high = candidate.bounds[i]
            z, size = point[candidate][i], self.sizes[candidate][i]
            step = STEP * max(abs(z - candidate.neutral[i]), size)
            if z + step > high:
                step = -step
            if z + step < low:
                step = high - z or low - z
            for signed_step in (step, -step):  # the other way where the model runs away
                z_new = [*point[candidate][:i], z + signed_step, *point[candidate][i + 1 :]]
                change = (self.whitened({**point, candidate: z_new}) - w) * (size / signed_step)
                if np.isfinite(change).all():
                    break
            return np.nan_to_num(change, nan=0.0, posinf=0.0, neginf=0.0)

        return np.stack([*each(slope, moved), np.empty_like(w)])[:-1]


def deviance_at(likelihood: Likelihood, point: Point) -> float:
    """The deviance at a point; infinite where the model runs away."""
    w = likelihood.whitened(point)
    return likelihood.deviance(w) if np.isfinite(w).all() else np.inf


def least_of(likelihood: Likelihood, points: Sequence[Point]) -> tuple[Point, float]:
    """The point at which the deviance is least, the first of equals, and that deviance."""
    deviances = each(partial(deviance_at, likelihood), points)
    best = int(np.argmin(deviances))
    return points[best], deviances[best]


@dataclass(frozen=True)
class Fit:
    """The best point.

    Attributes:
        point: effects and their coordinates.
        deviance: at the point.
        order: (candidate, number of the coordinate) of each coordinate that was fitted.
        w: (rows,) whitened residuals at the point.
    """

    point: Point
    deviance: float
    order: list[tuple[Candidate, int]]
    w: np.ndarray = field(repr=False)


def fit(
    likelihood: Likelihood, start: Point, iterations: int = 12, tolerance: float = 0.02,
    held: tuple[Candidate, int] | None = None,
) -> Fit:
    """Minimise the deviance from `start`, within bounds, by the method of Levenberg and Marquardt.

    A limit that no run reaches changes nothing, so that nothing leads back to one that does: others are tried.

    Args:
        iterations: at most. tolerance: drop in deviance below which an iteration is the last.
        held: a coordinate that stays as it is in `start`.
    """
    point = {candidate: list(z) for candidate, z in start.items()}
    order = [(c, i) for c in point for i in range(len(c.parameters)) if (c, i) != held]
    w = likelihood.whitened(point)
    best = Fit(point, likelihood.deviance(w), order, w)
    for _ in range(_SHORTENINGS):  # a start at which the model runs away
        if np.isfinite(best.deviance) or held is not None:
            break
        point = {c: [n + 0.5 * (a - n) for a, n in zip(z, c.neutral, strict=True)] for c, z in point.items()}
        w = likelihood.whitened(point)
        best = Fit(point, likelihood.deviance(w), order, w)
    if not order:
        return best
    best, idle = _descended(likelihood, best, iterations, tolerance)
    for candidate, i in idle:
        z, size = best.point[candidate], likelihood.sizes[candidate][i]
        point, deviance = least_of(likelihood, [
            {**best.point, candidate: candidate.within([*z[:i], times * size, *z[i + 1 :]])} for times in TIMES
        ])
        if deviance < best.deviance - tolerance:
            reached = Fit(point, deviance, order, likelihood.whitened(point))
            best = _descended(likelihood, reached, iterations, tolerance)[0]
    return best


def _descended(likelihood, start, iterations, tolerance) -> tuple[Fit, list[tuple[Candidate, int]]]:
    """The best Fit downhill from a Fit, and those of its coordinates that are limits and change nothing there."""
    point, deviance, order, w, damping, idle = start.point, start.deviance, start.order, start.w, 1e-3, []
    for _ in range(iterations):
        products = likelihood.products(np.vstack([likelihood.slopes(point, order, w), w]))
        if not np.isfinite(products).all():  # the model runs away
            break
        normal, gradient = products[:-1, :-1], products[:-1, -1]
        free = _free(point, order, normal, gradient)
        drop = 0.0
        for _ in range(_SHORTENINGS):
            step = np.zeros(len(order))
            damped = normal + damping * np.diag(np.diag(normal) + 1e-12)
            step[free] = -np.linalg.lstsq(damped[np.ix_(free, free)], gradient[free], rcond=None)[0]
            moved = likelihood.moved(point, order, step)
            w_new = likelihood.whitened(moved)
            new = likelihood.deviance(w_new) if np.isfinite(w_new).all() else np.inf
            if new < deviance:
                drop, point, w, deviance, damping = deviance - new, moved, w_new, new, max(damping / 5.0, 1e-7)
                break
            if -step @ (2.0 * gradient + normal @ step) < tolerance:  # a shorter step promises even less
                break
            damping *= 8.0
        idle = [c for c, level in zip(order, _level(normal), strict=True) if level and c[0].parameters[c[1]].reciprocal]
        if drop < tolerance:
            break
    return Fit(point, deviance, order, w), idle


def covariance_of(likelihood: Likelihood, best: Fit) -> np.ndarray:
    """(k, k) covariance of the fitted coordinates, in natural sizes; large along what the deviance does not depend on.
    """
    root = root_of(likelihood.products(likelihood.slopes(best.point, best.order, best.w)))
    return root @ root.T


def root_of(normal: np.ndarray) -> np.ndarray:
    """(k, k) a root of the covariance that is the inverse of `normal` (k, k).

    A column is one standard deviation along an axis.
    """
    values, vectors = np.linalg.eigh(normal)
    return vectors / np.sqrt(np.maximum(values, _LEVEL * max(values[-1], 1.0)))


def _level(normal):
    """(k,) which coordinates change nothing, such as the limit of a motion that no run has."""
    curvatures = np.diag(normal)
    return curvatures <= _LEVEL * max(curvatures.max(), 1.0)


def _free(point, order, normal, gradient):
    """Numbers of the coordinates, less those that change nothing, or that the gradient pushes beyond a bound."""
    free, level = [], _level(normal)
    for at, (candidate, i) in enumerate(order):
        if level[at]:
            continue
        low, high = candidate.bounds[i]
        z = point[candidate][i]
        if not ((z <= low and gradient[at] > 0.0) or (z >= high and gradient[at] < 0.0)):
            free.append(at)
    return free
