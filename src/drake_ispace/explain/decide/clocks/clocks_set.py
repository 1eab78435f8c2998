"""Are clocks of command, torque, IMU and encoders off by some ticks? The model's errors tell, sharper than any motion.

Wheels that turn before they are told, or a body that feels an acceleration before or after it is there, are nothing
that a model can lack. Clocks are set by the residuals of the model as it is. What it lacks makes it err more if torques
come too early or the IMU at other times, whatever it lacks. Of a user's own plant that is only so for what its
transmission cannot explain: where motion is slow and samples are rare, missing friction looks like a motion that leads
its torque.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from types import MappingProxyType

import numpy as np

from drake_ispace.blocks.rates import TICK_S
from drake_ispace.effects.places.actuator import CommandDelay
from drake_ispace.effects.places.velocity import VelocityDelay
from drake_ispace.explain.check.compare.links import LATENCY_S
from drake_ispace.explain.check.finding import Finding, named
from drake_ispace.explain.decide.decision import LEAST_FURTHER
from drake_ispace.explain.decide.survey.signatures import signatures
from drake_ispace.explain.decide.survey.view import scales_of
from drake_ispace.explain.fit.candidates import Candidate, candidates, probes
from drake_ispace.explain.fit.likelihood import merged
from drake_ispace.explain.predict.case import Case, part_of
from drake_ispace.explain.predict.prediction import Prediction
from drake_ispace.explain.predict.stretches import MOST_S
from drake_ispace.explain.threads import each
from drake_ispace.faults.repair import Clock
from drake_ispace.robots.robot import COMMAND

_PAST = 8  # residuals that the next one is predicted from
_MOST = round(LATENCY_S / TICK_S)  # ticks by which a clock is looked for
_LEAST_TICKS = 2  # by which encoders are off
_FOLLOWED = 3  # of the clocks tried in one run, those that are compared in all of them


def with_clocks_set(case: Case, names: list[str]) -> tuple[Case, list[Finding]]:
    """The case with one channel at the times at which it was, and the finding if its stamps were others.

    names: of all runs.
    """
    robot, prediction = case.replay.body.robot, case.prediction
    if not case.is_filtered or not prediction.channels["motion"]:
        return case, []
    driven, is_own, lacking = robot.driven, case.scenario is None, []
    if is_own:
        of_transmission = {name: e for name, e in case.effects_to_try.items() if e.card.home == "transmission"}
        if not of_transmission:
            return case, []
        lacking = candidates(of_transmission, case.replay.body)
    found = _Clocks(prediction, lacking)
    if driven == COMMAND or is_own:  # its samples may be rare, or the motion slow
        delay = VelocityDelay if driven == COMMAND else CommandDelay
        channel, ticks = driven, found.late(driven, round(delay.parameters[0].high / TICK_S))
    else:
        channel, ticks = found.clearest([driven, *["imu"] * robot.has_imu])
        if not ticks and robot.has_imu:  # the counts of encoders tell less, nothing of half a tick, and so of one
            channel, ticks = found.clearest(["encoder"])
            ticks = 0 if abs(ticks) < _LEAST_TICKS else ticks
        if ticks and channel != driven:
            tried = candidates(case.effects_to_try, case.replay.body)
            ticks = 0 if found.may_be_an_effect(channel, ticks, tried) else ticks
    if not ticks or (channel == driven and ticks < 0):  # a robot may follow late: a delay, a lag
        return case, []
    off = f"clock {abs(ticks) * TICK_S:.3g} s {'late' if ticks > 0 else 'early'}"
    others = {"imu": "torques and wheels", "encoder": "torques and IMU"}
    what = f"{off}, the wheels turn before" if channel == driven else f"{off} against {others[channel]}"
    finding = Finding(
        "clock_offset", what, channel, runs=tuple(range(len(names))), repairs=(Clock(channel, 1.0, -ticks * TICK_S),)
    )
    return case.with_earlier(channel, ticks), [named(finding, names)]


class _Clocks:
    """What residuals leave if a channel was so many ticks earlier than its stamps say.

    lacking: effects that the model may lack, so that what they explain does not count.
    """

    def __init__(self, prediction: Prediction, lacking: Sequence[Candidate]):
        lasted = np.cumsum([0] + [track.ticks * TICK_S for track in prediction.tracks])
        self._prediction = part_of(prediction, slice(int(np.searchsorted(lasted, MOST_S))))  # others say the same
        self._lefts = cache(self._lefts_of_all)
        self._lacking = [[] for _ in self._prediction.tracks]
        if lacking:
            base, scales = self._prediction.residuals({}), scales_of(self._prediction)
            found = {(s.candidate, s.at): s.change for s in signatures(self._prediction, {}, lacking, scales, base)}
            self._lacking = [[change[i]["motion"] for change in found.values()] for i in range(len(base))]

    def left(self, channel: str, ticks: int) -> float:
        """The most that is left with the channel so many ticks earlier."""
        return self._lefts(channel, ticks)[1]

    def _lefts_of_all(self, channel, ticks):
        return self._lefts_of(range(len(self._prediction.tracks)), channel, ticks)

    def _lefts_of(self, runs, channel, ticks, values=MappingProxyType({})):
        """The least and the most that is left with the channel so many ticks earlier.

        Of each run the rows are the same whatever the ticks are, or those that came with the same part of the channel,
        if it is moved by no more than a latency: a change near an end of a run, which no stamps may explain, is not in
        all of the rows.
        """
        tracks = [self._prediction.tracks[i].earlier(channel, ticks) for i in runs]
        starts = [self._prediction.starts[i] for i in runs]
        moved = replace(self._prediction, tracks=tracks, starts=starts).residuals(values)
        row_ticks = self._prediction.row_ticks
        most = math.ceil(_MOST / row_ticks)  # at the end what comes earlier has no samples of its own
        with_channel = most - min(max(round(ticks / row_ticks), -most), most)
        lefts = []
        for i, run in zip(runs, moved, strict=True):
            every = (run["motion"], *self._lacking[i])
            of_run = [
                _surprise(*(rows[first : len(rows) - 2 * most + first] for rows in every))
                for first in {most, with_channel}
            ]
            if None not in of_run:
                lefts.append((min(of_run), max(of_run)))
        return np.sum(lefts, axis=0) if lefts else (np.inf, np.inf)

    def clearest(self, channels: Sequence[str]) -> tuple[str, int]:
        """The channel that is off, and by how many ticks, at most a latency either way; 0 ticks where none is.

        Between the right ticks and none there may be worse ones. All are tried in the run in which most happens, and in
        the others those that are best there.
        """
        tried = [(channel, ticks) for channel in channels for ticks in range(-_MOST, _MOST + 1)]
        of_run = [float(np.abs(np.diff(track.command, axis=0)).sum()) for track in self._prediction.tracks]
        busiest = [int(np.argmax(of_run))]
        left = each(lambda one: self._lefts_of(busiest, *one)[1], tried)
        near = [tried[i] for i in np.argsort(left)[:_FOLLOWED]]
        channel, ticks = min(near, key=lambda one: self.left(*one))
        as_given = self.left(channel, 0)
        is_off = np.isfinite(as_given) and self.left(channel, ticks) < as_given - LEAST_FURTHER
        return channel, ticks if is_off else 0

    def may_be_an_effect(self, channel: str, ticks: int, lacking: Sequence[Candidate]) -> bool:
        """Whether one of these effects leaves less than a clock that is off by so much.

        An IMU behind a low-pass is late as well, and backlash makes wheels follow late.
        """
        scales, runs = scales_of(self._prediction), range(len(self._prediction.tracks))
        tried = [(candidate, np.array(z)) for candidate in lacking for z in probes(candidate, scales)]
        tried += [(candidate, 2.0 * z - candidate.neutral) for candidate, z in tried]
        values = [merged({candidate: candidate.within(z)}) for candidate, z in tried]
        left = each(lambda of_effect: self._lefts_of(runs, channel, 0, of_effect)[1], values)
        return min(left, default=np.inf) < self.left(channel, ticks)

    def late(self, channel: str, latest: int) -> int:
        """By how many ticks within a latency the channel is late, whatever lies between; 0 where it is not.

        Nor is it by up to half a sample, by which changes between samples are logged late on the average, or where the
        robot might as well follow late, by up to `latest` ticks.
        """
        step_s = max(track.command_step_s for track in self._prediction.tracks)
        ticks = min(range(_MOST + 1), key=lambda ticks: self.left(channel, ticks))
        least = self.left(channel, ticks)
        is_within_sample = 2 * ticks - 1 < round(step_s / TICK_S, 6)  # it is known to half a tick
        if not least < self.left(channel, 0) - LEAST_FURTHER or is_within_sample:
            return 0
        return ticks if all(self._lefts(channel, -delay)[0] > least for delay in range(1, latest + 1)) else 0


def _surprise(rows: np.ndarray, *lacking: np.ndarray) -> float | None:
    """-2 log likelihood, up to a constant, of what the past of residuals (k, p) of encoders and IMU does not tell.

    Slow errors, such as those of forces, do not count, nor does what the changes (k, p) in `lacking` explain.
    None of a run that is too short to tell; infinite where the model runs away.
    """
    if is_short(rows, len(lacking)):
        return None
    if not np.isfinite(rows).all():
        return np.inf
    if lacking:
        left, changes = unpredicted(rows, lacking)
        amounts = np.linalg.lstsq(changes, left, rcond=None)[0]
        rows = rows - np.tensordot(amounts, np.array(lacking), axes=1)
    past = _past(rows)
    left = rows[_PAST:] - past @ _told_by(past, rows)
    return len(left) * float(np.linalg.slogdet(left.T @ left / len(left))[1])


def is_short(rows: np.ndarray, changes: int) -> bool:
    """Whether residuals (k, p) are too few to be predicted from their past and explained by so many changes."""
    return len(rows) <= 2 * (_PAST * rows.shape[1] + changes)


def unpredicted(rows: np.ndarray, changes: Sequence[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """What the past of residuals (k, p) does not tell, (n,) in units of its RMS, and of m changes (k, p), (n, m)."""
    past = _past(rows)
    told = _told_by(past, rows)
    left = rows[_PAST:] - past @ told
    unit = 1.0 / (np.sqrt(np.mean(left**2, axis=0)) + 1e-300)
    columns = [((change[_PAST:] - _past(change) @ told) * unit).ravel() for change in changes]
    return (left * unit).ravel(), np.column_stack(columns)


def _past(rows):
    """(k - _PAST, _PAST p) the rows before each."""
    return np.hstack([rows[_PAST - i - 1 : len(rows) - i - 1] for i in range(_PAST)])


def _told_by(past, rows):
    """(_PAST p, p) coefficients by which the past of rows (k, p) predicts them best."""
    scale = np.sqrt(np.mean(past**2, axis=0)) + 1e-300
    past = past / scale
    return np.linalg.lstsq(past.T @ past, past.T @ rows[_PAST:], rcond=None)[0] / scale[:, None]
