"""Further effects, or look-alikes with more numbers, that runs ask for to which nothing was fitted.

Of effects that explain as much from one sample to the next the one with the fewest numbers is named, and one that
explains little is not. What is lacking then may add up over a run all the same, as errors of a heading do.
"""

from collections.abc import Collection, Mapping, Sequence
from functools import partial

from drake_ispace.explain.decide.decision import Asked, Decision
from drake_ispace.explain.predict.prediction import Prediction
from drake_ispace.explain.prove.errors.free_run import Measure, Windows
from drake_ispace.explain.prove.errors.least_squares import PlainFit, plain_fit, squared_error_left_out
from drake_ispace.explain.prove.left.predicted import PREDICTED
from drake_ispace.robots.robot import COMMAND


def asked_for(
    training: Prediction, windows: Sequence[Windows], decision: Decision, fitted: PlainFit,
    floors: Mapping[Measure, float], passed_over: Collection[int],
) -> Asked | None:
    """The effect with which the model leads nearest to each run when its sizes are fitted to the others.

    It is one that is not named, or a rival with more numbers in the place of a named effect. It must take away as much
    of the squared error as a variable may not predict in runs from which this was not learned.

    Args:
        training: model and runs. windows: of each run. decision: with the rivals of its effects. fitted: sizes of the
            named effects that plain least squares finds. floors: measure -> what noise leaves.
            passed_over: runs whose sizes the others do not tell.

    Returns:
        None where none takes away as much, where fewer than two runs can be left out, or where torque drives the robot.
    """
    if training.replay.body.robot.driven != COMMAND or len(windows) < 2:
        return None
    named, best = decision.named.point, None
    tried = [
        (rival, {rival if c is effect else c: rival.neutral if c is effect else z for c, z in named.items()}, {})
        for effect, rivals in decision.rivals.items() for rival in (one.candidate for one in rivals)
        if len(rival.parameters) > len(effect.parameters)
    ]
    tried += [
        (effect, point, fitted.point) for point in decision.further for effect in point if effect not in named
    ]
    left_with = partial(squared_error_left_out, training, windows, floors=floors, passed_over=passed_over)
    least = (1.0 - PREDICTED) * left_with(fitted.without) if tried else 0.0
    for effect, point, begin in tried:
        found = plain_fit(training, windows, point, decision.end.likelihood.sizes, floors, begin)
        size = found.point[effect]
        if not effect.makes_sense(size) or effect.has_become_another(size):
            continue
        left = left_with(found.without)
        if left < least:
            best, least = Asked(effect, {**point, effect: size}), left
    return best
