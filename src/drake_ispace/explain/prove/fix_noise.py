"""What errors of places owe to the error that every fix has by itself, whatever is wrong with the model."""

from collections.abc import Sequence

import numpy as np

from drake_ispace.blocks.frames import wrap
from drake_ispace.explain.prove.free_run import HORIZONS_S, RUN
from drake_ispace.explain.prove.paths import compose, pairs, relative


def error_of_each_fix(runs: Sequence[tuple[np.ndarray, np.ndarray]]) -> np.ndarray:
    """(3,) root mean squares [m, m, rad] of the error that every fix has by itself.

    It stands in the motions before and after the fix, once with either sign. What goes on from fix to fix, such as a
    wrong scale or slip, stands in successive motions with the same sign, or in only one of them.

    runs: poses of the model's dead reckoning and of the camera, (k, 3) each, at the fixes of a run.
    """
    products, rows = np.zeros(3), 0
    for reckoned, poses in runs:
        off = compose(poses[:-1], relative(reckoned[:-1], reckoned[1:])) - poses[1:]
        off[:, 2] = wrap(off[:, 2])
        products += np.sum(off[:-1] * off[1:], axis=0)
        rows += max(len(off) - 1, 0)
    return np.sqrt(np.maximum(-products / max(rows, 1), 0.0))


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
        left[f"{horizon:g}s", "position"] = float(np.sqrt(2.0 * place**2 + squared_way * heading**2))
        left[f"{horizon:g}s", "heading"] = np.sqrt(2.0) * heading
    return left
