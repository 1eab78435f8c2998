"""Named effects that nearly undo each other: how large each is rests on how little they differ."""

from itertools import combinations

import numpy as np

from drake_ispace.explain.decide.decision import NEXT_TO_NOTHING, Decision
from drake_ispace.explain.threads import each


def cancelling(decision: Decision) -> list[str]:
    """A sentence for every two named effects that do next to nothing together, each at its size."""
    likelihood, named = decision.end.likelihood, decision.named
    sets = [(candidate,) for candidate in named.point] + list(combinations(named.point, 2))
    if len(sets) < 2:
        return []

    def done_by(effects):
        """How much the deviance grows by what these do, the others staying as they are."""
        rest = {candidate: z for candidate, z in named.point.items() if candidate not in effects}
        return likelihood.deviance(likelihood.whitened(rest) - named.w)

    size = np.sqrt(NEXT_TO_NOTHING)  # the deviance goes with its square
    done = dict(zip(sets, each(done_by, sets), strict=True))
    return [
        f"{one.name} and {other.name} undo each other: together they do less than {size:.0%} of either"
        for one, other in combinations(named.point, 2)
        if done[one, other] < NEXT_TO_NOTHING * min(done[one,], done[other,])
    ]
