"""The error that every fix has by itself, as fixes show it, and what errors of places owe to it."""

from collections.abc import Sequence

import numpy as np
from scipy.stats import chi2

from drake_ispace.blocks.frames import wrap
from drake_ispace.blocks.rates import TICK_S
from drake_ispace.explain.levels import CHANCE, largest_by_chance
from drake_ispace.explain.predict.prediction import wheel_speeds
from drake_ispace.explain.predict.tracks import Track
from drake_ispace.explain.prove.errors.free_run import HORIZONS_S, RUN, horizon_of
from drake_ispace.explain.prove.errors.paths import chained, compose, pairs, relative
from drake_ispace.plants.wheels import WheelGeometry

_MEDIAN = 0.327  # of 1.5 U^2 - 0.5 V^2, the product of two successive motions between fixes with Gaussian errors
_REST_RAD_S = 0.01  # speed below which every wheel is at rest


def at_rest(tracks: Sequence[Track], wheels: int) -> np.ndarray | None:
    """(3, 3) standard deviations [m, m, rad] of the fixes of a robot at rest: the least, the likely and the most.

    The least and the most are those that chance makes of Gaussian errors as rarely as CHANCE. So rare errors are left
    out: fixes that were mistaken have no part in the noise of the others.

    None: there are too few, or a coordinate has values that come again, as whole pixels do: that says nothing of a
    moving robot.
    """
    parts = []
    for track in tracks:
        if "encoder" not in track.has or not len(track.seen):
            continue
        resting = np.abs(wheel_speeds(track.measured[: track.ticks + 1, :wheels])).max(axis=1) < _REST_RAD_S
        seen = resting[np.clip(np.rint(track.seen[:, 0] / TICK_S).astype(int), 0, track.ticks)]
        for stretch in np.split(np.arange(len(seen)), np.flatnonzero(np.diff(seen)) + 1):
            if len(stretch) > 2 and seen[stretch[0]]:
                poses = track.seen[stretch[1:-1], 1:].copy()  # the robot may still move at the ends
                poses[:, 2] = np.unwrap(poses[:, 2])
                parts.append(poses)
    parts = [poses for poses in _without_mistaken(parts) if len(poses) > 1]
    deviations = np.vstack([
        *((poses - poses.mean(axis=0)) * np.sqrt(len(poses) / (len(poses) - 1)) for poses in parts), np.empty((0, 3)),
    ])
    free = len(deviations) - len(parts)
    if free < 1 or not all(map(_are_distinct, deviations.T)):
        return None
    likely = np.sqrt(np.mean(deviations**2, axis=0))
    return np.array([likely * _off(free, chi2.isf), likely, likely * _off(free, chi2.ppf)])


def _without_mistaken(parts):
    """Poses (k, 3) of several stretches at rest, less those that are off by more than chance makes of the others."""
    off = [np.abs(poses - np.median(poses, axis=0)) for poses in parts]
    every = np.vstack([*off, np.empty((0, 3))])
    usual = [np.median(column[column > 0.0]) if column.any() else 0.0 for column in every.T]  # medians are not off
    most = largest_by_chance(max(len(every), 1), 1) * np.array(usual)
    return [poses[(sizes <= most).all(axis=1)] for poses, sizes in zip(parts, off, strict=True)]


def on_the_move(tracks: Sequence[Track], geometry: WheelGeometry, stated: np.ndarray) -> np.ndarray:
    """(3,) the most [m, m, rad] that the errors of fixes can be in the root mean square, as wheels tell the motion.

    Two fixes are wrong in every motion between fixes, and whatever else is wrong with it, with the wheels for example,
    only adds to that. What goes with the motion itself, such as a wrong scale, is taken away first. Only fixes between
    which the robot moved by more than the `stated` errors (3,) are used. Infinite where there are too few, or where a
    coordinate has values that come again: errors of whole pixels then do, too.
    """
    runs = []
    for track in tracks:
        if "encoder" in track.has and len(track.seen):
            steps = np.diff(track.turned[:, : len(geometry.wheels)], axis=0) @ geometry.forward.T
            path, at = chained(np.zeros(3), steps), track.seen[:, 0] / TICK_S
            path[:, 2] = np.unwrap(path[:, 2])
            reckoned = np.column_stack([np.interp(at, np.arange(len(path)), column) for column in path.T])
            apart = _apart(reckoned, float(np.hypot(*stated[:2])), stated[2])
            runs.append((reckoned[apart], track.seen[apart, 1:]))
    places, headings, known = _beside_what_goes_with_motion(runs)
    free = len(places) - known
    if free < 1 or not all(map(_are_distinct, np.vstack([poses for _, poses in runs]).T)):
        return np.full(3, np.inf)
    squares = np.column_stack([places, headings]) ** 2 * len(places) / free
    return np.sqrt(squares.mean(axis=0) / 2.0) * _off(free, chi2.ppf)


def _off(free, end):
    """What to multiply a standard deviation with that so many Gaussian numbers show, to be at this end of chance."""
    return np.sqrt(free / end(CHANCE, free))


def _beside_what_goes_with_motion(runs):
    """Errors of the motions between fixes, places (n, 2) in W and headings (n,), less what is linear in the motion.

    Then the number of motions by which that is known. runs: as of `error_of_each_fix`.
    """
    off, moved, turned = [np.empty((0, 3))], [np.empty((0, 3))], [np.empty((0, 2, 2))]
    for reckoned, poses in runs:
        moved.append(relative(reckoned[:-1], reckoned[1:]))
        off.append(compose(poses[:-1], moved[-1]) - poses[1:])
        c, s = np.cos(poses[:-1, 2]), np.sin(poses[:-1, 2])
        turned.append(np.moveaxis(np.array([[c, -s], [s, c]]), -1, 0))
    off, moved, turned = map(np.concatenate, (off, moved, turned))
    by_places = np.einsum("nij,nk->nijk", turned, moved).reshape(2 * len(off), 2 * moved.shape[1])
    places, headings = off[:, :2].ravel(), wrap(off[:, 2])
    places = places - by_places @ np.linalg.lstsq(by_places, places, rcond=None)[0]
    headings = headings - moved @ np.linalg.lstsq(moved, headings, rcond=None)[0]
    return places.reshape(-1, 2), headings, moved.shape[1]


def _are_distinct(rows):
    """Whether nearly all numbers (k,) differ from each other."""
    return len(np.unique(np.round(rows, 9))) >= 0.9 * len(rows)


def _apart(poses, way_m, turn_rad):
    """Numbers of the poses (k, 3) that are as far from the last of them that was chosen, or turned by as much."""
    chosen = [0]
    for i, pose in enumerate(poses):
        x, y, turn = pose - poses[chosen[-1]]
        if np.hypot(x, y) > way_m or abs(turn) > turn_rad:
            chosen.append(i)
    return np.array(chosen)


def error_of_each_fix(runs: Sequence[tuple[np.ndarray, np.ndarray]]) -> np.ndarray:
    """(3,) standard deviations [m, m, rad] of the error that every fix has by itself.

    A few fixes that are far off hardly count. Beside slip that is new from fix to fix it comes out too small, by a
    quarter where the slip's variance is eight times as large.

    runs: poses of the model's dead reckoning and of the camera, (k, 3) each, at the fixes of a run.
    """
    products = _of_successive_motions(runs)
    return np.sqrt(np.maximum(np.median(products, axis=0), 0.0) / _MEDIAN) if len(products) else np.zeros(3)


def _of_successive_motions(runs):
    """(n, 3) products whose mean is the variance of what is wrong with each fix by itself; as `error_of_each_fix`.

    It stands in the motions before and after the fix, once with either sign. What goes on from fix to fix, such as a
    wrong scale or slip, stands in successive motions with the same sign, or in only one of them.
    """
    products = [np.empty((0, 3))]
    for reckoned, poses in runs:
        off = compose(poses[:-1], relative(reckoned[:-1], reckoned[1:])) - poses[1:]
        off[:, 2] = wrap(off[:, 2])
        products.append(-off[:-1] * off[1:])
    return np.vstack(products)


def left_by_fixes(of_each: np.ndarray, runs: Sequence[tuple[np.ndarray, np.ndarray]]) -> dict[tuple[str, str], float]:
    """(name of a horizon, "position" or "heading") -> root mean square error that fixes leave which are off by so much.

    Over a while two fixes are off; a heading that is off at its begin turns the way since then.

    of_each: (3,) as of `error_of_each_fix`. runs: times (k,) [s] and poses (k, 3) of the fixes of each run.
    """
    place, heading = float(np.hypot(*of_each[:2])), float(of_each[2])
    left = {(RUN, "position"): place, (RUN, "heading"): heading}
    for horizon in HORIZONS_S:
        ways = [np.diff(poses[pairs(t, horizon, 0.0), :2], axis=1).reshape(-1, 2) for t, poses in runs]
        squared_way = np.mean(np.sum(np.vstack([np.zeros((1, 2)), *ways]) ** 2, axis=1))
        left[horizon_of(horizon), "position"] = float(np.sqrt(2.0 * place**2 + squared_way * heading**2))
        left[horizon_of(horizon), "heading"] = np.sqrt(2.0) * heading
    return left
