"""The sizes of an answer: those of the filter, or those of plain least squares?

Where velocity is commanded, places are dead-reckoned and errors of them add up over a run, hardly to be seen from one
fix to the next. Each run is therefore predicted with sizes fitted to the others: those that lead nearer to the measured
paths are the answer's. Under torque they are the filter's, unless these leave more than noise on training runs that
they were not fitted to, and the plain ones do not (prove.py).
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from drake_ispace.explain.decide.decision import Decision
from drake_ispace.explain.fit.likelihood import Point, merged
from drake_ispace.explain.predict.prediction import Prediction
from drake_ispace.explain.prove.errors.free_run import Measure, Windows, changes, errors, rms
from drake_ispace.explain.prove.errors.least_squares import squared_error_left_out
from drake_ispace.explain.prove.errors.left_out import groups_of, sizes_without
from drake_ispace.robots.robot import COMMAND


@dataclass(frozen=True)
class SizesByRun:
    """Sizes of the named effects.

    Attributes:
        point: fitted to all training runs. without: for each training run, or each block of the only one, fitted to the
            others. roots: of each of these the root (k, k) of its covariance, in natural sizes: a column is one
            standard deviation along an axis.
    """

    point: Point
    without: list[Point]
    roots: list[np.ndarray]

    def with_all(self, runs: Collection[int]) -> "SizesByRun":
        """The same, but of these runs the sizes that were fitted to all, themselves included."""
        return replace(self, without=[self.point if i in runs else p for i, p in enumerate(self.without)])


def filtered_sizes(decision: Decision, blocks: int) -> SizesByRun:
    """The sizes that the filter's innovations give. blocks: into which a single run is cut."""
    points, roots = zip(*sizes_without(decision, groups_of(decision, blocks)), strict=True)
    return SizesByRun(decision.named.point, list(points), list(roots))


def left_by_uncertainty(
    prediction: Prediction, i: int, windows: Windows, decision: Decision, sizes: SizesByRun
) -> dict[Measure, float]:
    """Measure -> root mean square change of the errors of run `i` by sizes that are as uncertain as without the run.

    prediction: of the runs, one for each of `sizes.roots`. windows: of the run.
    """
    before, likelihood = errors(prediction, i, windows, merged(sizes.point)), decision.end.likelihood
    squares = dict.fromkeys(before, 0.0)
    for axis in sizes.roots[i].T:
        unit = max(float(np.abs(axis).max()), 1.0)  # up to a natural size errors change in proportion
        steps = [axis / unit, -axis / unit]  # a bound may be in the way of one
        moved = [merged(likelihood.moved(sizes.point, decision.named.order, step)) for step in steps]
        both = [changes(before, errors(prediction, i, windows, values)) for values in moved]
        for m in squares:
            squares[m] += (unit * max((rms([one[m]]) for one in both if m in one), default=0.0)) ** 2
    return {m: float(np.sqrt(square)) for m, square in squares.items()}


def leads_nearer(
    plain: SizesByRun, filtered: SizesByRun, training: Prediction, windows: Sequence[Windows],
    floors: Mapping[Measure, float], passed_over: Collection[int],
) -> bool:
    """Whether plain sizes lead nearer to the path of each run than filtered ones do, neither fitted to the run.

    training: model and runs. windows: of each run. floors: measure -> what noise leaves. passed_over: runs whose sizes
    the others do not tell.
    """
    if training.replay.body.robot.driven != COMMAND or len(windows) < 2:
        return False
    plain_error, filtered_error = (
        squared_error_left_out(training, windows, sizes.without, floors, passed_over) for sizes in (plain, filtered)
    )
    return plain_error < filtered_error
