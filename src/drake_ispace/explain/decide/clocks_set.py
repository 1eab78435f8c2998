"""Are the clocks of command, torque and IMU off by some ticks? The model's errors tell, more sharply than any motion.

Wheels that turn before they are told, or a body that feels an acceleration before or after it is there, are nothing
that a model can lack. Clocks are set by the residuals of the model as it is. What it lacks makes it err more if torques
come too early or the IMU at other times, whatever it lacks.
"""

from dataclasses import replace
from functools import cache

import numpy as np

from drake_ispace.blocks.rates import TICK_S
from drake_ispace.effects.places.velocity import VelocityDelay
from drake_ispace.explain.check.compare.links import LATENCY_S
from drake_ispace.explain.check.finding import Finding, named
from drake_ispace.explain.decide.decision import LEAST_FURTHER
from drake_ispace.explain.predict.case import Case, part_of
from drake_ispace.explain.predict.prediction import Prediction
from drake_ispace.explain.predict.stretches import MOST_S
from drake_ispace.faults.repair import Clock
from drake_ispace.robots.robot import COMMAND

_PAST = 8  # residuals that the next one is predicted from


def with_clocks_set(case: Case, names: list[str]) -> tuple[Case, list[Finding]]:
    """The case with one channel at the times at which it was, and the finding if its stamps were others.

    names: of all runs.
    """
    robot, prediction = case.replay.body.robot, case.prediction
    if case.scenario is None or not prediction.channels["motion"]:
        return case, []
    driven, found = robot.driven, _Clocks(prediction)
    if driven == COMMAND:
        channel, ticks = driven, found.late(driven)
    else:
        senses = [(driven, 1), (driven, -1)] + [("imu", 1), ("imu", -1)] * robot.has_imu
        channel, ticks = min((found.near(*one) for one in senses), key=lambda one: found.left(*one))
    if not ticks or (channel == driven and ticks < 0):  # a robot may follow late: a delay, a lag
        return case, []
    off = f"clock {abs(ticks) * TICK_S:.3g} s {'late' if ticks > 0 else 'early'}"
    what = f"{off}, the wheels turn before" if channel == driven else f"{off} against torques and wheels"
    finding = Finding(
        "clock_offset", what, "", tuple(range(len(names))), channel, repairs=(Clock(channel, 1.0, -ticks * TICK_S),)
    )
    return case.with_earlier(channel, ticks), [named(finding, names)]


class _Clocks:
    """What residuals leave if a channel was so many ticks earlier than its stamps say."""

    def __init__(self, prediction: Prediction):
        lasted = np.cumsum([0] + [track.ticks * TICK_S for track in prediction.tracks])
        self._prediction = part_of(prediction, slice(int(np.searchsorted(lasted, MOST_S))))  # others say the same
        self.left = cache(self._left)

    def _left(self, channel, ticks):
        tracks = [track.earlier(channel, ticks) for track in self._prediction.tracks]
        return _surprise(replace(self._prediction, tracks=tracks))

    def near(self, channel: str, sense: int) -> tuple[str, int]:
        """The channel and its best ticks in this sense, one after the other as long as each is worth it."""
        ticks = 0
        while self.left(channel, ticks + sense) < self.left(channel, ticks) - LEAST_FURTHER:
            ticks += sense
        return channel, ticks

    def late(self, channel: str) -> int:
        """By how many ticks within a latency the channel is late, whatever lies between; 0 where it is not.

        Nor is it by up to half a sample, by which changes between samples are logged late on the average, or where the
        robot might as well follow late.
        """
        most, half_s = round(LATENCY_S / TICK_S), max(track.command_step_s for track in self._prediction.tracks) / 2.0
        ticks = min(range(most + 1), key=lambda ticks: self.left(channel, ticks))
        least = self.left(channel, ticks)
        if not least < self.left(channel, 0) - LEAST_FURTHER or ticks * TICK_S < half_s + 0.5 * TICK_S:
            return 0
        latest = round(VelocityDelay.parameters[0].high / TICK_S)
        return ticks if all(self.left(channel, -delay) > least for delay in range(1, latest + 1)) else 0


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
