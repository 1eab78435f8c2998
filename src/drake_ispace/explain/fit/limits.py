"""Where the fit of several limits begins: on the way to the best ones the deviance may rise before it falls."""

import itertools
from collections.abc import Sequence

from drake_ispace.explain.fit.candidates import Candidate
from drake_ispace.explain.fit.likelihood import TIMES, Likelihood, Point, least_of


def has_several_limits(candidate: Candidate) -> bool:
    """Whether it has several parameters, and all are limits."""
    return len(candidate.parameters) > 1 and all(parameter.reciprocal for parameter in candidate.parameters)


def with_best_limits(
    likelihood: Likelihood, point: Point, candidate: Candidate, probes: Sequence[Sequence[float]]
) -> Point:
    """The point with the coordinates of the candidate where the deviance is least.

    probes: coordinates (k, parameters) at which its signatures were taken. Multiples of the widest one of each limit
        are tried with those of each of the others, beside the point.
    """
    widest = [min(z for z in column if z > 0.0) for column in zip(*probes, strict=True)]
    multiples = itertools.product(*([times * z for times in (0.0, *TIMES)] for z in widest))
    options = [point, *({**point, candidate: list(z)} for z in multiples)]
    return least_of(likelihood, options)[0]
