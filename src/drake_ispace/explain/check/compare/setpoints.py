"""Is a commanded velocity held until the next sample, or a setpoint that moves on in between?

Wheels can only lag behind a command that is held. Where they lead it, the log shows some instants of something else.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares
from scipy.signal import lfilter

from drake_ispace.blocks.rates import TICK_S
from drake_ispace.explain.check.compare.agreement import SAID
from drake_ispace.explain.check.compare.links import FEWEST, Base
from drake_ispace.explain.check.finding import Finding
from drake_ispace.faults.repair import Interpolated, rows
from drake_ispace.files.recording import Channel, Recording
from drake_ispace.robots.robot import COMMAND

_MOST_S = 160.0  # of all runs together
_BLOCK_S = 1.0  # within which what a fit leaves may belong together
_FINE = 0.5 * TICK_S  # of the time in which commands act
_NEAR = 0.25  # steps of the command: nearer to its sample than to half-way to the next


@dataclass(frozen=True)
class _Drive:
    """A run's command and its wheels.

    Attributes:
        t: (k,) fine times [s]. held, between: (k, n) commanded rates [rad/s] of the wheels, each held until the next
            sample, or along a smooth curve. edges: (m,) [s] of windows that
            are no shorter than a step of the command. turned: (m - 1, n) [rad] in these. step_s: of the command.
    """

    t: np.ndarray
    held: np.ndarray
    between: np.ndarray
    edges: np.ndarray
    turned: np.ndarray
    step_s: float

    def predicted(self, rates: np.ndarray, late_s: float, lag_s: float) -> np.ndarray:
        """(m - 1, n) turns [rad] of wheels that follow rates (k, n) so late, and then with that time constant."""
        keep = np.exp(-_FINE / lag_s) if lag_s > 0.0 else 0.0
        reached = lfilter([1.0 - keep], [1.0, -keep], rates[:-1], axis=0)
        after = np.cumsum(rates[:-1] * _FINE, axis=0) - lag_s * reached
        total = np.vstack([np.zeros(after.shape[1]), after])
        at = np.column_stack([np.interp(self.edges - late_s, self.t, column) for column in total.T])
        return np.diff(at, axis=0)


def setpoint_findings(runs: Sequence[Recording], bases: Sequence[Base | None]) -> list[Finding]:
    """The finding that all runs together log a setpoint that moves on between its samples; or none.

    bases: of the runs, None where there are no wheels to compare.
    """
    drives = {
        i: drive for i, (run, base) in enumerate(zip(runs, bases, strict=True))
        if base is not None and COMMAND in run.channels and base.robot.driven == COMMAND
        and (drive := _drive(run.channels[COMMAND], base, _MOST_S / len(runs))) is not None
    }
    if not drives:
        return []
    step_s = float(np.median([drive.step_s for drive in drives.values()]))

    def fit(rates, earliest):
        return _fit([(drive, getattr(drive, rates)) for drive in drives.values()], step_s, earliest)

    held, between = fit("held", 0.0), fit("between", -_NEAR)
    score = between.score_over(held)
    if score < SAID or max(held.late_s, between.late_s) > _NEAR * step_s:
        return []
    score = min(score, between.score_over(fit("between", _NEAR)))
    if score < SAID or fit("between", -2.0).score_over(between) >= SAID:  # the latter: logged late, too
        return []
    return [Finding(
        "command_sampled", "the wheels lead what is held", "", tuple(drives), COMMAND, drop_in_deviance=2.0 * score,
        repairs=(Interpolated(COMMAND, TICK_S),),
    )]


def _drive(command: Channel, base: Base, most_s: float) -> _Drive | None:
    """The middle `most_s` of a run; None where the command mostly stays as it is, or too little was read."""
    middle = 0.5 * (command.t[0] + command.t[-1])
    command = rows(command, np.abs(command.t - middle) <= 0.5 * most_s)
    if len(command.t) <= FEWEST:
        return None
    steps = np.diff(command.values, axis=0).any(axis=1)
    step_s = float(np.median(np.diff(command.t)))
    if step_s < 2.0 * TICK_S or np.mean(steps) < 0.5:
        return None
    read = base.encoder.t
    inner = read[(read >= command.t[0] + 2.0 * step_s) & (read <= command.t[-1] - 2.0 * step_s)]
    if not len(inner):
        return None
    every = max(1, round(step_s / float(np.median(np.diff(read)))))
    edges = inner[::every]
    if len(edges) <= FEWEST:
        return None
    t = np.arange(command.t[0], command.t[-1], _FINE)
    held = command.values[np.searchsorted(command.t, t + 1e-9, side="right") - 1]
    between = Interpolated(COMMAND, _FINE).between(command).values
    wheels, at = base.geometry.inverse.T, np.searchsorted(read, edges)
    return _Drive(t, held @ wheels, between @ wheels, edges, np.diff(base.encoder.values[at], axis=0), step_s)


@dataclass(frozen=True)
class _Fit:
    """How late wheels follow [s], and the squares (blocks,) that this leaves in each block of time."""

    late_s: float
    squares: np.ndarray

    def score_over(self, other: "_Fit") -> float:
        """Log likelihood ratio by how much less this leaves, from how the gain scatters from block to block."""
        gain = other.squares - self.squares
        error = np.std(gain) / np.sqrt(len(gain))
        return 0.0 if gain.mean() <= 0.0 else 0.5 * float(gain.mean() / (error + 1e-12)) ** 2


def _fit(pairs: Sequence[tuple[_Drive, np.ndarray]], step_s: float, earliest: float) -> _Fit:
    """The best lateness, lag and gain with which wheels follow the commanded rates (k, n) of their run.

    earliest: the least lateness, in steps of the command.
    """
    scale = np.sqrt(np.mean(np.concatenate([drive.turned.ravel() for drive, _ in pairs]) ** 2)) or 1.0

    def left(x):  # derivatives are differences over a share of x, which is therefore never near 0
        late, lag, gain = (x[0] - 1.0 + earliest) * step_s, (x[1] - 1.0) * step_s, x[2]
        each = [drive.turned - gain * drive.predicted(rates, late, lag) for drive, rates in pairs]
        return np.concatenate(each).ravel() / scale

    starts = [(1.0 + late, 1.0 + lag, 1.0) for late in (0.0, 0.5, 1.0, 4.0) for lag in (0.0, 2.0)]
    least = min(starts, key=lambda x: float(np.sum(left(x) ** 2)))
    fit = least_squares(left, least, bounds=([1.0, 1.0, 0.1], [40.0, 100.0, 10.0]), diff_step=1e-2)
    blocks = np.concatenate([np.floor(drive.edges[:-1] / _BLOCK_S) + 1e6 * i for i, (drive, _) in enumerate(pairs)])
    squares = (fit.fun**2).reshape(len(blocks), -1).sum(axis=1)
    by_block = np.bincount(np.unique(blocks, return_inverse=True)[1], squares)
    return _Fit(float(fit.x[0] - 1.0 + earliest) * step_s, by_block)
