"""The offset between two clocks, from the motion that logs of both show."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize_scalar
from scipy.signal import fftconvolve
from scipy.stats import t as student_t

from drake_ispace.blocks.errors import InputError

_GRID_S = 0.02  # of the first search
_WINDOW_S = 0.3  # over which a camera's positions are made a speed
_BLOCKS = 10  # of which one at a time is left out, for the interval
_LEAST_OVERLAP_S = 5.0
_LEAST_ALIKE = 0.6  # correlation at the best offset
_LEAST_CHANGE = 0.01  # of a rate, as a share of it
_NEVER_ALIKE = 0.01  # share of the variance that two sensors never have in common
_LIKELIER = np.log(1000.0)  # by how much it must be likelier than any other
_ELSEWHERE_S = 1.0


@dataclass(frozen=True)
class Offset:
    """What a clock shows less what the other shows: an estimate and its 90 % interval [s]."""

    offset_s: float
    half_width_s: float

    def __str__(self) -> str:
        low, high = self.offset_s - self.half_width_s, self.offset_s + self.half_width_s
        return f"{self.offset_s:.4f} s [{low:.4f}, {high:.4f}]"


def offset_of(
    wheel_t: np.ndarray, moved: np.ndarray, fix_t: np.ndarray, poses: np.ndarray, where: str = "clocks"
) -> Offset:
    """What the clock of the fixes shows less that of the wheels.

    Speed and turning rate of both are compared; sizes of wheels and track matter little, because how much of one is in
    the other is fitted. A delay of the fixes cannot be told from an offset of their clock: it is part of the number.

    Args:
        wheel_t: (n,) [s]; moved: (n, 2) distance and heading since the start by the wheels [m, rad].
        fix_t: (k,) [s]; poses: (k, 3) x, y [m], phi [rad].

    Raises:
        InputError: runs too short, or a motion that does not tell the offset. It begins with `where`.
    """
    if min(np.ptp(wheel_t), np.ptp(fix_t)) < _LEAST_OVERLAP_S:
        raise InputError(f"{where}: a run of less than {_LEAST_OVERLAP_S:g} s, expected a longer one to compare clocks")
    seen_t, seen = _rates(fix_t, np.column_stack([_travelled(poses), np.unwrap(poses[:, 2])]))
    start = _coarse(wheel_t, moved, seen_t, seen, where)
    whole = _fine(wheel_t, moved, seen_t, seen, start, _GRID_S)
    blocks = np.array_split(np.arange(len(seen_t)), _BLOCKS)
    kept = [np.setdiff1d(np.arange(len(seen_t)), block) for block in blocks]
    without = np.array([_fine(wheel_t, moved, seen_t[k], seen[k], whole, _GRID_S) for k in kept])
    spread = np.sqrt((_BLOCKS - 1.0) / _BLOCKS * ((without - without.mean()) ** 2).sum())
    return Offset(float(whole), float(student_t.ppf(0.95, _BLOCKS - 1) * spread))


def _travelled(poses):
    """(k,) signed distance along the way: forward where the robot looks along its motion."""
    step = np.diff(poses[:, :2], axis=0)
    ahead = np.column_stack([np.cos(poses[:-1, 2]), np.sin(poses[:-1, 2])])
    return np.concatenate([[0.0], np.cumsum(np.hypot(*step.T) * np.where((step * ahead).sum(axis=1) < 0.0, -1.0, 1.0))])


def _rates(t, values):
    """Times in the middle of windows, and (m, 2) mean rates within them."""
    after = np.searchsorted(t, t + _WINDOW_S)
    begin = np.flatnonzero(after < len(t))
    end = after[begin]
    near = t[end] - t[begin] < 2.0 * _WINDOW_S  # no gap within
    begin, end = begin[near], end[near]
    return (t[begin] + t[end]) / 2.0, (values[end] - values[begin]) / (t[end] - t[begin])[:, None]


def _at(wheel_t, moved, seen_t, offset_s):
    """(m, 2) rates by the wheels at the times of the fixes, and whether the wheels cover them."""
    half, t = _WINDOW_S / 2.0, seen_t - offset_s
    covered = (t - half >= wheel_t[0]) & (t + half <= wheel_t[-1])
    before, after = (np.column_stack([np.interp(t + d, wheel_t, column) for column in moved.T]) for d in (-half, half))
    return (after - before) / _WINDOW_S, covered


def _coarse(wheel_t, moved, seen_t, seen, where):
    """The offset at which both motions are the most alike, on a grid, by correlation over all overlaps."""
    half = _WINDOW_S / 2.0
    grid = np.arange(wheel_t[0] + half, wheel_t[-1] - half, _GRID_S)
    driven = np.column_stack([
        (np.interp(grid + half, wheel_t, column) - np.interp(grid - half, wheel_t, column)) / _WINDOW_S
        for column in moved.T
    ])
    looks = np.arange(seen_t[0], seen_t[-1], _GRID_S)
    shown = np.column_stack([np.interp(looks, seen_t, column) for column in seen.T])
    both = _changes(driven) & _changes(shown)
    a, b = _scaled(driven[:, both]), _scaled(shown[:, both])
    overlap = fftconvolve(np.ones(len(looks)), np.ones(len(grid)))
    scores = sum((fftconvolve(one, other[::-1]) for one, other in zip(b.T, a.T, strict=True)), np.zeros(len(overlap)))
    energy = fftconvolve((b**2).sum(axis=1), np.ones(len(grid))) * fftconvolve(
        np.ones(len(looks)), (a**2).sum(axis=1)[::-1]
    )
    least = min(_LEAST_OVERLAP_S / _GRID_S, 0.5 * min(len(grid), len(looks)))
    alike = np.where(overlap >= least, scores / np.sqrt(np.maximum(energy, 1e-12)), 0.0)
    lags = looks[0] - grid[0] + _GRID_S * (np.arange(len(alike)) - (len(grid) - 1))
    best = int(alike.argmax())
    elsewhere = np.abs(lags - lags[best]) > _ELSEWHERE_S
    second = alike[elsewhere].max(initial=0.0)
    windows = overlap[best] * _GRID_S / _WINDOW_S  # about as many numbers are independent
    left, left_elsewhere = (1.0 - one**2 + _NEVER_ALIKE for one in (alike[best], second))
    likelier = windows * np.log(left_elsewhere / left)
    if alike[best] < _LEAST_ALIKE or likelier < _LIKELIER:
        raise InputError(
            f"{where}: the motion does not tell the offset of the clocks (alike by {alike[best]:.2f} at "
            f"{lags[best]:.2f} s, by {second:.2f} elsewhere), expected a run that turns and stops, or offset_s: 0 "
            "for `drake-ispace check` to find it, and wheels in another order or sense, which go with no camera either"
        )
    return float(lags[best])


def _changes(rates):
    """(2,) whether a rate changes at all: one that does not tells nothing."""
    return rates.std(axis=0) > _LEAST_CHANGE * np.sqrt((rates**2).mean(axis=0))


def _scaled(rates):
    return (rates - rates.mean(axis=0)) / rates.std(axis=0)


def _fine(wheel_t, moved, seen_t, seen, start, reach_s):
    """The offset near `start` at which the wheels explain most of what is seen, each rate by a factor of its own."""
    def left(offset_s):
        driven, covered = _at(wheel_t, moved, seen_t, offset_s)
        total = 0.0
        for a, b in zip(driven[covered].T, seen[covered].T, strict=True):
            scale = b.std() or 1.0
            factor = a @ b / max(a @ a, 1e-12)
            total += ((b - factor * a) ** 2).mean() / scale**2
        return total

    return _least(left, start, 2.0 * reach_s)


def _least(function: Callable[[float], float], start: float, reach: float) -> float:
    """The place of the least value near `start`; steps are counted from there, as a stamp since 1970 has few digits."""
    found = minimize_scalar(
        lambda step: function(start + step), bounds=(-reach, reach), method="bounded", options={"xatol": 1e-6}
    )
    return start + float(found.x)
