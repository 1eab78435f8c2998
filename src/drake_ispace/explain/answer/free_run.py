"""Errors of whole runs in which nothing corrects the model, before and after the effects are in it.

A robot under a camera is dead-reckoned: its encoders say where it goes from the start of a run, and every fix of the
camera is compared with that. A plant of the user's own is simulated on the recorded torque (free-run simulation), and
compared with the measured wheels.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from drake_ispace.explain.answer.describe import with_free_run
from drake_ispace.explain.answer.explanation import Explanation, FreeRun, PlantParameter
from drake_ispace.explain.decide.decision import Decision
from drake_ispace.explain.decide.validate import Choice
from drake_ispace.explain.fit.free_run import Sizes, channel_of, error_of, fitted, measured, rms, unit_of
from drake_ispace.explain.fit.likelihood import merged
from drake_ispace.explain.predict.case import Case
from drake_ispace.explain.predict.own_model import OwnReplay
from drake_ispace.explain.predict.prediction import Prediction
from drake_ispace.explain.predict.replay import Values
from drake_ispace.explain.predict.room_gain import with_gain
from drake_ispace.explain.predict.tracks import Track


def add_free_runs(answer: Explanation, case: Case, decision: Decision | Choice) -> None:
    """Add the errors of whole runs to the answer: a row for the training runs and one for each kind of held-out runs.

    For a plant of the user's own, also add the sizes of the effects and the free parameters of the plant with which
    free-run simulations come nearest to the training runs.
    """
    without, best = _sizes(case, decision)
    parts = {"training": case.prediction}
    parts |= {kind: part_of(case.held_out, runs) for kind, runs in case.kinds.items()}
    for name, part in parts.items():
        if case.scenario is not None:
            answer.free_run += dead_reckoning(name, part, merged(best.point))
        else:
            answer.free_run += simulation(name, case.replay, part.tracks, without, best)
    if case.scenario is None:
        answer.effects = with_free_run(answer.effects, case.replay, best)
        answer.plant = [PlantParameter(name, value, best.plant[name]) for name, value in without.plant.items()]


def _sizes(case, decision) -> tuple[Sizes, Sizes]:
    """Sizes for free runs, without the named effects and with them."""
    if isinstance(decision, Choice):
        return decision.base, decision.sizes
    point = {} if decision.named is None else decision.named.point
    if case.scenario is not None:
        return Sizes({}, {}), Sizes(point, {})
    without = fitted(case.replay, case.prediction.tracks, {})
    return without, fitted(case.replay, case.prediction.tracks, point) if point else without


def dead_reckoning(runs: str, prediction: Prediction, values: Values) -> list[FreeRun]:
    """The row of dead reckoning, without effects and with those of `values`; none without an encoder or a camera.

    runs: what these runs are called in the row.
    """
    if not {"encoder", "kinect"} <= prediction.replay.feeds or not any(len(t.fix_ticks) > 1 for t in prediction.tracks):
        return []
    before, after = dead_reckoned(prediction, {}), dead_reckoned(prediction, values)
    return [FreeRun(runs, "dead-reckoned position", "m", before, after)]


def dead_reckoned(prediction: Prediction, values: Values) -> float:
    """Root mean square distance [m] between camera and odometry from the start of each run, all fixes pooled."""
    replay = with_gain(with_gain(prediction.replay, 0, 0.0), 1, 0.0)
    residuals = replace(prediction, replay=replay).residuals(values)
    return rms(np.concatenate([np.hypot(run["room"][:, 0], run["room"][:, 1]) for run in residuals]))


def simulation(
    runs: str, replay: OwnReplay, tracks: Sequence[Track], before: Sizes, after: Sizes
) -> list[FreeRun]:
    """The rows of free-run simulation: in the unit of what was logged, and as a share of its root mean square.

    runs: what these runs are called in the rows.
    """
    size = rms(np.concatenate([measured(replay, track).ravel() for track in tracks]))
    absolute = [error_of(replay, tracks, sizes) for sizes in (before, after)]
    channel = channel_of(replay)
    relative = [error / max(size, 1e-300) for error in absolute]
    return [FreeRun(runs, channel, unit_of(replay), *absolute), FreeRun(runs, f"{channel}, relative", "1", *relative)]


def part_of(prediction: Prediction, runs: slice) -> Prediction:
    """The same model against some of the runs."""
    parts = {name: getattr(prediction, name)[runs] for name in ("tracks", "starts", "anchored")}
    return replace(prediction, **parts)
