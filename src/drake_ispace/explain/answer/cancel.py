"""Named effects that nearly undo each other: how large each is rests on how little they differ."""

from itertools import combinations

from drake_ispace.explain.decide.decision import Decision
from drake_ispace.explain.threads import each

_NOTHING = 0.1  # of what either does alone, below which two effects do nothing together


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

    done = dict(zip(sets, each(done_by, sets), strict=True))
    return [
        f"{one.name} and {other.name} undo each other: together they do less than {_NOTHING:.0%} of either"
        for one, other in combinations(named.point, 2)
        if done[one, other] < _NOTHING**2 * min(done[one,], done[other,])
    ]
