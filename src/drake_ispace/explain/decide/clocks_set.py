"""Are the clocks of torque and IMU off by some ticks? The wheels tell, far more sharply than any latency of a sensor.

Wheels that turn before the torques that turn them, or a body that feels an acceleration before or after it is there,
are nothing that a model can lack. Clocks are set by the residuals of the model as it is. What it lacks makes it err
more if torques come too early or the IMU at other times, whatever it lacks.
"""

from collections.abc import Callable
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


def with_clocks_set(case: Case, names: list[str]) -> tuple[Case, list[Finding]]:
    """The case with torques, or an IMU, at the times at which they were, and the finding if their stamps were others.

    names: of all runs.
    """
    robot, prediction = case.replay.body.robot, case.prediction
    if case.scenario is None or not prediction.channels["motion"] or robot.driven != TORQUE:
        return case, []
    as_given = _surprise(prediction)
    senses = [(TORQUE, 1), (TORQUE, -1)] + [("imu", 1), ("imu", -1)] * robot.has_imu
    found = {sense: _best(lambda ticks, c=sense: _surprise(_earlier(prediction, c[0], ticks * c[1])), as_given)
             for sense in senses}
    channel, sense = min(found, key=lambda one: found[one][1])
    ticks = sense * found[channel, sense][0]
    if not ticks or (channel, sense) == (TORQUE, -1):  # torques may act late: a delay, a lag
        return case, []
    off = f"clock {abs(ticks) * TICK_S:.3g} s {'late' if ticks > 0 else 'early'}"
    what = f"{off}, the wheels turn before" if channel == TORQUE else f"{off} against torques and wheels"
    finding = Finding(
        "clock_offset", what, "", tuple(range(len(names))), channel, repairs=(Clock(channel, 1.0, -ticks * TICK_S),)
    )
    return case.with_earlier(channel, ticks), [named(finding, names)]


def _best(surprise: Callable[[int], float], as_given: float) -> tuple[int, float]:
    """By how many ticks a clock is set back, one after the other as long as each is worth it, and what that leaves."""
    ticks, least = 0, as_given
    while (less := surprise(ticks + 1)) < least - LEAST_FURTHER:
        ticks, least = ticks + 1, less
    return ticks, least


def _surprise(prediction: Prediction) -> float:
    """-2 log likelihood, up to a constant, of what the residuals' past does not tell of the encoders' and the IMU's.

    Slow errors, such as those of forces, do not count.
    """
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


def _earlier(prediction, channel, ticks):
    return replace(prediction, tracks=[track.earlier(channel, ticks) for track in prediction.tracks])
