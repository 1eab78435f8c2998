"""Robots followed through a video: which of those that look alike is which.

Each robot is a point that moves with a velocity, which random accelerations change. Sightings are given to robots so
that as many as possible are explained, and among these choices the likeliest is taken. A robot that is hidden keeps
its name: the longer it is hidden, the further away it may be. Where another choice is nearly as likely, the name is
kept but no longer sure.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.optimize import linear_sum_assignment

from drake_ispace.vision.finding.eye import Eye
from drake_ispace.vision.finding.patterns import Sighting

_UNLIKELIER = 2.0 * np.log(1000.0)  # another choice that is a thousand times less likely is no longer considered
_IMPOSSIBLE = 1e9
_PUSH_S = 0.1  # for which an acceleration lasts, until another one comes that has nothing to do with it


class _Track:
    """Where a robot was when it was seen last, and how surely one knows where it is now, in each direction alike."""

    def __init__(self, place, time_s, noise_m, speed_m_s):
        self.place, self.velocity, self.time_s, self.sure = np.array(place), np.zeros(2), time_s, True
        self._covariance = np.diag([noise_m**2, speed_m_s**2])

    def predicted(self, time_s, acceleration_m_s2):
        """(2,) place at a time, and the (2, 2) covariance of place and velocity then."""
        ahead = time_s - self.time_s
        step = np.array([[1.0, ahead], [0.0, 1.0]])
        pushed = acceleration_m_s2**2 * _PUSH_S * np.array([[ahead**3 / 3.0, ahead**2 / 2.0], [ahead**2 / 2.0, ahead]])
        return self.place + ahead * self.velocity, step @ self._covariance @ step.T + pushed

    def update(self, place, time_s, noise_m, acceleration_m_s2):
        predicted, covariance = self.predicted(time_s, acceleration_m_s2)
        gain, missed = covariance[:, 0] / (covariance[0, 0] + noise_m**2), place - predicted
        self.velocity = self.velocity + gain[1] * missed
        self.place, self.time_s = predicted + gain[0] * missed, time_s
        self._covariance = covariance - np.outer(gain, covariance[0])


class Tracker:
    """Finds robots in the frames of a video, and tells those that look alike by the way they came.

    Args:
        eye: that finds them.
        starts: name -> x, y [m] in the first frame, of robots that look alike; without it they are named from left to
            right in the order in which the eye lists them.
        acceleration_m_s2: how robots speed up and are pushed, rms; most_speed_m_s: no robot is faster.
    """

    def __init__(
        self, eye: Eye, starts: Mapping[str, Sequence[float]] | None = None, acceleration_m_s2: float = 3.0,
        most_speed_m_s: float = 3.0,
    ):
        self._eye, self._starts = eye, dict(starts or {})
        self._acceleration_m_s2, self._most_speed_m_s = acceleration_m_s2, most_speed_m_s
        self._noise_m = {target.name: max(look.top.pixel_m) for look in eye.looks for target in look.targets}
        self._tracks: dict[str, _Track] = {}

    def follow(self, time_s: float, image: np.ndarray) -> dict[str, Sighting | None]:
        """Name -> its sighting in the next frame, None where it is not seen. Times [s] must increase.

        Raises:
            InputError: an image of another size or kind.
        """
        result: dict[str, Sighting | None] = {}
        for names, found in self._eye.see(image):
            result |= dict.fromkeys(names) | self._named(names, found, time_s)
        return result

    def _named(self, names, found, time_s):
        """Name -> sighting, of the robots of one pattern."""
        known = [name for name in names if name in self._tracks]
        named, left = {}, list(found)
        if known and found:
            cost = self._cost(known, found, time_s)
            for i, j in _assigned(cost):
                left = [one for one in left if one is not found[j]]
                doubtful = _exchangeable(cost, i, j)
                if doubtful and len(found) > len(names):  # one of them is no robot
                    continue
                for k in doubtful:
                    self._tracks[known[k]].sure = False
                named[known[i]] = found[j]
        named |= self._new([name for name in names if name not in known], left)
        for name, one in named.items():
            place = np.array([one.x, one.y])
            if name in known:
                self._tracks[name].update(place, time_s, self._noise_m[name], self._acceleration_m_s2)
            else:
                self._tracks[name] = _Track(place, time_s, self._noise_m[name], self._most_speed_m_s)
        return {name: replace(one, sure=self._tracks[name].sure) for name, one in named.items()}

    def _new(self, names, left):
        """Names for robots that no track explains; none if there are more of them than robots without a track."""
        if not names or not left or len(left) > len(names):
            return {}
        starts = [self._starts.get(name) for name in names]
        if all(start is not None for start in starts):
            apart = np.array([[np.hypot(one.x - x, one.y - y) for one in left] for x, y in starts])
            return {names[i]: left[j] for i, j in _assigned(apart**2)}
        return dict(zip(names, sorted(left, key=lambda one: (one.x, one.y)), strict=False))

    def _cost(self, names, found, time_s):
        """(robots, sightings) -2 log likelihood that a robot is seen there."""
        cost = np.full((len(names), len(found)), _IMPOSSIBLE)
        for i, name in enumerate(names):
            track = self._tracks[name]
            place, covariance = track.predicted(time_s, self._acceleration_m_s2)
            variance = covariance[0, 0] + self._noise_m[name] ** 2
            reach = self._most_speed_m_s * (time_s - track.time_s) + 3.0 * self._noise_m[name]
            for j, one in enumerate(found):
                here = np.array([one.x, one.y])
                if np.hypot(*(here - track.place)) <= reach:
                    cost[i, j] = ((here - place) ** 2).sum() / variance + 2.0 * np.log(variance)
        return cost


def _assigned(cost):
    """Pairs (i, j) of the cheapest assignment with the most possible pairs."""
    return [(i, j) for i, j in zip(*linear_sum_assignment(cost), strict=True) if cost[i, j] < _IMPOSSIBLE]


def _total(cost):
    return float(cost[linear_sum_assignment(cost)].sum())


def _exchangeable(cost, i, j):
    """The robots of an assignment in which the robot i is seen elsewhere, or another one at j, and which is nearly as
    likely as the cheapest."""
    best, robots = _total(cost), set()
    others = [(i, b) for b in range(cost.shape[1]) if b != j] + [(a, j) for a in range(cost.shape[0]) if a != i]
    for a, b in others:
        rest = np.delete(np.delete(cost, a, axis=0), b, axis=1)
        if cost[a, b] + (_total(rest) if rest.size else 0.0) < best + _UNLIKELIER:
            robots |= {i, a}
    return robots
