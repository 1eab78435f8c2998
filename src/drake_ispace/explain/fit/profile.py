"""Profile likelihood: how far a coordinate may be off before the deviance rises too much, all others fitted anew."""

import numpy as np
from scipy.optimize import brentq

from drake_ispace.explain.fit.candidates import Candidate
from drake_ispace.explain.fit.likelihood import Fit, Likelihood, covariance_of, fit
from drake_ispace.explain.threads import each

_DOUBLINGS = 5  # of a guessed distance
_HALVINGS = 20  # of a distance at which the model runs away
_TOLERANCE = 0.03  # of an end, as a share of its distance


def profile_intervals(
    likelihood: Likelihood, best: Fit, candidate: Candidate, rise: float
) -> list[tuple[float, float]]:
    """For each coordinate of the candidate those below and above at which the profile deviance has risen by `rise`.

    A bound where it never rises so far, or 32 times the distance at which a parabola would have, if that is nearer.
    """
    covariance = covariance_of(likelihood, best)
    fitted = [best.order.index((candidate, i)) for i in range(len(candidate.parameters))]
    return each(lambda at: _interval(likelihood, best, covariance, at, rise), fitted)


def _interval(likelihood, best, covariance, at, rise) -> tuple[float, float]:
    """The interval of the fitted coordinate number `at`."""
    candidate, i = best.order[at]
    z, size, variance = best.point[candidate][i], likelihood.sizes[candidate][i], max(covariance[at, at], 0.0)
    guess = max(np.sqrt(variance) * size, 1e-12 * max(abs(z), 1.0)) * np.sqrt(rise)
    along = covariance[:, at] / max(covariance[at, at], 1e-300)

    def excess(value):
        """The deviance there, the others fitted anew, less that of the best fit and `rise`."""
        point = likelihood.moved(best.point, best.order, (value - z) / size * along)
        point[candidate][i] = value
        return fit(likelihood, point, iterations=3, held=(candidate, i)).deviance - best.deviance - rise

    low, high = candidate.bounds[i]
    below = _reach(lambda t: excess(z - t), guess, z - low, rise)
    above = _reach(lambda t: excess(z + t), guess, high - z, rise)
    return low if below >= z - low else z - below, high if above >= high - z else z + above


def _reach(excess, guess, most, rise):
    """Distance at which `excess` crosses zero, at most `most`; after all doublings the last distance.

    Where the model runs away before, the last distance at which it does not.
    """
    if most <= 0.0:
        return 0.0
    inner, outer = 0.0, min(guess, most)
    for _ in range(_DOUBLINGS):
        value = excess(outer)
        if not value < 0.0:
            break
        if outer >= most:
            return most
        inner, outer = outer, min(2.0 * outer, most)
    else:
        return outer
    for _ in range(_HALVINGS):
        if np.isfinite(value) or outer - inner <= _TOLERANCE * outer:
            break
        middle = 0.5 * (inner + outer)
        at_middle = excess(middle)
        if at_middle < 0.0:
            inner = middle
        else:
            outer, value = middle, at_middle
    if not np.isfinite(value):
        return inner
    known = {0.0: -rise, outer: value}
    finite = lambda t: known[t] if t in known else np.nan_to_num(excess(t), nan=value, posinf=value)  # noqa: E731
    return float(brentq(finite, inner, outer, xtol=_TOLERANCE * outer, rtol=1e-3))
