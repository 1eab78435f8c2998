"""Free-run simulation of a user's own plant: errors of whole runs in which nothing corrects the model, and their fit.

The recorded torque is replayed open loop, and the simulated wheels are compared with the measured ones. Unknown forces
add up in such a simulation. Sizes that suit the innovations of a filter are therefore not quite the sizes that simulate
whole runs best; `fitted` finds the latter.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
from scipy.optimize import least_squares

from drake_ispace.blocks.rates import TICK_S
from drake_ispace.explain.fit.candidates import Candidate
from drake_ispace.explain.fit.likelihood import Point, merged
from drake_ispace.explain.predict.own_replay import OwnReplay
from drake_ispace.explain.predict.prediction import wheel_speeds
from drake_ispace.explain.predict.replay import Values
from drake_ispace.explain.predict.tracks import Track

_STEP = 1e-3  # of a start, as a share, and of its squared errors, below which it is found
_MOST_STEPS = 8  # in which a start is found
_FAR = 1e6  # rad, rad/s: the error of a simulation that runs away
_LOGGED = {"angle": ("simulated wheel angle", "rad"), "speed": ("simulated wheel speed", "rad/s")}


@dataclass(frozen=True)
class Sizes:
    """The sizes with which free-run simulations come nearest to some runs.

    Attributes:
        point: effects and their coordinates. plant: the plant's free parameters, name -> value. stds: coordinate ->
            standard deviation as the runs differ from each other (sandwich estimate); NaN of a single run.
        held: effects whose coordinates no fit moves.
    """

    point: Point
    plant: Mapping[str, float]
    stds: Mapping[tuple[Candidate, int], float] = field(default_factory=dict)
    held: Collection[Candidate] = ()


def fitted(replay: OwnReplay, tracks: Sequence[Track], start: Point, held: Collection[Candidate] = ()) -> Sizes:
    """Least-squares fit of free-run simulations to all ticks of all runs, within the bounds of the effects.

    start: coordinates of the effects to begin with; the plant's free parameters begin with the plant's own values.
    held: effects that stay as they begin.
    """
    begin = Sizes(start, replay.free, held=held)
    order, given = _numbers(begin)
    if not len(given):
        return begin
    solution, units = _least_squares(replay, tracks, begin)
    found = _with(begin, solution.x * units)
    ends = np.cumsum([errors(replay, track, {}).size for track in tracks])[:-1]
    stds = (_stds(solution, ends) * units)[len(replay.free) :]
    return replace(found, stds=dict(zip(order, map(float, stds), strict=True)))


def _least_squares(replay, tracks, start, most=None):
    """The solution of the fit that begins with the Sizes `start`, and the units (k,) of its numbers; most: evaluations.
    """
    order, given = _numbers(start)
    units = np.where(given == 0.0, 1.0, np.abs(given))
    bounds = [(0.0, np.inf) if value > 0.0 else (-np.inf, 0.0) for value in start.plant.values()]
    bounds += [candidate.bounds[i] for candidate, i in order]

    def residuals(z):
        return errors_of(replay, tracks, _with(start, z * units))

    low, high = np.transpose(bounds) / units
    return least_squares(residuals, given / units, bounds=(low, high), x_scale="jac", max_nfev=most), units


def _numbers(sizes):
    """(effect, number of the coordinate) of every coordinate, and (k,) the plant's parameters and then these."""
    moved = {candidate: z for candidate, z in sizes.point.items() if candidate not in sizes.held}
    order = [(candidate, i) for candidate, z in moved.items() for i in range(len(z))]
    return order, np.array([*sizes.plant.values(), *(sizes.point[candidate][i] for candidate, i in order)])


def _with(sizes, numbers):
    """The Sizes with other numbers (k,)."""
    left = iter(map(float, numbers))
    plant = {name: next(left) for name in sizes.plant}
    point = {c: list(z) if c in sizes.held else [next(left) for _ in z] for c, z in sizes.point.items()}
    return replace(sizes, point=point, plant=plant)


def shifts_of(point: Point) -> list[Candidate]:
    """The effects that shift steps in time. They add nothing up over a run: what a filter says of them is nearer."""
    return [candidate for candidate in point if candidate.shifts]


def _stds(solution, ends):
    """(k,) standard deviations of what was fitted, each run's part of the gradient being independent of the others'."""
    runs = len(ends) + 1
    if runs == 1:
        return np.full(len(solution.x), np.nan)
    scores = np.stack([
        j.T @ e for j, e in zip(np.split(solution.jac, ends), np.split(solution.fun, ends), strict=True)
    ])
    normal = np.linalg.pinv(solution.jac.T @ solution.jac)
    return np.sqrt(np.diag(normal @ scores.T @ scores @ normal) * runs / (runs - 1.0))


def errors(replay: OwnReplay, track: Track, values: Values, plant: Mapping[str, float] | None = None) -> np.ndarray:
    """(rows, n) simulated less measured wheel angles [rad] or speeds [rad/s], whichever the robot logged.

    A run that begins in motion is simulated from the angles and rates with which it comes nearest to the measurement,
    to first order in these, so that a fit finds slopes.
    plant: other values of the plant's own parameters, by name.
    """
    difference_from = partial(_difference_from, replay, track, values, plant)
    if not track.unscored_ticks:
        return difference_from(None)
    start = _start_of(track)
    difference = difference_from(start)
    steps = np.diag(_STEP * np.maximum(np.abs(start), 1.0))
    slopes = np.stack([difference_from(start + step) - difference for step in steps], axis=-1)
    share = np.linalg.lstsq(slopes.reshape(-1, len(start)), difference.ravel(), rcond=None)[0]
    return np.clip(difference - slopes @ share, -_FAR, _FAR)


def errors_from_nearest(replay: OwnReplay, track: Track, sizes: Sizes) -> np.ndarray:
    """(rows, n) as of `errors`, of a part of a run from where it comes nearest, however far that is from linear.

    What grows fast, as a fall, is so within a second.
    """
    difference_from = partial(_difference_from, replay, track, merged(sizes.point), sizes.plant)
    start = _start_of(track)
    units = np.maximum(np.abs(start), 1.0)

    def moved(by):
        return start + (by - 1.0) * units

    nearest = least_squares(
        lambda by: difference_from(moved(by)).ravel(), np.ones(len(start)), diff_step=_STEP, ftol=_STEP,
        max_nfev=_MOST_STEPS,
    )
    return difference_from(moved(nearest.x))


def _difference_from(replay, track, values, plant, start) -> np.ndarray:
    """(rows, n) simulated from a start less measured; None: from rest."""
    difference = _logged(replay, track, replay.simulated(track, values, plant, start)) - measured(replay, track)
    return np.clip(np.nan_to_num(difference, nan=_FAR), -_FAR, _FAR)


def _start_of(track) -> np.ndarray:
    """(2 n,) angles and rates at the begin, as the log shows them."""
    return np.concatenate([track.measured[0], wheel_speeds(track.measured[: track.ticks])[0]])


def errors_of(replay: OwnReplay, tracks: Sequence[Track], sizes: Sizes) -> np.ndarray:
    """(rows,) `errors` of all runs, one after the other."""
    return np.concatenate([errors(replay, track, merged(sizes.point), sizes.plant).ravel() for track in tracks])


def slopes(replay: OwnReplay, tracks: Sequence[Track], sizes: Sizes) -> np.ndarray:
    """(k, rows) changes of `errors_of` with each of the numbers that `fitted` moves."""
    solution, units = _least_squares(replay, tracks, sizes, most=1)
    return solution.jac.T / units[:, None]


def error_of(replay: OwnReplay, tracks: Sequence[Track], sizes: Sizes) -> float:
    """Root mean square error [rad or rad/s] of free-run simulations, all ticks and wheels pooled."""
    return rms(errors_of(replay, tracks, sizes))


def measured(replay: OwnReplay, track: Track) -> np.ndarray:
    """(rows, n) measured wheel angles [rad] or speeds [rad/s], whichever the robot logged."""
    return _logged(replay, track, track.measured[: track.ticks + 1])


def channel_of(replay: OwnReplay) -> str:
    """The name of what free-run simulations are compared in."""
    return _LOGGED[replay.logged][0]


def unit_of(replay: OwnReplay) -> str:
    """The unit of what free-run simulations are compared in, "rad" or "rad/s"."""
    return _LOGGED[replay.logged][1]


def rms(values: np.ndarray) -> float:
    """Root mean square of all numbers of an array."""
    return float(np.sqrt(np.mean(values**2)))


def _logged(replay, track, angles):
    """(rows, n) angles, or speeds over two ticks, from the first torque on: a rest before it would dilute errors."""
    rows = angles if replay.logged == "angle" else (angles[2:] - angles[:-2]) / (2.0 * TICK_S)
    if track.unscored_ticks > 0:  # it begins in motion
        return rows
    return rows[int(np.argmax(np.any(track.command[: track.ticks] != 0.0, axis=1))) :]
