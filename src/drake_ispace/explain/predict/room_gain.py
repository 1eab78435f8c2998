"""Gains by which the room view of a robot that is driven by velocity follows the fixes: the likeliest for its runs.

Between two fixes odometry accumulates errors of its own, and a fix has noise. The best gain follows from their ratio,
which differs by orders of magnitude between a ceiling of motion-capture cameras (0.2 mm) and a Kinect (20 mm). Too
large a gain takes the noise of every fix for motion; too small a gain counts old drift again at every fix. Innovations
are then no longer independent, and short-lived disagreements outweigh what accumulates over a whole run.
"""

import dataclasses

import numpy as np
from scipy.optimize import minimize_scalar
from scipy.signal import lfilter

from drake_ispace.blocks.frames import rotated

_LEAST_FIXES = 20  # a run with fewer is left out; without any run the gains stay as they are


def tuned(replay, tracks, starts):
    """The Replay with the likeliest gains for these runs, first of heading, then of place.

    starts: (3 + n,) pose and wheel angles of each run at t = 0.
    """
    numbers = replay.parameters({})
    runs = [
        (track, start, _steps(replay, track, numbers)) for track, start in zip(tracks, starts, strict=True)
        if len(track.fix_t) >= _LEAST_FIXES
    ]
    if runs:
        for which in (1, 0):
            replay = with_gain(replay, which, _likeliest(replay, which, runs))
    return replay


def _steps(replay, track, numbers):
    """(k - 1, 4) the wheels' way along the axes of B [m, m, rad] from fix to fix, and the time [s] that it took."""
    ways = replay.ways(track, numbers)[track.fix_ticks]
    return np.column_stack([np.diff(ways, axis=0), np.diff(track.fix_t)])


def _likeliest(replay, which, runs) -> float:
    """The likeliest gain of place (0) or heading (1), a share between nothing and all, the other being as it is.

    runs: track, start and steps of each.
    """
    deviance = lambda gain: _deviance(with_gain(replay, which, gain), runs)  # noqa: E731
    return float(minimize_scalar(deviance, bounds=(0.0, 1.0), method="bounded").x)


def with_gain(replay, which: int, value: float):
    """The Replay with another gain of place (0) or heading (1)."""
    numbers = replay.rollout.parameters.copy()
    numbers[_place_of_gain(replay, which)] = value
    return dataclasses.replace(replay, rollout=dataclasses.replace(replay.rollout, parameters=numbers))


def _place_of_gain(replay, which):
    """Index of the gain of place (0) or heading (1) among the run-time numbers."""
    return replay.rollout.index(f"{replay.body.name}_view.gain[{which}]")


def _deviance(replay, runs):
    """Deviance per row of Gaussian innovations, up to a constant.

    Errors that go with the motion itself (a share of the way, of the turning, a drift) are no noise, and are regressed
    out first, for each axis of the body. At a small gain innovations show them for many fixes, and the regressors decay
    as slowly. The motion is that of the wheels: a motion from fix to fix would have their noise in it.
    """
    numbers = replay.parameters({})
    gains = [replay.rollout.parameters[_place_of_gain(replay, i)] for i in (0, 1)]
    rows, drivers = [], ([], [])
    for track, start, steps in runs:
        rows.append(_in_body(replay.run(track, start, numbers)[1][1:], track.poses[:-1, 2]))
        for gain, decaying in zip(gains, drivers, strict=True):
            decaying.append(lfilter([1.0], [1.0, gain - 1.0], steps, axis=0))
    innovations = np.vstack(rows)
    for decayed, columns in zip(drivers, ([0, 1], [2]), strict=True):
        driver = np.vstack(decayed)
        innovations[:, columns] -= driver @ np.linalg.lstsq(driver, innovations[:, columns], rcond=None)[0]
    covariance = innovations.T @ innovations / len(innovations)
    return float(np.linalg.slogdet(covariance + np.finfo(float).eps * np.eye(3))[1])


def _in_body(rows, headings):
    """(k, 3) rows with x, y turned from W into B."""
    return np.column_stack([rotated(rows[:, :2], -headings), rows[:, 2]])
