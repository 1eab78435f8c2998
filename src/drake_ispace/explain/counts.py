"""Counts of an encoder: how far apart they are, and the straightest motion that agrees with them."""

import numpy as np

from drake_ispace.blocks.kernels import kernel

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
    """(k,) the shortest path from the first of `middle` (k,) to the last, nowhere farther from it than `half`."""
    if half == 0.0 or len(t) < 3:
        return middle
    reach = np.full(len(t), half)
    reach[-1] = 0.0
    ends, corners = np.stack([middle + reach, middle - reach]), np.empty((len(t), 2))
    ends[:, 0] = middle[0]
    return np.interp(t, *corners[: _pull(np.asarray(t, dtype=float), ends, corners)].T)


@kernel
def _slope(one, other):
    """Slope of the line from one point (2,) to another."""
    return (other[1] - one[1]) / (other[0] - one[0])


@kernel(nogil=True)
def _pull(t, ends, corners):
    """Write times and angles of the corners of a string pulled taut into `corners` (k, 2); how many there are.

    t (k,): of gates with upper and lower ends (2, k). Shortest paths from the last corner that is certain to either end
    of a gate, one along its upper and one along its lower ends, are carried on from gate to gate. Where they meet, the
    corner is certain.
    """
    path, first, last = np.empty((2, len(t), 2)), np.zeros(2, np.int64), np.zeros(2, np.int64)
    end, count = np.empty(2), 1
    corners[0, 0] = path[0, 0, 0] = path[1, 0, 0] = t[0]
    corners[0, 1] = path[0, 0, 1] = path[1, 0, 1] = ends[0, 0]
    for i in range(1, len(t)):
        for own in range(2):
            other, side = 1 - own, 1.0 - 2.0 * own
            end[0], end[1] = t[i], ends[own, i]
            while last[own] > first[own]:
                before, here = path[own, last[own] - 1], path[own, last[own]]
                if side * (_slope(here, end) - _slope(before, here)) > 0.0:
                    break
                last[own] -= 1
            while last[own] == first[own] and last[other] > first[other]:
                start, turn = path[own, first[own]], path[other, first[other] + 1]
                if side * (_slope(start, end) - _slope(path[other, first[other]], turn)) > 0.0:
                    break
                first[other] += 1
                start[0], start[1] = corners[count, 0], corners[count, 1] = turn[0], turn[1]
                count += 1
            last[own] += 1
            path[own, last[own], 0], path[own, last[own], 1] = end[0], end[1]
    for i in range(first[0] + 1, last[0] + 1):
        corners[count, 0], corners[count, 1] = path[0, i, 0], path[0, i, 1]
        count += 1
    return count
