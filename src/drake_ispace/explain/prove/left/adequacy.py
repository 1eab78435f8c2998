"""Does an answer suffice? What it leaves, on runs to which nothing was fitted, must be noise of a sound robot.

It is not noise where

- forces from outside would have to be stronger than is plausible,
- an error is larger than sensors and plausible process noise together can make it,
- a measured variable predicts it in runs from which the prediction was not learned,
- it comes again in runs of the same motion, or
- it differs between wheels that are alike.
"""

from collections.abc import Mapping, Sequence
from types import MappingProxyType

import numpy as np
from scipy.stats import chi2

from drake_ispace.blocks.frames import rotated
from drake_ispace.blocks.rates import TICK_S
from drake_ispace.explain.decide.survey.generic import motion_of
from drake_ispace.explain.levels import CERTAIN, CHANCE
from drake_ispace.explain.predict.prediction import IMU_OFFSETS, Prediction
from drake_ispace.explain.predict.replay import Values
from drake_ispace.explain.predict.tracks import Track
from drake_ispace.explain.prove.errors.free_run import (
    ATE,
    HORIZONS_S,
    PREDICTION,
    RPE,
    STEP,
    WHEELS,
    Errors,
    Measure,
    Simulation,
    Windows,
    horizon_of,
    measures_of,
    rms,
    seconds_of,
)
from drake_ispace.explain.prove.errors.left_out import MOST_BLOCKS
from drake_ispace.explain.prove.errors.paths import compose, pairs, relative, relative_errors
from drake_ispace.explain.prove.errors.repeats import repeated_share
from drake_ispace.explain.prove.left.by_command import by_command
from drake_ispace.explain.prove.left.drivers import drivers_of, of_wheel_angle
from drake_ispace.explain.prove.left.predicted import PREDICTED, predicted
from drake_ispace.explain.prove.left.remainder import NOTHING, Remainder, Series, amount, going_with, worst_runs
from drake_ispace.explain.prove.noise.command_times import angles_left_by_command_times, left_by_command_times
from drake_ispace.explain.prove.noise.fix_noise import error_of_each_fix, left_by_fixes
from drake_ispace.explain.prove.noise.noise import INDEPENDENT, WALKS, ProcessNoise
from drake_ispace.robots.robot import COMMAND

#: Times what sensors and plausible process noise leave: over some seconds the pixels of two fixes are nearly all.
TOO_LARGE = dict.fromkeys((PREDICTION, ATE), 2.0) | {RPE: 1.5}
_UNLIKE = 1.25  # times the error of the wheels that are like it
_OF_FIXES = "most of it is an error of every fix by itself: a camera noisier than stated, or uneven stamps"


def remainders(
    prediction: Prediction, windows: Sequence[Windows], values: Sequence[Values], after: Sequence[Errors],
    noise: ProcessNoise, sensors: Mapping[Measure, float], chance: Mapping[Measure, float],
    assumed: Mapping[Measure, float],
) -> list[Remainder]:
    """The Remainders of an answer, the worst first; none where it suffices.

    Args:
        prediction: model and runs. windows, values, after: of each run, the effects in the model and its errors.
        noise: that the errors need. sensors, chance: measure -> root mean square that noise may leave. assumed: the
            same of process noise that is as strong as assumed.
    """
    motion = [_sensed(prediction, i, w, e) for i, (w, e) in enumerate(zip(windows, after, strict=True))]
    reckoned = {
        i: Simulation(prediction.replay, track, prediction.starts[i], values[i]).reckoned[1:]
        for i, track in enumerate(prediction.tracks)
        if {"encoder", "kinect"} <= prediction.replay.feeds and len(track.fix_t) > 1
    }
    rooms = [_places(prediction, i, reckoned[i]) if i in reckoned else {} for i in range(len(values))]
    tracks = [prediction.tracks[i] for i in reckoned]
    of_each = error_of_each_fix([(path, t.poses) for path, t in zip(reckoned.values(), tracks, strict=True)])
    of_fixes = left_by_fixes(of_each, [(track.fix_t, track.poses) for track in tracks])
    names = [track.name for track in prediction.tracks]
    judged = [{m: _without_offset(m, e) for m, e in run.items() if _is_judged(m)} for run in after]
    by_chance = dict(chance)
    for m in measures_of(judged):
        by_chance[m] = float(np.hypot(chance.get(m, 0.0), _by_command_times(prediction, m)))
    found = [*_too_noisy(noise), *too_large(judged, sensors, by_chance, names, of_fixes)]
    for series in (motion, rooms):
        for m in measures_of(series):
            own = [(name, run[m]) for name, run in zip(names, series, strict=True) if m in run]
            pooled = _as_pooled(m)
            usual = float(np.hypot(sensors.get(pooled, 0.0), assumed.get(pooled, 0.0)))
            usual *= max(1.0, _by_chance(pooled, [run.errors for _, run in own]))
            found += [r for r in (predicted(m, own, usual), _repeated(m, own, usual)) if r is not None]
    if prediction.replay.body.robot.driven == COMMAND:
        found += by_command(prediction, windows, after, motion, sensors)
    found += _unlike(motion, sensors, chance)
    return sorted(found, key=lambda remainder: -remainder.ratio)


def _by_command_times(prediction, m) -> float:
    """What unknown moments of changes of the command leave of a measure; 0 of one that is not of free runs on it."""
    tracks, horizon_s = prediction.tracks, seconds_of(m.horizon) or TICK_S * prediction.row_ticks
    if m.driven_by != COMMAND:
        return 0.0
    if m.metric == RPE:
        return left_by_command_times(tracks, horizon_s)[m.channel]
    return angles_left_by_command_times(tracks, prediction.replay.body.plant.geometry.inverse, horizon_s)


def _is_judged(m: Measure) -> bool:
    """Whether noise tells how large an error may be: not of free runs on recorded torque, nor of whole ones."""
    return m.driven_by == WHEELS or m.metric == PREDICTION or (m.driven_by == COMMAND and m.metric == RPE)


def _too_noisy(noise):
    return [
        Remainder(
            source, NOTHING, strength, "times the assumed force", "", strength / noise.limits[source], "", [],
            "no plausible noise is as strong",
        ) for source, strength in noise.needed.items() if source not in WALKS and strength > noise.limits[source]
    ]


def too_large(
    after: Sequence[Errors], sensors: Mapping[Measure, float], chance: Mapping[Measure, float], names: Sequence[str],
    of_fixes: Mapping[tuple[str, str], float] = MappingProxyType({}),
    most: Mapping[Measure, float] = MappingProxyType({}),
) -> list[Remainder]:
    """Where an error of the next samples, or of places and angles over longer times, is larger than it may be.

    after: errors of each run. sensors, chance: as of `remainders`. names: of the runs. of_fixes: as of
        `left_by_fixes`. most: measure -> size that noise hardly ever exceeds, where it is known.
    """
    found = []
    for m in sorted(measures_of(after)):
        if (m.metric == PREDICTION) != (m.horizon == STEP):
            continue
        own = [(name, run[m]) for name, run in zip(names, after, strict=True) if m in run]
        having, errors = zip(*own, strict=True)
        floor = float(np.hypot(sensors.get(m, np.inf), chance.get(m, 0.0)))
        sizes, size = [rms([one]) for one in errors], rms(errors)
        if size > max(max(TOO_LARGE[m.metric], _by_chance(m, errors)) * floor, most.get(m, 0.0), 1e-300):
            because = f"sensors and plausible process noise leave {amount(floor, m.unit)}"
            if of_fixes.get((m.horizon, m.channel), 0.0) ** 2 > 0.5 * size**2:
                because += f"; {_OF_FIXES}"
            found.append(Remainder(
                m.channel, NOTHING, size, m.unit, m.horizon, size / floor, "", worst_runs(sizes, having), because,
            ))
    return found


def _by_chance(m: Measure, errors: Sequence[np.ndarray]) -> float:
    """How many times too large a relative error over few windows is by chance, if it is noise.

    Windows end to end share a fix: of white errors of the fixes only some count as independent.
    """
    numbers = sum(map(np.size, errors)) * INDEPENDENT
    return float(np.sqrt(chi2.isf(CHANCE, numbers) / numbers)) if m.metric == RPE and numbers else 0.0


def _without_offset(m: Measure, rows: np.ndarray) -> np.ndarray:
    """Errors (k, d) of a run, less as much of their mean as the offset of a sound IMU can make."""
    sensor, _, name = m.channel.partition(": ")
    if sensor != "imu":
        return rows
    most = CERTAIN * IMU_OFFSETS[name]
    return rows - np.clip(rows.mean(axis=0), -most, most)


def _repeated(m: Measure, runs: Sequence[tuple[str, Series]], usual: float) -> Remainder | None:
    """An error that comes again in runs of the same motion; None as in `predicted`."""
    series = [run for _, run in runs]
    lasts = min(run.t[-1] - run.t[0] for run in series) if all(len(run.t) for run in series) else 0.0
    share, deviate = repeated_share(
        [(run.motion, run.errors) for run in series], int(lasts / (2.0 * seconds_of(m.horizon)))
    )
    size = rms([run.errors for run in series]) * float(np.sqrt(max(share, 0.0)))
    if share < PREDICTED or deviate < CERTAIN or size < usual:
        return None
    because = f"{100 * share:.0f} % of the squared error over {m.horizon} comes again in runs of the same motion"
    return going_with(m, runs, "the motion", size, share / PREDICTED, because)


def _as_pooled(m):
    """The measure of the gap that is of the same errors."""
    if m.metric == PREDICTION:
        return m
    return Measure(m.metric, m.horizon, "heading" if m.unit == "rad" else "position", m.unit, m.driven_by)


def _unlike(motion, sensors, chance):
    """Wheels whose errors, beyond what sensors leave, are larger than those of the wheels that are like them.

    They must be, both as they are and over what noise leaves of each wheel, which depends on the motion and on how the
    robot stands, and which is an assumption.
    """
    wheels = [m for m in motion[0] if m.channel.startswith("encoder")] if motion else []
    if len(wheels) < 3 or not all(sensors.get(m, 0.0) for m in wheels):
        return []  # of two wheels nobody knows which one is wrong; a variable must tell
    blocks = []
    for run in motion:
        squares = np.column_stack([run[m].errors[:, 0] ** 2 for m in wheels])
        blocks += [part.mean(axis=0) for part in np.array_split(squares, MOST_BLOCKS) if len(part) > 1]
    if len(blocks) < 2:  # too short to tell a wheel from chance
        return []
    blocks, sensed = np.array(blocks), np.array([sensors[m] for m in wheels]) ** 2
    noise = sensed + np.array([chance.get(m, 0.0) for m in wheels]) ** 2
    found = []
    for k, m in enumerate(wheels):
        times = min(_times_others(blocks, k, sensed[k]), _times_others(blocks / noise, k, sensed[k] / noise[k]))
        if times > _UNLIKE:
            found.append(Remainder(
                m.channel, "this wheel", float(np.sqrt(blocks[:, k].mean())), m.unit, m.horizon, times / _UNLIKE, "",
                [], f"the error is {times:.2f} times that of the wheels that are like it",
            ))
    return found


def _times_others(squares: np.ndarray, k: int, sensed: float) -> float:
    """How many times as large as the others' the error of wheel k is; 0 where that may be chance.

    squares: (blocks, wheels) of the errors in each block of time. sensed: of them, what sensors leave of wheel k.
    """
    others = np.delete(squares, k, axis=1)
    ratios = 0.5 * np.log(squares[:, k] / np.median(others, axis=1))
    if ratios.mean() <= CERTAIN * ratios.std(ddof=1) / np.sqrt(len(ratios)):
        return 0.0
    return float(np.sqrt(max(squares[:, k].mean() - sensed, 0.0) / np.median(others.mean(axis=0))))


def _sensed(prediction: Prediction, i: int, windows: Windows, after: Errors) -> dict[Measure, Series]:
    """Errors of wheels and IMU over the shortest horizon."""
    m = motion_of(prediction, prediction.tracks[i])
    drivers = drivers_of(m, False) | {"wheel angle": of_wheel_angle(m)}
    middle = windows.dense + windows.lengths[windows.shortest] // 2
    drivers = {name: rows[middle] for name, rows in drivers.items()}
    series = {}
    for measure, rows in after.items():
        if (measure.metric, measure.horizon) == (PREDICTION, windows.shortest):
            series[measure] = Series(middle * TICK_S, _without_offset(measure, rows), drivers["speed"], drivers)
    return series


def _places(prediction: Prediction, i: int, reckoned: np.ndarray) -> dict[Measure, Series]:
    """Errors of dead reckoning, (k, 3) poses at the fixes, over each horizon, in the axes of the body and of the room.
    """
    track, series = prediction.tracks[i], {}
    for horizon in HORIZONS_S:
        rows = pairs(track.fix_t, horizon, 0.0)
        if not len(rows):
            continue
        begin, end = (track.poses[column] for column in rows.T)
        by_wheels = tuple(reckoned[column] for column in rows.T)
        in_body = relative_errors(by_wheels, (begin, end))
        in_room = rotated(in_body[:, :2], end[:, 2])  # errors are seen from the measured pose at the end
        way = relative(*by_wheels)
        along = _of_motion(relative(by_wheels[1], by_wheels[0]))
        across = _of_place(prediction, track, rows, begin, compose(begin, way))
        label, t = horizon_of(horizon), track.fix_t[rows[:, 1]]
        for channel, unit, errors, drivers in (
            ("kinect: along the body", "m", in_body[:, :2], along), ("kinect: along the room", "m", in_room, across),
            ("kinect: heading", "rad", in_body[:, 2:], along | across),
        ):
            series[Measure(RPE, label, channel, unit, WHEELS)] = Series(t, errors, along["speed"], drivers)
    return series


def _of_motion(way):
    """Functions of the motion in a window (k, 3), as seen from its end and as the wheels say: fixes share their errors.
    """
    return {"speed": way, "direction": np.sign(way) * np.abs(way).mean(axis=0), "distance": np.abs(way)}


def _of_place(prediction, track: Track, rows, begin, end):
    """Functions of the place at both ends of a window, along the axes of the room; end: from begin on as wheels say."""
    velocity = rotated(motion_of(prediction, track).body[track.fix_ticks, :2], track.poses[:, 2])

    def terms(pose):
        x, y = pose[:, 0], pose[:, 1]
        return np.column_stack([x, y, x * x, x * y, y * y])

    return {"place": terms(end) - terms(begin), "change of speed": velocity[rows[:, 1]] - velocity[rows[:, 0]]}
