"""The gap, row by row: errors before and after, beside what noise leaves and what plain least squares finds.

Closed is the share of the squared error above what sensors and chance leave that the answer takes away:

    closed = 1 - max(after^2 - sensors^2 - chance^2, 0) / (before^2 - sensors^2 - chance^2)

It is given only where `before` is three times each, and for places only where noise leaves less than the size of the
path: a simulation that may be anywhere proves nothing.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from drake_ispace.explain.levels import CERTAIN, CHANCE
from drake_ispace.explain.prove.errors.free_run import (
    ATE,
    PREDICTION,
    RPE,
    Errors,
    Measure,
    measures_of,
    rms,
    seconds_of,
)
from drake_ispace.explain.prove.errors.repeats import BLOCKS

TRAINING, HELD_OUT = "training", "held_out"


@dataclass(frozen=True)
class GapRow:
    """An error of the model, as a user would measure it.

    Attributes:
        runs: "held_out" (runs to which nothing was fitted) or "training". kind: of the held-out runs, where the user
            named kinds; else empty.
        metric: "ATE" (absolute trajectory error without alignment), "RPE" (relative pose error) or "prediction" (of a
            sensor). horizon: "run", "5s", "1s", ..., "step" (the next sample). channel: "position", "heading" or a
            sensor's. driven_by: what drives the model over the horizon, "wheels" (dead reckoning), "torque" or
            "command" (free-run simulation). unit: of the errors.
        before, after: root mean square error of the model as given, and with the effects.
        sensors: what counts, pixels and densities leave of it. chance: what process noise leaves, as strong as these
            runs need, but no stronger than is plausible. None: not known.
        least_squares: error with the same effects at the sizes that free-run least squares finds; None: no effects.
        closed: see the head of this file; None where the gap is too small. ci90: its 90 % bootstrap interval; None
            where too little was measured. worse: whether the squared error clearly grew, by more than noise leaves.
        anywhere: whether noise leaves as much of a place as the path is large.
    """

    runs: str
    metric: str
    horizon: str
    channel: str
    unit: str
    driven_by: str
    before: float
    after: float
    sensors: float | None
    chance: float | None
    least_squares: float | None
    closed: float | None
    ci90: tuple[float, float] | None
    kind: str = ""
    worse: bool = False
    anywhere: bool = False


@dataclass(frozen=True)
class Columns:
    """Errors of some runs under each model.

    Attributes:
        before, after: errors of each run. least_squares: likewise; None: there are no effects. sensors, chance:
            measure -> root mean square. size_m: of the paths, root mean square distance of the fixes from their mean.
    """

    before: Sequence[Errors]
    after: Sequence[Errors]
    least_squares: Sequence[Errors] | None
    sensors: Mapping[Measure, float]
    chance: Mapping[Measure, float]
    size_m: float = np.inf


def rows_of(columns: Columns, runs: str, kind: str, seed: int) -> list[GapRow]:
    """A row for every measure, places first and long horizons first. seed: of the bootstrap."""
    measures = sorted(measures_of(columns.before), key=_order)
    return [_row(columns, m, runs, kind, np.random.default_rng([seed, k])) for k, m in enumerate(measures)]


def headlines(rows: Sequence[GapRow], by_sensors: bool = False) -> list[GapRow]:
    """The rows of unseen runs that tell of the gap, the longest horizon first: one for each of what drives the model.

    Each is of the place, over the longest horizon at which the gap is clear. by_sensors: where it is so at none, it is
    enough that it is clear beside what sensors leave; so it is where over the longest such horizon, or one over which
    the robot may be anywhere, the error grew by more than that, beside which a shorter one would mislead.
    """
    def clearness(row):
        return seconds_of(row.horizon), row.before / _floor(row.sensors, row.chance)

    places = [row for row in rows if row.metric != PREDICTION and row.channel != "heading" and row.unit != "1"]
    known = [row for row in places if row.runs == HELD_OUT and None not in (row.sensors, row.chance)]
    known, found = sorted(known, key=clearness, reverse=True), {}
    for row in known:
        if row.closed is not None:
            found.setdefault(row.driven_by, row)
    longest = {}
    for row in known if by_sensors else ():
        if row.worse or (row.before >= CERTAIN * row.sensors and not row.anywhere):
            longest.setdefault(row.driven_by, row)
    for driven_by, row in longest.items():
        if driven_by not in found or row.after**2 > row.before**2 + row.sensors**2:
            found[driven_by] = row
    return sorted(found.values(), key=clearness, reverse=True)


def _order(m):
    kind = [ATE, RPE, PREDICTION].index(m.metric)
    return [kind == 2, -seconds_of(m.horizon), kind, m.driven_by != "wheels", m.channel == "heading", m.channel]


def _row(columns, m, runs, kind, generator):
    before, after = ([run[m] for run in column if m in run] for column in (columns.before, columns.after))
    plain = None if columns.least_squares is None else rms([run[m] for run in columns.least_squares if m in run])
    sensors, chance = columns.sensors.get(m), columns.chance.get(m)
    closed, interval, worse, anywhere = None, None, False, False
    if sensors is not None and chance is not None:
        floor = _floor(sensors, chance)
        draws = _draws(before, after, generator)
        worse = draws is not None and bool(np.quantile(draws[1] - draws[0], CHANCE) > floor**2)
        anywhere = m.channel == "position" and floor >= columns.size_m
        if rms(before) >= CERTAIN * max(sensors, chance) and not anywhere:
            closed = float(_closed(rms(before) ** 2, rms(after) ** 2, floor**2))
            if draws is not None:
                interval = tuple(float(end) for end in np.quantile(_closed(*draws, floor**2), [0.05, 0.95]))
    return GapRow(
        runs, m.metric, m.horizon, m.channel, m.unit, m.driven_by, rms(before), rms(after), sensors, chance, plain,
        closed, interval, kind, worse, anywhere,
    )


def _floor(sensors, chance):
    return max(float(np.hypot(sensors, chance)), 1e-300)


def _closed(before, after, floor):
    """The share closed; arguments are mean squares, numbers or arrays."""
    return 1.0 - np.maximum(after - floor, 0.0) / np.maximum(before - floor, 1e-300)


def _draws(before, after, generator):
    """Mean squares (draws,) before and after, over draws of runs, or of blocks of runs where there are few."""
    parts = [
        (np.sum(b**2, axis=1), np.sum(a**2, axis=1)) for b, a in zip(before, after, strict=True) if len(b) == len(a)
    ]
    if len(parts) < BLOCKS:
        parts = [
            tuple(column[rows] for column in run) for run in parts
            for rows in np.array_split(np.arange(len(run[0])), BLOCKS) if len(rows)
        ]
    if len(parts) < BLOCKS:
        return None
    sums = np.array([[len(b), b.sum(), a.sum()] for b, a in parts])
    draws = round(1.0 / CHANCE)  # of which one is as rare as that
    n, b, a = sums[generator.integers(0, len(sums), size=(draws, len(sums)))].sum(axis=1).T
    return b / n, a / n
