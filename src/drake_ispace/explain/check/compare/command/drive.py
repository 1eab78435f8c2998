"""Wheels that follow a commanded velocity: how far they turned, and how far they would with some lateness and lag."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares
from scipy.signal import lfilter

from drake_ispace.blocks.rates import TICK_S
from drake_ispace.explain.check.compare.links import FEWEST, Base
from drake_ispace.explain.levels import BLOCK_TICKS
from drake_ispace.files.recording import Channel
from drake_ispace.plants.wheels import WheelGeometry

BLOCK_S = BLOCK_TICKS * TICK_S  # within which what a fit leaves may belong together


@dataclass(frozen=True)
class Drive:
    """A run's command and its wheels.

    Attributes:
        command: the channel. geometry: of the wheels. t: (k,) fine times [s]. edges: (m,) [s] of windows that are no
            shorter than a step of the command. turned: (m - 1, n) [rad] in these. step_s: of the command.
    """

    command: Channel
    geometry: WheelGeometry
    t: np.ndarray
    edges: np.ndarray
    turned: np.ndarray
    step_s: float

    @property
    def changes(self) -> np.ndarray:
        """(c, 3) by how much the command changes at each sample but the first."""
        return np.diff(self.command.values, axis=0)

    @property
    def ramps(self) -> bool:
        """Whether the command is no series of steps."""
        return ramps(self.changes)

    def held(self, earlier_s: np.ndarray | float = 0.0) -> np.ndarray:
        """(k, n) commanded rates [rad/s] of the wheels if each sample holds until the next; means over each fine time.

        earlier_s: () or (samples,) by how much each sample acts before it is logged.
        """
        since = self.command.t - earlier_s
        ways = np.vstack([np.zeros(3), np.cumsum(self.command.values[:-1] * np.diff(since)[:, None], axis=0)])
        end = max(since[-1], self.t[-1]) + TICK_S
        ways, since = np.vstack([ways, ways[-1] + self.command.values[-1] * (end - since[-1])]), np.append(since, end)
        edges = np.append(self.t, self.t[-1] + TICK_S)
        way = np.column_stack([np.interp(edges, since, column) for column in ways.T])
        return np.diff(way, axis=0) / TICK_S @ self.geometry.inverse.T

    def predicted(self, rates: np.ndarray, late_s: float, lag_s: float) -> np.ndarray:
        """(m - 1, n) turns [rad] of wheels that follow rates (k, n) so late, and then with that time constant."""
        keep = np.exp(-TICK_S / lag_s) if lag_s > 0.0 else 0.0
        reached = lfilter([1.0 - keep], [1.0, -keep], rates[:-1], axis=0)
        after = np.cumsum(rates[:-1] * TICK_S, axis=0) - lag_s * reached
        total = np.vstack([np.zeros(after.shape[1]), after])
        at = np.column_stack([np.interp(self.edges - late_s, self.t, column) for column in total.T])
        return np.diff(at, axis=0)


def ramps(changes: np.ndarray) -> bool:
    """Whether a change comes right after another one as often as not.

    changes: (c, n) by how much a command changes at each sample but the first.
    """
    changed = changes.any(axis=1)
    again = np.sum(changed[1:] & changed[:-1])
    return bool(again >= np.sum(changed) - again and changed.any())


def drive_of(command: Channel, base: Base) -> Drive | None:
    """The Drive of a run; None where too little was read, or where samples are finer than ticks."""
    if len(command.t) <= FEWEST:
        return None
    step_s, read = float(np.median(np.diff(command.t))), base.encoder.t
    inner = read[(read >= command.t[0] + 2.0 * step_s) & (read <= command.t[-1] - 2.0 * step_s)]
    if step_s < 0.99 * TICK_S or not len(inner):
        return None
    every = max(1, round(step_s / float(np.median(np.diff(read)))))
    edges = inner[::every]
    if len(edges) <= FEWEST:
        return None
    turned = np.diff(base.encoder.values[np.searchsorted(read, edges)], axis=0)
    return Drive(command, base.geometry, np.arange(command.t[0], command.t[-1], TICK_S), edges, turned, step_s)


@dataclass(frozen=True)
class Following:
    """How wheels follow a command: late [s], with a time constant [s] and a gain.

    squares: (blocks,) of what this leaves in each block of time.
    """

    late_s: float
    lag_s: float
    gain: float
    squares: np.ndarray

    def score_over(self, other: "Following") -> float:
        """Log likelihood ratio by how much less this leaves, from how the gain scatters from block to block."""
        gain = other.squares - self.squares
        error = np.std(gain) / np.sqrt(len(gain))
        return 0.0 if gain.mean() <= 0.0 else 0.5 * float(gain.mean() / (error + 1e-12)) ** 2


def best_following(pairs: Sequence[tuple[Drive, np.ndarray]], step_s: float, earliest: float) -> Following:
    """The best lateness, lag and gain with which wheels follow the commanded rates (k, n) of their run.

    earliest: the least lateness, in steps of the command.
    """
    scale = np.sqrt(np.mean(np.concatenate([drive.turned.ravel() for drive, _ in pairs]) ** 2)) or 1.0

    def of(x):  # derivatives are differences over a share of x, which is therefore never near 0
        return (x[0] - 1.0 + earliest) * step_s, (x[1] - 1.0) * step_s, x[2]

    def left(x):
        late, lag, gain = of(x)
        each = [drive.turned - gain * drive.predicted(rates, late, lag) for drive, rates in pairs]
        return np.concatenate(each).ravel() / scale

    starts = [(1.0 + late, 1.0 + lag, 1.0) for late in (0.0, 0.5, 1.0, 4.0) for lag in (0.0, 1.0, 4.0)]
    least = min(starts, key=lambda x: float(np.sum(left(x) ** 2)))
    fit = least_squares(left, least, bounds=([1.0, 1.0, 0.1], [40.0, 100.0, 10.0]), diff_step=1e-2)
    blocks = np.concatenate([np.floor(drive.edges[:-1] / BLOCK_S) + 1e6 * i for i, (drive, _) in enumerate(pairs)])
    squares = (fit.fun**2).reshape(len(blocks), -1).sum(axis=1)
    late, lag, gain = map(float, of(fit.x))
    return Following(late, lag, gain, np.bincount(np.unique(blocks, return_inverse=True)[1], squares))
