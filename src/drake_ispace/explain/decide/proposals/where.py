"""Where in the room: the part of it in which an effect explains most."""

import itertools

import numpy as np

from drake_ispace.explain.decide.survey.signatures import difference
from drake_ispace.explain.decide.survey.survey import Survey
from drake_ispace.explain.fit.candidates import Candidate
from drake_ispace.explain.fit.likelihood import merged
from drake_ispace.explain.threads import each

_PARTS = 8  # along each side of the room


def start_in_room(survey: Survey, candidate: Candidate) -> list[float]:
    """Coordinates at which a fit of an effect that acts in a part of the room should begin.

    A fit moves an edge only by what it sees along the edge, and does not find one that is far away. The room is
    therefore cut into small parts. What the effect does in a rectangle of them is the sum of what it does in each.
    """
    view, effect = survey.view, candidate.effect
    prediction, size, known = view.prediction, view.sizes[candidate][0], merged(survey.point)
    sides = [np.linspace(-0.5 * s, 0.5 * s, _PARTS + 1).tolist() for s in prediction.replay.body.room_m]

    def within(x, y):
        return [size, sides[0][x[0]], sides[0][x[1]], sides[1][y[0]], sides[1][y[1]], candidate.neutral[-1]]

    def change(part):
        x, y = part
        values = candidate.values(within((x, x + 1), (y, y + 1)))
        without = difference(survey.residuals, prediction.residuals({**known, effect.name: values}))
        return survey.likelihood.whitening(without)

    parts = list(itertools.product(range(_PARTS), repeat=2))
    found = survey.likelihood.products(np.stack([*each(change, parts), survey.w]))
    products, gram = found[-1, :-1].reshape(_PARTS, _PARTS), found[:-1, :-1].reshape([_PARTS] * 4)
    best, start = 0.0, None
    for x, y in itertools.product(itertools.combinations(range(_PARTS + 1), 2), repeat=2):
        along, across = slice(*x), slice(*y)
        drop, length = products[along, across].sum(), gram[along, across, along, across].sum()
        if drop > 0.0 and length > 1.0 and drop**2 / length > best:
            best, start = drop**2 / length, within(x, y)
            start[0] = size * drop / length
    return start or list(candidate.neutral)
