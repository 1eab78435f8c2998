"""Do errors of a robot under commanded velocity come with changes of its command? No noise knows when these are.

A drive that answers otherwise than the model errs after every change, whatever the shape of its answer.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from drake_ispace.explain.levels import CERTAIN
from drake_ispace.explain.predict.prediction import Prediction
from drake_ispace.explain.prove.command_times import angles_left_by_command_times
from drake_ispace.explain.prove.drivers import NO_NOISE
from drake_ispace.explain.prove.free_run import Measure, rms
from drake_ispace.explain.prove.gap import seconds
from drake_ispace.explain.prove.predicted import PREDICTED, best_driver
from drake_ispace.explain.prove.remainder import Remainder, Series, going_with

_SHIFTS = 20  # of time, at which the changes say nothing of the errors


def by_command(
    prediction: Prediction, motion: Sequence[Mapping[Measure, Series]], sensors: Mapping[Measure, float],
    names: Sequence[str],
) -> list[Remainder]:
    """Errors of wheels that follow from the commands, as noise does not, where they are larger than sensors leave.

    motion: of each run, errors of the wheels over the shortest horizon. sensors: measure -> what sensors leave.
    """
    found, wheels, tracks = [], prediction.replay.body.plant.geometry.inverse, prediction.tracks
    for m in (m for m in (motion[0] if motion else ()) if m.channel.startswith("encoder")):
        runs = [(name, run[m]) for name, run in zip(names, motion, strict=True) if m in run]
        series = [run for _, run in runs]
        unlogged = angles_left_by_command_times(tracks, wheels, seconds(m.horizon))
        may_be = float(np.hypot(sensors.get(m, np.inf), unlogged))
        driver, share = best_driver(m, series, NO_NOISE)
        size = rms([run.errors for run in series]) * float(np.sqrt(max(share, 0.0)))
        if share >= PREDICTED and size > may_be:
            because = f"{100 * share:.0f} % of the squared error over {m.horizon} goes with {driver}"
            found.append(going_with(m, runs, driver, size, size / may_be, because))
        size = left_at_changes([(run.changes, run.errors) for run in series])
        if size > may_be:
            because = f"after changes of the command the error over {m.horizon} is larger than at other times"
            found.append(going_with(m, runs, "changes of the command", size, size / may_be, because))
    return found


def changes_before(command: np.ndarray, ends: np.ndarray, pasts: Sequence[int]) -> np.ndarray:
    """(k, len(pasts)) by how much a command (rows, n) changed in all before each of `ends` (k,).

    pasts: over how many ticks. Each column of the command counts in parts of its largest value.
    """
    sizes = np.maximum(np.abs(command).max(axis=0, initial=0.0), 1e-9)
    way = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(command / sizes, axis=0)).sum(axis=1))])
    return np.column_stack([way[ends] - way[np.maximum(ends - past, 0)] for past in pasts])


def left_at_changes(runs: Sequence[tuple[np.ndarray, np.ndarray]]) -> float:
    """Root mean square, over whole runs, of what errors are larger by after changes; 0 where it may be chance.

    runs: of each by how much the command has changed over each past (k, c), and errors (k, d). They are larger by
        chance if they are as much larger after the same changes at other times.
    """
    squares = [np.sum(errors**2, axis=1) for _, errors in runs]
    return max(_larger_after([past > middle for past in pasts], squares) for pasts, middle in (
        (each, np.median(np.concatenate(each))) for each in zip(*(change.T for change, _ in runs), strict=True)
    ))


def _larger_after(changed: Sequence[np.ndarray], squares: Sequence[np.ndarray]) -> float:
    """As of `left_at_changes`, of each run's (k,) rows that have `changed`."""
    every, share = np.concatenate(squares), np.mean(np.concatenate(changed))
    if not 0.0 < share < 1.0:
        return 0.0

    def larger_by(shift):
        after = np.concatenate([np.roll(rows, round(shift * len(rows))) for rows in changed])
        return every[after].mean() - every[~after].mean()

    found, by_chance = larger_by(0.0), np.array([larger_by(k / (_SHIFTS + 1)) for k in range(1, _SHIFTS + 1)])
    if found < by_chance.mean() + CERTAIN * by_chance.std(ddof=1):
        return 0.0
    return float(np.sqrt(share * max(found, 0.0)))
