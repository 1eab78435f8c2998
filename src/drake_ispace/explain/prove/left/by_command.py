"""Do errors of a robot under commanded velocity come with changes of its command? No noise knows when these are.

A drive that answers otherwise than the model errs after every change, whatever the shape of its answer.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.stats import rankdata

from drake_ispace.blocks.rates import TICK_S
from drake_ispace.explain.levels import CERTAIN
from drake_ispace.explain.predict.prediction import Prediction
from drake_ispace.explain.prove.errors.free_run import HORIZONS_S, Measure, Windows, seconds_of
from drake_ispace.explain.prove.left.drivers import NO_NOISE
from drake_ispace.explain.prove.left.predicted import predicted
from drake_ispace.explain.prove.left.remainder import Remainder, Series, going_with
from drake_ispace.explain.prove.noise.command_times import angles_left_by_command_times

_PAST = round(HORIZONS_S[0] / TICK_S)  # ticks, after which a change of the command is over
_SHIFTS = 20  # of time, at which the changes say nothing of the errors


def by_command(
    prediction: Prediction, windows: Sequence[Windows], motion: Sequence[Mapping[Measure, Series]],
    sensors: Mapping[Measure, float],
) -> list[Remainder]:
    """Errors of wheels that follow from the commands, as noise does not, where they are larger than sensors leave.

    windows, motion: of each run, and errors of its wheels over the shortest horizon. sensors: measure -> what sensors
        leave.
    """
    found, tracks, wheels = [], prediction.tracks, prediction.replay.body.plant.geometry.inverse
    measures = [m for m in (motion[0] if motion else ()) if m.channel.startswith("encoder")]
    if not measures:
        return []
    changes = [_changes(track.command, own) for track, own in zip(tracks, windows, strict=True)]
    told = [told_to_move(track.command, _ends(own), _PAST) for track, own in zip(tracks, windows, strict=True)]
    unlogged = angles_left_by_command_times(tracks, wheels, seconds_of(measures[0].horizon))
    for m in measures:
        may_be = float(np.hypot(sensors.get(m, np.inf), unlogged))
        which = [i for i, run in enumerate(motion) if m in run]
        runs = [(tracks[i].name, motion[i][m]) for i in which]
        if (most := predicted(m, runs, may_be, NO_NOISE)) is not None:
            found.append(replace(most, ratio=most.size / may_be))
        moving = np.mean(np.concatenate([told[i] for i in which]))
        size = left_at_changes([(changes[i][told[i]], motion[i][m].errors[told[i]]) for i in which])
        size *= np.sqrt(moving)  # as what sensors leave, of all rows
        if size > may_be:
            because = f"after changes of the command the error over {m.horizon} is larger than at other times"
            found.append(going_with(m, runs, "changes of the command", size, size / may_be, because))
    return found


def _changes(command, windows) -> np.ndarray:
    """(k, 2) `changes_before` the ends of the windows of the shortest horizon, over two of these and over 1 s."""
    ticks = windows.lengths[windows.shortest]
    return changes_before(command, _ends(windows), (2 * ticks, _PAST))


def _ends(windows) -> np.ndarray:
    """(k,) the last tick of each window of the shortest horizon."""
    return windows.dense + windows.lengths[windows.shortest] - 1


def changes_before(command: np.ndarray, ends: np.ndarray, pasts: Sequence[int]) -> np.ndarray:
    """(k, len(pasts)) by how much a command (rows, n) changed in all before each of `ends` (k,).

    pasts: over how many ticks. Each column of the command counts in parts of its largest value.
    """
    sizes = np.maximum(np.abs(command).max(axis=0, initial=0.0), 1e-9)
    way = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(command / sizes, axis=0)).sum(axis=1))])
    return np.column_stack([way[ends] - way[np.maximum(ends - past, 0)] for past in pasts])


def told_to_move(command: np.ndarray, ends: np.ndarray, past: int) -> np.ndarray:
    """(k,) whether a command (rows, n) is not zero in some of the `past` rows up to each of `ends` (k,).

    At rest there are no errors, so that those while a robot moves are larger whatever changes.
    """
    moves = np.concatenate([[0], np.cumsum(command.any(axis=1))])
    return moves[ends + 1] > moves[np.maximum(ends + 1 - past, 0)]


def left_at_changes(runs: Sequence[tuple[np.ndarray, np.ndarray]]) -> float:
    """Root mean square, over all of these rows, of what errors are larger by after changes; 0 where it may be chance.

    runs: of each, while it is told to move, by how much the command has changed over each past (k, c), and errors
        (k, d). They are larger by chance if they are as much larger after the same changes at other times.
    """
    squares = [np.sum(errors**2, axis=1) for _, errors in runs]
    if not any(map(len, squares)):
        return 0.0
    return max(_larger_after([past > middle for past in pasts], squares) for pasts, middle in (
        (each, np.median(np.concatenate(each))) for each in zip(*(change.T for change, _ in runs), strict=True)
    ))


def _larger_after(changed: Sequence[np.ndarray], squares: Sequence[np.ndarray]) -> float:
    """As of `left_at_changes`, of each run's (k,) rows that have `changed`.

    Whether it is chance their ranks tell: the squares are mostly a few large errors, which are anywhere.
    """
    every, share = np.concatenate(squares), np.mean(np.concatenate(changed))
    if not 0.0 < share < 1.0:
        return 0.0

    def larger_by(values, shift=0.0):
        after = np.concatenate([np.roll(rows, round(shift * len(rows))) for rows in changed])
        return values[after].mean() - values[~after].mean()

    ranks = rankdata(every)
    by_chance = np.array([larger_by(ranks, k / (_SHIFTS + 1)) for k in range(1, _SHIFTS + 1)])
    if larger_by(ranks) < by_chance.mean() + CERTAIN * by_chance.std(ddof=1):
        return 0.0
    return float(np.sqrt(share * max(larger_by(every), 0.0)))
