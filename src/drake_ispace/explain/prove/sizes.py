"""The sizes of an answer: those of the filter, or those of plain least squares?

Where velocity is commanded, places are dead-reckoned and errors of them add up over a run, hardly to be seen from one
fix to the next. Each run is therefore predicted with sizes fitted to the others: those that lead nearer to the measured
paths are the answer's. Under torque they are the filter's, unless these leave more than noise on training runs that
they were not fitted to, and the plain ones do not (prove.py).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from drake_ispace.explain.decide.decision import Decision
from drake_ispace.explain.fit.likelihood import Point, merged
from drake_ispace.explain.predict.prediction import Prediction
from drake_ispace.explain.prove.free_run import Measure, Windows
from drake_ispace.explain.prove.least_squares import fitted_horizons, plain_fit, scaled_errors
from drake_ispace.explain.prove.left_out import groups_of, points_without
from drake_ispace.robots.robot import COMMAND


@dataclass(frozen=True)
class SizesByRun:
    """SizesByRun of the named effects.

    Attributes:
        point: fitted to all training runs. without: for each training run, or each block of the only one, fitted to the
            others.
    """

    point: Point
    without: list[Point]


def filtered_sizes(decision: Decision, blocks: int) -> SizesByRun:
    """The sizes that the filter's innovations give. blocks: into which a single run is cut."""
    return SizesByRun(decision.named.point, points_without(decision, groups_of(decision, blocks)))


def plain_sizes(
    training: Prediction, windows: Sequence[Windows], decision: Decision, floors: Mapping[Measure, float],
) -> SizesByRun:
    """The sizes that free-run least squares finds.

    training: model and runs. windows: of each run. floors: measure -> what noise leaves.
    """
    sizes = decision.end.likelihood.sizes
    return SizesByRun(*plain_fit(training, windows, decision.named.point, sizes, floors))


def leads_nearer(
    plain: SizesByRun, filtered: SizesByRun, training: Prediction, windows: Sequence[Windows],
    floors: Mapping[Measure, float],
) -> bool:
    """Whether plain sizes lead nearer to the path of each run than filtered ones do, neither fitted to the run.

    training, windows, floors: as of `plain_sizes`.
    """
    if training.replay.body.robot.driven != COMMAND or len(windows) < 2:
        return False
    plain_error, filtered_error = (
        sum(
            np.sum(scaled_errors(training, i, w, merged(point), floors, fitted_horizons(w)) ** 2)
            for i, (w, point) in enumerate(zip(windows, sizes.without, strict=True))
        ) for sizes in (plain, filtered)
    )
    return plain_error < filtered_error
