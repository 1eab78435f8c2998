"""Where the fit of several limits begins: on the way to the best ones the deviance may rise before it falls."""

import itertools
from collections.abc import Sequence

import numpy as np

from drake_ispace.explain.fit.candidates import Candidate
from drake_ispace.explain.fit.likelihood import TIMES, Likelihood, Point, least_of

_STEPS = (2.0, 1.4, 1.2, 1.1)  # factors between neighbours: from one multiple to the next, finer and finer


def has_several_limits(candidate: Candidate) -> bool:
    """Whether it has several parameters, and all are limits."""
    return len(candidate.parameters) > 1 and all(parameter.reciprocal for parameter in candidate.parameters)


def with_best_limits(
    likelihood: Likelihood, point: Point, candidate: Candidate, probes: Sequence[Sequence[float]]
) -> Point:
    """The point with the coordinates of the candidate where the deviance is least.

    The deviance has many small valleys there, as a limit is met or not at every sample. From the best of the multiples
    on, nearer and nearer neighbours between the multiples are therefore tried, until none does better.

    probes: coordinates (k, parameters) at which its signatures were taken. Multiples of the widest one of each limit
        are tried with those of each of the others, beside the point.
    """
    widest = np.array([min(z for z in column if z > 0.0) for column in zip(*probes, strict=True)])
    multiples = itertools.product(*([times * z for times in (0.0, *TIMES)] for z in widest))
    options = [point, *({**point, candidate: list(z)} for z in multiples)]
    best, least = least_of(likelihood, options)
    for step in _STEPS:
        factors = [np.array(each) for each in itertools.product((1.0 / step, 1.0, step), repeat=len(widest))]
        del factors[len(factors) // 2]  # the point itself
        while True:
            z = np.array(best[candidate])
            low, high = np.minimum(z, TIMES[0] * widest), np.maximum(z, TIMES[-1] * widest)
            near = [{**best, candidate: candidate.within(np.clip(times * z, low, high))} for times in factors]
            nearest, deviance = least_of(likelihood, near)
            if not deviance < least:
                break
            best, least = nearest, deviance
    return best
