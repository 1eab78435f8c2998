"""Counts of an encoder: how far apart they are, and the straightest motion that agrees with them."""

from collections import deque

import numpy as np

_ALIKE = 0.01  # steps that differ by less, as a share of the smallest one, are alike
_WHOLE = 0.1  # how far from a whole number of counts a step may be


def smallest_step(angles: np.ndarray, most: float) -> float:
    """The smallest step [rad] from sample to sample of angles (k, n); `most` if there is none or all are larger."""
    return float(np.min(_steps(angles), initial=most))


def count_of(angles: np.ndarray) -> float:
    """The count [rad] of which all changes from sample to sample of angles (k,) or (k, n) are whole multiples.

    It is 0 where there is none: a wheel that never turned, or an exact encoder.
    """
    steps = np.unique(_steps(angles))
    if not len(steps):
        return 0.0
    apart = np.diff(steps)
    count = float(min(steps[0], np.min(apart[apart > _ALIKE * steps[0]], initial=np.inf)))
    of_count = steps / count
    return count if np.all(np.abs(of_count - np.round(of_count)) < _WHOLE) else 0.0


def _steps(angles):
    """(m,) all changes from sample to sample that are not rounding of the angles themselves."""
    rounding = np.finfo(float).eps * len(angles) * np.max(np.abs(angles), initial=0.0)
    steps = np.abs(np.diff(angles, axis=0))
    return steps[steps > rounding]


def straightened(t: np.ndarray, angles: np.ndarray) -> np.ndarray:
    """The straightest motion of every wheel that agrees with its counts.

    A count says that a wheel is within half a count of it. Of all motions for which this holds at every sample the
    shortest one is taken, a string pulled taut. Where a robot stands between two counts is then known far better than
    to a count, and does not jump with the instant at which one looks. Angles that are not counted hardly change.

    Args:
        t: (k,) ascending times [s]. angles: (k, n) [rad].

    Returns:
        (k, n) angles [rad], each within half a count of the measured one.
    """
    paths = [_taut(t, column, 0.5 * count_of(column)) for column in angles.T]
    return np.column_stack(paths) if paths else angles


def _taut(t, middle, half):
    """(k,) the shortest path from the first of `middle` (k,) to the last that is nowhere farther from it than `half`.

    Shortest paths from the last corner that is certain to either end of a gate, one along its upper and one along its
    lower ends, are carried on from gate to gate. Where they meet, the corner is certain.
    """
    if half == 0.0 or len(t) < 3:
        return middle
    start = (t[0], middle[0])
    corners, upper, lower = [start], deque([start]), deque([start])
    reach = np.full(len(t), half)
    reach[-1] = 0.0
    ends = {1.0: (middle + reach).tolist(), -1.0: (middle - reach).tolist()}
    for i, when in enumerate(t.tolist()[1:], 1):
        for side, own, other in ((1.0, upper, lower), (-1.0, lower, upper)):
            end = (when, ends[side][i])
            while len(own) > 1 and side * (_slope(own[-1], end) - _slope(own[-2], own[-1])) <= 0.0:
                own.pop()
            while len(own) == 1 < len(other) and side * (_slope(own[0], end) - _slope(other[0], other[1])) <= 0.0:
                other.popleft()
                own[0] = other[0]
                corners.append(own[0])
            own.append(end)
    corners += list(upper)[1:]
    return np.interp(t, *np.transpose(corners))


def _slope(one, other):
    return (other[1] - one[1]) / (other[0] - one[0])
