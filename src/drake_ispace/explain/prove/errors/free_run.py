"""Free-run simulations of the model along recorded runs, and their errors.

Two ways lead from what was recorded to a place. The measured wheels turn the model: dead reckoning. Or the recorded
command (torque, or velocity of the body) drives the model and nothing corrects it: a filter holds the model on the
measured motion up to the start of a window, and lets go there. Windows begin at measured poses.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from drake_ispace.blocks.frames import wrap
from drake_ispace.blocks.rates import TICK_S, ticks_in
from drake_ispace.explain.predict.prediction import Prediction
from drake_ispace.explain.predict.replay import Replay, Values
from drake_ispace.explain.predict.room_view import LEAD_TICKS
from drake_ispace.explain.predict.tracks import SHORTEST_S, Track
from drake_ispace.explain.prove.errors.paths import (
    absolute_errors,
    aligned,
    chained,
    compose,
    pairs,
    relative,
    relative_errors,
)
from drake_ispace.rollout.segments import Segments, State

ATE, RPE, PREDICTION = "ATE", "RPE", "prediction"
RUN, STEP, WHEELS = "run", "step", "wheels"
HORIZONS_S = (1.0, 5.0)  # of places
SPACING_S = min(HORIZONS_S)  # between the starts of windows
DENSE_S = 0.2  # the same for the shortest horizon
_SENSED_S = (DENSE_S, *HORIZONS_S)  # of wheels and IMU
_FALLING_S = (0.05, 0.1, DENSE_S)  # of a robot that falls by itself, which multiplies an error tenfold in 0.1 s


@dataclass(frozen=True, order=True)
class Measure:
    """A quantity in which model and measurement are compared.

    Attributes:
        metric: "ATE", "RPE" or "prediction". horizon: "run", "5s", "1s", ... channel: "position", "heading" or a
            sensor's, such as "encoder: wheel 1". unit: of the errors. driven_by: "wheels", "torque" or "command".
    """

    metric: str
    horizon: str
    channel: str
    unit: str
    driven_by: str


#: Measure -> (k, d) errors of one run, the model as seen from the measurement; d is 2 for positions, else 1.
Errors = dict[Measure, np.ndarray]


def measures_of(runs: Sequence[Errors]) -> list[Measure]:
    """Every measure of some runs, once, in their order."""
    return list(dict.fromkeys(m for run in runs for m in run))


@dataclass(frozen=True)
class Windows:
    """Where the free runs of one run begin, and which fixes they are compared with.

    Attributes:
        starts: (k,) ticks, ascending, a second apart. dense: (q,) ticks, DENSE_S apart, for the shortest horizon.
        lengths: name of a horizon -> ticks. fixes: name of a horizon -> (m, 3) number of the window, and of the fixes
            at its begin and its end; empty where no place can be predicted. reckoned: name of a horizon -> (m, 2)
            numbers of the fixes between which dead reckoning is compared.
        start: (3,) pose from which whole runs begin, estimated from the fixes of the first second. first: tick at which
            a whole run is let go; None: the robot cannot run free as long.
    """

    starts: np.ndarray
    dense: np.ndarray
    lengths: Mapping[str, int]
    fixes: Mapping[str, np.ndarray]
    reckoned: Mapping[str, np.ndarray]
    start: np.ndarray
    first: int | None

    @property
    def shortest(self) -> str:
        """Name of the shortest horizon."""
        return min(self.lengths, key=self.lengths.get)


def windows_of(prediction: Prediction, i: int, values: Values) -> Windows:
    """The windows of run `i`, for every model with which it is compared; values: effects of the answer."""
    track, robot = prediction.tracks[i], prediction.replay.body.robot
    lengths = {horizon_of(s): ticks_in(s) for s in (_FALLING_S if robot.own_dynamics else _SENSED_S)}
    let_go, end = max(ticks_in(SHORTEST_S), track.settled), track.ticks - min(lengths.values())
    starts, dense = (np.arange(let_go, end, ticks_in(apart)) for apart in (SPACING_S, DENSE_S))
    start = start_of(prediction, i, values)
    reckoned = {horizon_of(seconds): pairs(track.fix_t, seconds, SPACING_S) for seconds in HORIZONS_S}
    if robot.own_dynamics or len(track.fix_t) < 2:
        return Windows(starts, dense, lengths, {}, reckoned, start, None)
    begins = pairs(track.fix_t, SPACING_S, SPACING_S)[:, 0]
    begins = begins[track.fix_t[begins] >= let_go * TICK_S]
    fixes = {}
    for seconds in HORIZONS_S:
        ends = dict(pairs(track.fix_t, seconds, 0.0).tolist())
        rows = [(k, fix, ends[fix]) for k, fix in enumerate(begins.tolist()) if fix in ends]
        fixes[horizon_of(seconds)] = np.array(rows, int).reshape(-1, 3)
    return Windows(track.fix_ticks[begins], dense, lengths, fixes, reckoned, start, let_go)


def start_of(prediction: Prediction, i: int, values: Values) -> np.ndarray:
    """(3,) the pose from which whole runs of run `i` begin.

    values: effects of the answer. The pose is estimated with them, by dead reckoning over the first second, which
        every run has: a model that lacks a latency would begin a moving robot where the camera saw it later.
    """
    track = prediction.tracks[i]
    if len(track.fix_t) < 2:
        return prediction.starts[i][:3]
    reckoned = Simulation(prediction.replay, track, prediction.starts[i], values).reckoned
    first = track.fix_t <= track.fix_t[0] + SHORTEST_S
    return aligned(relative(reckoned[0], reckoned[1:][first]), track.poses[first])


def horizon_of(seconds: float) -> str:
    """The name of a horizon of some seconds."""
    return f"{seconds:g}s"


def seconds_of(horizon: str) -> float:
    """A horizon in seconds: a whole run is longer than any, the next sample shorter."""
    return {RUN: np.inf, STEP: 0.0}[horizon] if horizon in (RUN, STEP) else float(horizon.removesuffix("s"))


class Simulation:
    """The model with some effects along one run.

    Args:
        replay: compiled. track: the run. start: (3 + n,) pose and wheel angles at t = 0. values: effects.
        stops: (k,) ascending ticks whose states are kept, for free runs from there.

    Attributes:
        poses: (rows, 3) what the camera would report at every tick of the model that is held on the motion.
        innovations: (rows, p) of the filter at every tick.
    """

    def __init__(self, replay: Replay, track: Track, start: np.ndarray, values: Values, stops=()):
        self._replay, self._held = replay, replay.since(track, replay.parameters(values))
        self._free = replay.freed(self._held)
        self._late_s = replay.clock_offset_s(self._held)
        self._last = track.ticks + LEAD_TICKS - 1
        self._states: dict[int, State] = {}
        inputs = replay.packed(track, self._held, replay.inputs)
        self._segments = Segments(replay.rollout, self._last + 1, inputs)
        state, at = (replay.state(start, self._held), replay.rollout.discrete_state.copy()), 0
        for stop in sorted({*map(int, stops), self._last}):
            logs = self._segments.run(at, stop, state, self._held)
            self._states[stop], at = tuple(part.copy() for part in state), stop
        self.poses, self.innovations = logs["pose"].copy(), logs["innovation"][1:].copy()
        self._lags, self._times_s = logs["error"][1:, : replay.body.wheels].copy(), track.fix_t

    @cached_property
    def reckoned(self) -> np.ndarray:
        """(1 + k, 3) poses at t = 0 and at every fix, dead-reckoned: the model's wheels turn as the measured ones."""
        return np.vstack([self._exact[:1], self._at(self._times_s, self._exact)])

    @cached_property
    def _exact(self):
        """(rows, 3) the poses, if the wheels did not lag behind the measured ones."""
        behind = np.vstack([np.zeros(3), self._lags @ self._replay.body.plant.geometry.forward.T])
        return chained(self.poses[0], relative(self.poses[:-1], self.poses[1:]) + np.diff(behind, axis=0))

    def ends(self, times_s: np.ndarray, since: int, logs: Mapping[str, np.ndarray]) -> np.ndarray:
        """(k, 3) what the camera would report at these times [s], the model running free from the tick `since` on.

        logs: of the free run.
        """
        return self._at(times_s, self.poses, logs["pose"], since)

    def whole(self, times_s: np.ndarray, since: int, logs: Mapping[str, np.ndarray]) -> np.ndarray:
        """(1 + k, 3) the same at t = 0 and at these times; before the tick `since` the model is dead-reckoned."""
        free = compose(self._exact[since], relative(self.poses[since], logs["pose"][since:]))
        path = np.vstack([self._exact[:since], free])
        return np.vstack([path[:1], self._at(times_s, path)])

    def _at(self, times_s, poses, free=None, since=0):
        """(k, 3) what the camera reports at these times of poses (rows, 3) at every tick, from `since` on of `free`."""
        k = np.clip((times_s - self._late_s) / TICK_S, 0.0, len(poses) - 2.0)
        low = k.astype(int)
        before, after = poses[low], poses[low + 1]
        if free is not None:
            before[low >= since], after[low + 1 >= since] = free[low[low >= since]], free[low[low + 1 >= since] + 1]
        step = after - before
        step[:, 2] = wrap(step[:, 2])
        return before + (k - low)[:, None] * step

    def free(self, start: int, length: int) -> Mapping[str, np.ndarray]:
        """Logs of the free run of `length` ticks from the tick `start`, one of the stops."""
        state = tuple(part.copy() for part in self._states[start])
        return self._segments.run(start, min(start + length, self._last), state, self._free)


@dataclass(frozen=True)
class Simulated:
    """What the model does along one run, whatever the fixes say of the place.

    Attributes:
        reckoned: (1 + k, 3) dead-reckoned poses at t = 0 and at the fixes; None: not wanted. ends: name of a horizon ->
            (m, 2, 3) poses of free runs at the fixes at the begin and at the end of each of its windows. path:
            (1 + k, 3) poses of the whole free run, as `reckoned`; None: there is none. sensed: errors of wheels and
            IMU. horizons: those that are wanted, None: all.
    """

    reckoned: np.ndarray | None
    ends: Mapping[str, np.ndarray]
    path: np.ndarray | None
    sensed: Errors
    horizons: Collection[str] | None


def errors(
    prediction: Prediction, i: int, windows: Windows, values: Values, horizons: Collection[str] | None = None
) -> Errors:
    """Errors of run `i` of the model with the effects of `values`; a measure without any window has no entry.

    horizons: names of those that are wanted, default all; of whole runs then by dead reckoning only.
    """
    simulated = simulate(prediction, i, windows, values, horizons)
    return compare(prediction, prediction.tracks[i], windows, simulated)


def simulate(
    prediction: Prediction, i: int, windows: Windows, values: Values, horizons: Collection[str] | None = None
) -> Simulated:
    """Simulate run `i` as `errors` does."""
    track, replay = prediction.tracks[i], prediction.replay
    driven, sensed = replay.body.robot.driven, {}
    places = {name: rows for name, rows in windows.fixes.items() if horizons is None or name in horizons}
    lengths = {name: ticks for name, ticks in windows.lengths.items() if horizons is None or name in horizons}
    first = windows.first if horizons is None else None
    long = places or set(lengths) - {windows.shortest}
    stops = [*(windows.starts if long else ()), *windows.dense, *([] if first is None else [first])]
    simulation = Simulation(replay, track, prediction.starts[i], values, stops)
    ends, path = {}, None
    if {"encoder", driven} <= replay.feeds:
        ends, measured = _windows(prediction, track, windows, simulation, places, lengths)
        for name, rows in measured.items():
            for column, channel in zip(rows.T, prediction.labels("motion"), strict=False):
                sensed[Measure(PREDICTION, name, channel, prediction.unit(channel), driven)] = -column[:, None]
        if first is not None:
            path = simulation.whole(track.fix_t, first, simulation.free(first, track.ticks))
    if horizons is None or STEP in horizons:
        for column, channel in zip(prediction.columns, prediction.labels("motion"), strict=True):
            innovations = simulation.innovations[track.settled : track.ticks, column, None]
            sensed[Measure(PREDICTION, STEP, channel, prediction.unit(channel), driven)] = -innovations
    reckoned = simulation.reckoned if horizons is None or {RUN, *windows.reckoned} & set(horizons) else None
    return Simulated(reckoned, ends, path, sensed, horizons)


def _windows(prediction, track, windows, simulation, fixes, lengths):
    """Poses at the ends of the windows, as of Simulated, and name of a horizon -> (m, p) innovations at their ends.

    fixes, lengths: of the horizons of places and of sensors that are wanted.
    """
    places, sensed = {name: [] for name in fixes}, {name: [] for name in lengths}
    short = windows.lengths[windows.shortest]
    for start in windows.dense.tolist() if windows.shortest in lengths else ():
        logs = simulation.free(start, short + 1)
        sensed[windows.shortest].append(logs["innovation"][start + short + 1, prediction.columns].copy())
    long = [name for name, length in lengths.items() if length > short]
    for k, start in enumerate(windows.starts.tolist()):
        ends = {name: start + lengths[name] for name in long if start + lengths[name] < track.ticks}
        rows_of = {name: rows[rows[:, 0] == k, 1:] for name, rows in fixes.items()}
        fixes_at = [int(track.fix_ticks[b]) for rows in rows_of.values() for _, b in rows]
        if not (ends or fixes_at):
            continue
        logs = simulation.free(start, max([*ends.values(), *fixes_at]) - start + LEAD_TICKS)
        for name, end in ends.items():  # the innovation of a tick stands in the row after it
            sensed[name].append(logs["innovation"][end + 1, prediction.columns].copy())
        for name, rows in rows_of.items():
            places[name] += [simulation.ends(track.fix_t[pair], start, logs) for pair in rows]
    ends = {name: np.array(parts).reshape(-1, 2, 3) for name, parts in places.items()}
    return ends, {name: np.array(parts) for name, parts in sensed.items()}


def compare(prediction: Prediction, track: Track, windows: Windows, simulated: Simulated) -> Errors:
    """Errors of a simulation of `track`, or of the same run with other fixes at the same times."""
    driven, feeds, found = prediction.replay.body.robot.driven, prediction.replay.feeds, {}
    wanted = lambda name: simulated.horizons is None or name in simulated.horizons  # noqa: E731
    measured = track.poses
    if {"encoder", "kinect"} <= feeds and len(track.fix_t) > 1:
        if wanted(RUN):
            _add_poses(found, ATE, RUN, WHEELS, _whole(windows, track, simulated.reckoned))
        for name, rows in windows.reckoned.items():
            if wanted(name):
                of = lambda poses, rows=rows.T: tuple(poses[row] for row in rows)  # noqa: E731
                _add_poses(found, RPE, name, WHEELS, relative_errors(of(simulated.reckoned[1:]), of(measured)))
    for name, ends in simulated.ends.items():
        rows = windows.fixes[name].T[1:]
        _add_poses(found, RPE, name, driven, relative_errors(ends.transpose(1, 0, 2), measured[rows]))
    if simulated.path is not None:
        _add_poses(found, ATE, RUN, driven, _whole(windows, track, simulated.path))
    return found | simulated.sensed


def _whole(windows, track, path):
    """(k, 3) absolute errors of a path that begins at the estimated start; path: (1 + k, 3) at t = 0 and the fixes."""
    return absolute_errors(compose(windows.start, relative(path[0], path[1:])), track.poses)


def _add_poses(found, metric, horizon, driven_by, differences):
    if len(differences):
        found[Measure(metric, horizon, "position", "m", driven_by)] = differences[:, :2]
        found[Measure(metric, horizon, "heading", "rad", driven_by)] = differences[:, 2:]


def changes(before: Errors, after: Errors) -> Errors:
    """By how much errors changed, 0 where the model ran away; a measure with other windows has no entry."""
    return {
        m: np.nan_to_num(wrap(after[m] - rows) if m.channel == "heading" else after[m] - rows)
        for m, rows in before.items() if m in after and after[m].shape == rows.shape
    }


def rms(runs) -> float:
    """Root mean square length of errors (k, d), all runs pooled; NaN where there is none."""
    pooled = [np.sum(part**2, axis=1) for part in runs]
    return float(np.sqrt(np.mean(np.concatenate(pooled)))) if sum(map(len, pooled)) else float("nan")
