"""Plain least squares of free-run simulations: a yardstick for the sizes of the answer.

It knows nothing of filters, innovations or a model of the noise. It begins at the neutral value of every parameter, or
where such a fit of other effects ended.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from scipy.optimize import least_squares

from drake_ispace.explain.fit.candidates import Candidate
from drake_ispace.explain.fit.likelihood import STEP, Point, merged
from drake_ispace.explain.predict.prediction import Prediction
from drake_ispace.explain.predict.replay import Values
from drake_ispace.explain.prove.errors.free_run import ATE, RUN, WHEELS, Errors, Measure, Windows, errors
from drake_ispace.explain.threads import each

_MOST_TRIALS = 12  # evaluations
FAR = 1e3  # times what noise leaves: the error of a model that runs away


@dataclass(frozen=True)
class PlainFit:
    """The sizes at which the squared errors of free runs are least.

    Attributes:
        point: effects and their coordinates. without: the same after a Gauss-Newton step that leaves the errors of each
            run out. hidden: coordinates that free runs cannot show, and that are not fitted: in their whole size they
            change all errors together by less than noise changes one.
    """

    point: Point
    without: list[Point]
    hidden: frozenset[tuple[Candidate, int]]

    @property
    def shown(self) -> dict[Candidate, list[float | None]]:
        """The point, None for each coordinate that free runs cannot show."""
        return {
            candidate: [None if (candidate, i) in self.hidden else value for i, value in enumerate(z)]
            for candidate, z in self.point.items()
        }


def plain_fit(
    prediction: Prediction, windows: Sequence[Windows], point: Point, sizes: Mapping[Candidate, Sequence[float]],
    floors: Mapping[Measure, float], begin: Point = MappingProxyType({}),
) -> PlainFit:
    """Fit the effects of `point` to free runs.

    Args:
        prediction: of the runs to fit. windows: of each run. sizes: natural size of each coordinate. floors: measure ->
            what noise leaves; every error counts in units of it. begin: sizes of some of the effects that suit whole
            runs, to begin with. The rest begin neutral.
    """
    order = [(candidate, i) for candidate in point for i in range(len(candidate.parameters))]
    size = np.array([max(sizes[c][i], abs(point[c][i] - c.neutral[i])) for c, i in order])  # only scales
    low, high = (np.array([candidate.bounds[i][end] for candidate, i in order]) / size for end in (0, 1))
    start = np.array([begin.get(candidate, candidate.neutral)[i] for candidate, i in order]) / size
    start = np.clip(start, low + STEP, high - STEP)  # least squares wants a start inside of the bounds

    def at(z):
        moved = {candidate: list(values) for candidate, values in point.items()}
        for (candidate, i), value in zip(order, z * size, strict=True):
            moved[candidate][i] = float(value)
        return moved

    known: dict[tuple, np.ndarray] = {}  # where the fit stands, errors are asked for several times

    def by_run(zs, horizons):
        """For each z the errors of each run."""
        def one(job):
            z, i = job
            key = z.tobytes(), i, *sorted(horizons[i])
            if key not in known:
                known[key] = scaled_errors(prediction, i, windows[i], merged(at(z)), floors, horizons[i])
            return known[key]

        jobs = [(z, i) for z in zs for i in range(len(windows))]
        found, n = each(one, jobs), len(windows)
        return [found[k : k + n] for k in range(0, len(found), n)]

    def residuals(zs, horizons):
        """(len(zs), rows)."""
        return np.array([np.concatenate([np.empty(0), *parts]) for parts in by_run(zs, horizons)])

    # over long horizons a heading may be wrong by turns; from the sizes that suit short ones on it is not
    every, best = [fitted_horizons(w) for w in windows], None
    stages = [every] if begin else [[{w.shortest} for w in windows], every]
    for horizons in stages if start.size else ():
        if residuals([start], horizons).size:
            best = least_squares(
                lambda z, horizons: residuals([z], horizons)[0], start, bounds=(low, high), max_nfev=_MOST_TRIALS,
                method="dogbox", args=(horizons,),  # which a start near a bound does not slow down
                jac=lambda z, horizons: _slopes(lambda zs: residuals(zs, horizons), z, high),
            )
            start = best.x
    if best is None:
        return PlainFit(point, [point] * len(windows), frozenset(order))
    hidden = np.linalg.norm(best.jac, axis=0) < 1.0
    given = np.array([point[candidate][i] for candidate, i in order]) / size
    ends = np.cumsum([len(part) for part in by_run([start], horizons)[0]])[:-1]
    without = [np.clip(z, low, high) for z in _without_each(start, best, ends)]
    found, *without = (at(np.where(hidden, given, z)) for z in (start, *without))
    return PlainFit(found, without, frozenset(order[k] for k in np.flatnonzero(hidden)))


def _without_each(z, best, ends):
    """Yield the coordinates after a Gauss-Newton step from `z` without the errors of each run; ends (runs - 1,)."""
    normal, gradient = best.jac.T @ best.jac, best.jac.T @ best.fun
    for jac, fun in zip(np.split(best.jac, ends), np.split(best.fun, ends), strict=True):
        yield z - np.linalg.lstsq(normal - jac.T @ jac, gradient - jac.T @ fun, rcond=None)[0]


def fitted_horizons(windows: Windows) -> set[str]:
    """Names of the horizons over which free runs are fitted."""
    return {windows.shortest, RUN, *windows.fixes}


def scaled_errors(
    prediction: Prediction, i: int, windows: Windows, values: Values, floors: Mapping[Measure, float],
    horizons: set[str],
) -> np.ndarray:
    """(k,) errors of run `i` over these horizons in units of what noise leaves, every measure of the same weight."""
    return scaled(errors(prediction, i, windows, values, horizons), floors, horizons)


def scaled(parts: Errors, floors: Mapping[Measure, float], horizons: set[str]) -> np.ndarray:
    """(k,) errors of a run over these horizons, as of `scaled_errors`."""
    return np.concatenate([np.empty(0), *(
        np.nan_to_num(part / (floors[m] * np.sqrt(len(part))), nan=FAR, posinf=FAR, neginf=-FAR).ravel()
        for m, part in sorted(parts.items()) if floors.get(m, 0.0) > 0.0 and m.horizon in horizons
        and (m.metric != ATE or m.driven_by == WHEELS)
    )])


def squared_error_left_out(
    training: Prediction, windows: Sequence[Windows], without: Sequence[Point], floors: Mapping[Measure, float],
    passed_over: Collection[int],
) -> float:
    """Sum of the squared scaled errors of all training runs, each with the sizes that were fitted to the others.

    training, windows, floors: as of `plain_fit`. without: for each run the sizes that were fitted to the others.
    passed_over: numbers of runs whose sizes the others do not tell.
    """
    def one(i):
        errors = scaled_errors(training, i, windows[i], merged(without[i]), floors, fitted_horizons(windows[i]))
        return float(np.sum(errors**2))

    return sum(each(one, [i for i in range(len(windows)) if i not in passed_over]))


def _slopes(residuals, z, high):
    """(rows, k) slopes of the residuals, by differences that stay within the bounds."""
    steps = np.where(z + STEP <= high, STEP, -STEP)
    at, *moved = residuals([z, *(z + np.diag(steps))])
    return np.column_stack([(there - at) / step for there, step in zip(moved, steps, strict=True)])
