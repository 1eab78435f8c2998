"""Do errors of a robot under commanded velocity follow from what it was told? No noise knows of that.

A drive that answers otherwise than the model errs after every change, whatever the shape of its answer. What it does
otherwise for good adds up: over a second its wheels err by what they were told all the while.
"""

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.stats import rankdata

from drake_ispace.blocks.rates import TICK_S
from drake_ispace.effects.library import library
from drake_ispace.explain.levels import CERTAIN
from drake_ispace.explain.predict.prediction import Prediction
from drake_ispace.explain.prove.errors.free_run import (
    HORIZONS_S,
    PREDICTION,
    SPACING_S,
    Errors,
    Measure,
    Windows,
    measures_of,
    rms,
    seconds_of,
)
from drake_ispace.explain.prove.left.drivers import COMMANDED, NO_NOISE
from drake_ispace.explain.prove.left.predicted import predicted, predicted_share
from drake_ispace.explain.prove.left.remainder import Remainder, Series, going_with
from drake_ispace.explain.prove.noise.command_times import angles_left_by_command_times

_PAST = round(HORIZONS_S[0] / TICK_S)  # ticks, after which a change of the command is over
_SHIFTS = 20  # of time, at which the changes say nothing of the errors
TOGETHER = "commands along several axes together"


def by_command(
    prediction: Prediction, windows: Sequence[Windows], after: Sequence[Errors],
    motion: Sequence[Mapping[Measure, Series]], sensors: Mapping[Measure, float],
) -> list[Remainder]:
    """Errors of wheels that follow from the commands, as noise does not, where they are larger than sensors leave.

    windows, after, motion: of each run, its errors, and those of its wheels over the shortest horizon. sensors:
        measure -> what sensors leave.
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
    end_to_end = [name for name in windows[0].lengths if seconds_of(name) == SPACING_S]
    return found + [r for name in end_to_end for r in errors_that_add_up(prediction, windows, after, sensors, name)]


def errors_that_add_up(
    prediction: Prediction, windows: Sequence[Windows], after: Sequence[Errors], sensors: Mapping[Measure, float],
    horizon: str,
) -> list[Remainder]:
    """Errors of wheels over windows end to end that follow from what they were told in the meantime.

    The drive of a sound robot may be a little faster or slower than told.

    windows, after, sensors: as of `by_command`. horizon: name of that of the windows.
    """
    tracks, found, columns = prediction.tracks, [], prediction.labels("motion")
    gain = max(p.tolerance for p in library()["velocity_gain"].parameters_of(prediction.replay.body))
    unlogged = angles_left_by_command_times(
        tracks, prediction.replay.body.plant.geometry.inverse, seconds_of(horizon)
    )
    used = np.any([np.ptp(track.command, axis=0) > 0.0 for track in tracks], axis=0)
    spans = [(track, own.starts, own.lengths[horizon]) for track, own in zip(tracks, windows, strict=True)]
    told = [_while_told(track, used, starts, ticks) for track, starts, ticks in spans]
    turned = [_change(track.turned, starts, ticks, track.ticks) for track, starts, ticks in spans]
    for m in measures_of(after):
        if (m.metric, m.horizon) != (PREDICTION, horizon) or not m.channel.startswith("encoder"):
            continue
        runs = [
            (track.name, replace(while_told, errors=errors[m]))
            for track, while_told, errors in zip(tracks, told, after, strict=True) if m in errors
        ]
        tolerated = gain * rms([ways[:, [columns.index(m.channel)]] for ways in turned])
        may_be = float(np.linalg.norm([sensors.get(m, np.inf), unlogged, tolerated]))
        most = predicted(m, runs, may_be, (COMMANDED, TOGETHER))
        if most is not None and not is_chance([(run.drivers[most.driver], run.errors) for _, run in runs]):
            found.append(replace(most, ratio=most.size / may_be))
    return found


def _while_told(track, used, starts, ticks) -> Series:
    """No errors yet, in windows of so many ticks, beside means of the commands that are used within each."""
    drivers, command = {}, track.command[:, used]
    for name, columns in ((COMMANDED, command), (TOGETHER, together(command))):
        total = np.vstack([np.zeros(columns.shape[1]), np.cumsum(columns, axis=0)])
        drivers[name] = _change(total, starts, ticks, track.ticks) / ticks
    middle = starts[starts + ticks < track.ticks] + ticks // 2
    return Series(middle * TICK_S, np.empty((len(middle), 0)), drivers[COMMANDED], drivers)


def _change(columns, starts, ticks, end) -> np.ndarray:
    """(k, n) changes of columns (rows, n) over the windows of so many ticks that end before a tick."""
    since = starts[starts + ticks < end]
    return columns[since + ticks] - columns[since]


def together(command: np.ndarray) -> np.ndarray:
    """(rows, k) commands (rows, n), and products of every two with and without their signs."""
    pairs = itertools.combinations(command.T, 2)
    products = [product for a, b in pairs for product in (a * b, np.abs(a) * b, a * np.abs(b))]
    return np.column_stack([command, *products])


def is_chance(runs: Sequence[tuple[np.ndarray, np.ndarray]]) -> bool:
    """Whether a variable may predict as much of errors by chance, as it does of errors at other times.

    Of runs with too few rows for that it may.

    runs: as of `predicted_share`.
    """
    shifts = range(1, min((len(x) for x, _ in runs), default=0))
    shares = [predicted_share([(np.roll(x, shift, axis=0), y) for x, y in runs]) for shift in shifts]
    return len(shares) < 2 or predicted_share(runs) <= np.mean(shares) + CERTAIN * np.std(shares, ddof=1)


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
