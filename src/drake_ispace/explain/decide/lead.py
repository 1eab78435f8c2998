"""Do wheels turn before the torques that turn them? Nothing physical does that: the torques' clock is late."""

from dataclasses import replace

import numpy as np

from drake_ispace.blocks.rates import TICK_S
from drake_ispace.explain.check.finding import Finding, named
from drake_ispace.explain.decide.decision import LEAST_FURTHER
from drake_ispace.explain.predict.case import Case
from drake_ispace.explain.predict.prediction import Prediction
from drake_ispace.faults.repair import Clock
from drake_ispace.robots.robot import TORQUE

_PAST = 8  # residuals that the next one is predicted from


def with_lead_undone(case: Case, names: list[str]) -> tuple[Case, list[Finding]]:
    """The case with torques at the times at which they acted, and the finding where their stamps were later.

    names: of all runs.

    Their clock is set back tick by tick as long as that leaves less to the model's errors. A model that lacks something
    errs more if torques come too early, whatever it lacks; only what it could not know before counts, so that slow
    errors do not.
    """
    if case.scenario is None or not case.prediction.channels["motion"] or case.replay.body.robot.driven != TORQUE:
        return case, []
    ticks, least = 0, _surprise(case.prediction)
    while (less := _surprise(_earlier(case.prediction, ticks + 1))) < least - LEAST_FURTHER:
        ticks, least = ticks + 1, less
    if not ticks:
        return case, []
    what = f"clock {ticks * TICK_S:.3g} s late, the wheels turn before"
    repairs = (Clock(TORQUE, 1.0, -ticks * TICK_S),)
    finding = Finding("clock_offset", what, "", tuple(range(len(names))), TORQUE, repairs=repairs)
    return case.with_torque_earlier(ticks), [named(finding, names)]


def _surprise(prediction: Prediction) -> float:
    """-2 log likelihood, up to a constant, of what the residuals' past does not tell of the encoders' and the IMU's."""
    found = 0.0
    for run in prediction.residuals({}):
        rows = run["motion"]
        if len(rows) <= 2 * _PAST * rows.shape[1] or not np.isfinite(rows).all():
            return np.inf
        past = np.hstack([rows[_PAST - i - 1 : len(rows) - i - 1] for i in range(_PAST)])
        scale = np.sqrt(np.mean(past**2, axis=0)) + 1e-300
        left = rows[_PAST:] - past @ (np.linalg.lstsq(past / scale, rows[_PAST:], rcond=None)[0] / scale[:, None])
        found += len(left) * np.linalg.slogdet(left.T @ left / len(left))[1]
    return found


def _earlier(prediction, ticks):
    return replace(prediction, tracks=[track.earlier(ticks) for track in prediction.tracks])
