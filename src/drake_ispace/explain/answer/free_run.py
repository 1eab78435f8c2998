"""How far off a model is over whole runs in which nothing corrects it, before and after the effects are in it.

A robot under a camera is dead-reckoned: by its encoders from where a run starts, against every fix. A user's own plant
is simulated on the recorded torque (free-run simulation), against its measured wheels. Forces that nobody knows add up
in such a simulation, so that the sizes that suit the innovations of a filter are not quite those that simulate best;
`fitted` finds the latter.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.optimize import least_squares

from drake_ispace.blocks.rates import TICK_S
from drake_ispace.explain.answer.explanation import FreeRun
from drake_ispace.explain.fit.candidates import Candidate
from drake_ispace.explain.fit.likelihood import Point, merged
from drake_ispace.explain.predict.own_model import OwnReplay
from drake_ispace.explain.predict.prediction import Prediction
from drake_ispace.explain.predict.replay import Values
from drake_ispace.explain.predict.room_gain import with_gain
from drake_ispace.explain.predict.tracks import Track

_FAR = 1e6  # rad, rad/s: an error of a simulation that runs away
_STEP = 1e-4  # for slopes, of a size
_LEAST_SIZE = 1e-3  # of a coordinate that starts at zero
_LOGGED = {"angle": ("simulated wheel angle", "rad"), "speed": ("simulated wheel speed", "rad/s")}


def dead_reckoned(prediction: Prediction, values: Values) -> float:
    """Root mean square distance [m] between camera and odometry from the start of each run, all fixes pooled."""
    replay = with_gain(with_gain(prediction.replay, 0, 0.0), 1, 0.0)
    residuals = replace(prediction, replay=replay).residuals(values)
    return rms(np.concatenate([np.hypot(run["room"][:, 0], run["room"][:, 1]) for run in residuals]))


def dead_reckoning(runs: str, prediction: Prediction, values: Values) -> list[FreeRun]:
    """The row of these runs; none where there is no encoder or no camera."""
    if not {"encoder", "kinect"} <= prediction.replay.feeds or not any(len(t.fix_ticks) > 1 for t in prediction.tracks):
        return []
    before, after = dead_reckoned(prediction, {}), dead_reckoned(prediction, values)
    return [FreeRun(runs, "dead-reckoned position", "m", before, after)]


def part_of(prediction: Prediction, some: slice) -> Prediction:
    """The same model against some of the runs."""
    parts = {name: getattr(prediction, name)[some] for name in ("tracks", "starts", "anchored")}
    return replace(prediction, **parts)


@dataclass(frozen=True)
class Sizes:
    """With what free-run simulations of some runs come nearest to them.

    Attributes:
        point: effects and their coordinates. plant: the plant's free parameters. stds: coordinate -> standard deviation
            as the runs differ from each other (sandwich estimate); NaN of a single run.
    """

    point: Point
    plant: Mapping[str, float]
    stds: Mapping[tuple[Candidate, int], float] = field(default_factory=dict)


def fitted(replay: OwnReplay, tracks: Sequence[Track], start: Point) -> Sizes:
    """Least squares over all ticks of all runs, from `start`, the plant's free parameters from their own values."""
    order = [(candidate, i) for candidate in start for i in range(len(candidate.parameters))]
    given = np.array([*replay.free.values(), *(start[candidate][i] for candidate, i in order)])
    if not len(given):
        return Sizes({}, {})
    sizes = np.where(given == 0.0, _LEAST_SIZE, np.abs(given))
    bounds = [(0.0, np.inf) if value > 0.0 else (-np.inf, 0.0) for value in replay.free.values()]
    bounds += [candidate.bounds[i] for candidate, i in order]

    def at(z):
        numbers = [float(value) for value in z * sizes]
        point = {candidate: list(values) for candidate, values in start.items()}
        for (candidate, i), value in zip(order, numbers[len(replay.free) :], strict=True):
            point[candidate][i] = value
        return point, dict(zip(replay.free, numbers, strict=False))

    def off(z):
        point, plant = at(z)
        return np.concatenate([errors(replay, track, merged(point), plant).ravel() for track in tracks])

    found = least_squares(off, given / sizes, diff_step=_STEP, bounds=(np.array(bounds) / sizes[:, None]).T)
    ends = np.cumsum([errors(replay, track, {}).size for track in tracks])[:-1]
    stds = (_stds(found, ends) * sizes)[len(replay.free) :]
    return Sizes(*at(found.x), dict(zip(order, map(float, stds), strict=True)))


def _stds(found, ends):
    """(k,) of what was fitted, each run's part of the gradient being independent of the others'."""
    runs = len(ends) + 1
    if runs == 1:
        return np.full(len(found.x), np.nan)
    scores = np.stack([j.T @ e for j, e in zip(np.split(found.jac, ends), np.split(found.fun, ends), strict=True)])
    normal = np.linalg.pinv(found.jac.T @ found.jac)
    return np.sqrt(np.diag(normal @ scores.T @ scores @ normal) * runs / (runs - 1.0))


def errors(replay: OwnReplay, track: Track, values: Values, plant: Mapping[str, float] | None = None) -> np.ndarray:
    """(rows, n) simulated less measured, in what the model's logs hold; plant: of its parameters, by name."""
    off = _logged(replay, track, replay.simulated(track, values, plant)) - _measured(replay, track)
    return np.clip(np.nan_to_num(off, nan=_FAR), -_FAR, _FAR)


def simulation(
    runs: str, replay: OwnReplay, tracks: Sequence[Track], before: Sizes, after: Sizes
) -> list[FreeRun]:
    """The rows of these runs: in the unit of what was logged, and as a share of it."""
    measured = rms(np.concatenate([_measured(replay, track).ravel() for track in tracks]))
    off = [error_of(replay, tracks, sizes) for sizes in (before, after)]
    channel = channel_of(replay)
    shares = [error / max(measured, 1e-300) for error in off]
    return [FreeRun(runs, channel, unit_of(replay), *off), FreeRun(runs, f"{channel}, relative", "1", *shares)]


def error_of(replay: OwnReplay, tracks: Sequence[Track], sizes: Sizes) -> float:
    """Root mean square error [rad or rad/s] of free-run simulations, all ticks and wheels pooled."""
    return rms(np.concatenate([errors(replay, track, merged(sizes.point), sizes.plant).ravel() for track in tracks]))


def channel_of(replay: OwnReplay) -> str:
    """What errors of free-run simulations are called; `unit_of`: and their unit."""
    return _LOGGED[replay.logged][0]


def unit_of(replay: OwnReplay) -> str:
    return _LOGGED[replay.logged][1]


def rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _measured(replay, track):
    return _logged(replay, track, track.measured[: track.ticks + 1])


def _logged(replay, track, angles):
    """(rows, n) angles, or speeds over two ticks, from the first torque on: a rest before it would dilute errors."""
    rows = angles if replay.logged == "angle" else (angles[2:] - angles[:-2]) / (2.0 * TICK_S)
    return rows[int(np.argmax(np.any(track.command[: track.ticks] != 0.0, axis=1))) :]
