"""A look-alike of a named effect with which whole runs of a user's own plant end nearer.

A filter that the measured motion holds may not tell the two apart. At the sizes that it finds, however, one of them may
lead a simulation astray, because whole runs ask for another size of it: it is then not the cause.
"""

from dataclasses import replace

import numpy as np

from drake_ispace.explain.decide.decision import Decision
from drake_ispace.explain.decide.proposals.detect import FALSE_ALARM_RATE
from drake_ispace.explain.decide.rivals import with_rival_named
from drake_ispace.explain.fit.free_run import Sizes, errors_of, fitted, shifts_of
from drake_ispace.explain.fit.likelihood import fit
from drake_ispace.explain.predict.prediction import Prediction
from drake_ispace.explain.prove.errors.left_out import in_parts
from drake_ispace.explain.prove.own.asked import clearly


def preferred_by_runs(prediction: Prediction, decision: Decision) -> Decision | None:
    """The Decision with that rival in the place of a named effect that leads clearly nearer, at sizes of the filter.

    Squared errors are compared as in `asked_for_own`. None if there is no such rival.

    Args:
        prediction: of the training runs. decision: with the named effects.
    """
    rivals = [
        (effect, rival) for effect, rivals in decision.rivals.items() if effect not in decision.kept
        for rival in rivals if rival.point is not None
    ]
    if not rivals:
        return None
    replay, tracks = prediction.replay, in_parts(prediction).tracks

    def left(point):
        """Sum of the squared errors of the runs."""
        plant = fitted(replay, tracks, point, shifts_of(point)).plant if replay.free else {}
        return float((errors_of(replay, tracks, Sizes(point, plant)) ** 2).sum())

    found = [left(rival.point) for _, rival in rivals]
    effect, best = rivals[int(np.argmin(found))]
    if left(decision.named.point) < clearly(FALSE_ALARM_RATE, replay, tracks) * min(found):
        return None
    named = fit(decision.end.likelihood, best.point)
    return replace(with_rival_named(decision, effect, best.candidate, named), further=[])
