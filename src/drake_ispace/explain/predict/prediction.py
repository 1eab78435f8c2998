"""Every prediction that the channels allow, and its residuals, measured less predicted.

Residuals come in streams, each with its own clock and noise:

- `motion`: recorded command -> encoder and IMU, at every tick. They are not averaged over ticks: the rounding error of
  a count at one tick shows at the next; a mean would hide this, and make a command that followed the error look late.
- `room`: measured wheels -> the camera's fixes, at the instants of the camera.
- `start`: the first fix against the pose from which the scenario starts.
- `looks`: captures of the camera without a fix.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import maximum_filter1d
from scipy.signal import lfilter

from drake_ispace.blocks.frames import wrap
from drake_ispace.blocks.rates import TICK_S
from drake_ispace.explain.counts import smallest_step
from drake_ispace.explain.predict.begun import Begun
from drake_ispace.explain.predict.replay import Replay, Values
from drake_ispace.explain.predict.room_gain import tuned
from drake_ispace.explain.predict.room_view import SIGHTING
from drake_ispace.explain.predict.tracks import Track, read_ticks
from drake_ispace.explain.threads import each
from drake_ispace.plants.slip import GRAVITY
from drake_ispace.robots.robot import COMMAND

_SPEED_COUNTS, _SPEED_TICKS = 10, 20  # over which the speed of a wheel is averaged
_CLASS_EDGES = (0.05, 0.1, 0.2, 0.4)  # between classes of motion, in root mean squares of wheel speed
_RECOVERY_TICKS = 120  # after a rest with dry friction, until the filter has forgotten it
COARSE_COUNT = 0.01  # rad: within a larger count, a wheel at rest hides more than its friction
_SEGMENT_TICKS = 500  # over which the place of a wheel within a coarse count is one offset
_SLOW_TICKS, _SLOW_SHARE = 400, 0.4  # slow unknown forces: how long one lasts, and its share of Robot.unknown_forces
_MOST_MOMENTS = 100  # of changes of a command in a run: each costs as much as the run is long
_START_M, _START_RAD = 0.15, 0.3  # a first fix farther from the scenario's start than this: the start is unknown
#: By how much a sound consumer IMU, its mounting included, may be off in a run (standard deviations) [m/s^2, rad/s].
IMU_OFFSETS = {"ax": 0.07, "ay": 0.1, "az": 0.05} | dict.fromkeys(("wx", "wy", "wz"), 0.004)
#: The roll rate of a leaning body, -yaw rate times tilt, mostly shows the error of the tilt, which nothing measures.
#: Its sign and size change as the robot turns, so that no stationary noise can stand for it.
_NOT_PREDICTED = "wx"
_LATE_TICKS = 3  # within which an accelerometer shows a jump of the torque
_UNITS = {
    "wheel": "rad", "ax": "m/s^2", "ay": "m/s^2", "az": "m/s^2", "wx": "rad/s", "wy": "rad/s", "wz": "rad/s", "x": "m",
    "y": "m", "heading": "rad", "seen": "1",
}
_TILT_S = 0.5  # over which the tilt, as gravity shows it, is averaged

Residuals = list[dict[str, np.ndarray]]  # per run: stream -> (rows, channels)
Speeds = Callable[[np.ndarray], np.ndarray]  # (ticks, n) angles of wheels [rad] -> (ticks, n) their speeds [rad/s]


def change(one: dict[str, np.ndarray], other: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Residuals of a run, stream -> (rows, channels), less others of it, in single precision: hundreds are kept.

    Where a model runs away they are infinite, or no numbers.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        return {name: (one[name] - other[name]).astype(np.float32) for name in one}


@dataclass(frozen=True)
class Prediction:
    """A model against recorded runs: residuals with any effects in it, and their changes by nuisance parameters.

    Attributes:
        replay: the compiled prediction Diagram.
        tracks: the runs.
        starts: (3 + n,) pose and wheel angles of each run at t = 0.
        anchored: of each run, whether it starts at the scenario's start, the first way point.
        channels: stream -> names of its columns.
        columns: which of the replay's outputs are in the stream "motion".
    """

    replay: Replay
    tracks: list[Track]
    starts: list[np.ndarray]
    anchored: list[bool]
    channels: dict[str, list[str]]
    columns: list[int]

    @property
    def row_ticks(self) -> int:
        """Ticks from row to row of the stream "motion"."""
        return read_ticks(self.tracks)

    def labels(self, stream: str) -> list[str]:
        """The channels of a stream, each with its sensor in front, such as "kinect: x"."""
        def source(name):
            if stream == "motion":
                return "encoder" if name.startswith("wheel") else "imu"
            return "start" if stream == "start" else "kinect"

        return [f"{source(name)}: {name}" for name in self.channels[stream]]

    @staticmethod
    def unit(label: str) -> str:
        """The unit of a channel called as in `labels`."""
        return _UNITS[label.split()[1]]

    def residuals(self, values: Values) -> Residuals:
        """The residuals of every run with these effects in the model."""
        return self._residuals(self.tracks, values)

    def injected(self, commands: Sequence[np.ndarray], values: Values) -> Residuals:
        """The residuals with `commands` (ticks + LEAD_TICKS, m), one per run, added to the recorded ones."""
        return self._residuals([
            replace(track, command=track.command + added) for track, added in zip(self.tracks, commands, strict=True)
        ], values)

    def pushed(self, forces: Sequence[np.ndarray], values: Values) -> Residuals:
        """The residuals with further `forces` (ticks + LEAD_TICKS, 3), one per run, on the body; see Replay.pushed."""
        tracks = [self.replay.pushed(track, force) for track, force in zip(self.tracks, forces, strict=True)]
        return self._residuals(tracks, values)

    def read_off(self, angles: Sequence[np.ndarray], values: Values) -> Residuals:
        """The residuals if the encoders showed these `angles` (ticks + LEAD_TICKS, n) [rad] more, one per run."""
        wheels = self.replay.body.wheels
        tracks = [replace(track, measured=track.measured.copy()) for track in self.tracks]
        for track, added in zip(tracks, angles, strict=True):
            track.measured[:, :wheels] -= added
        return self._residuals(tracks, values)

    def _residuals(self, tracks, values):
        """The residuals of these tracks in the place of the runs' own."""
        numbers, share = self.replay.parameters(values), self._dropouts(values)
        one = lambda i, track: self._of_run(i, track, numbers, share)  # noqa: E731
        return each(one, range(len(tracks)), tracks)

    def displaced(self, displacements: Sequence[np.ndarray], values: Values) -> Residuals:
        """The residuals if the model moved by `displacements` (ticks + LEAD_TICKS, 3) [m, m, rad] more, one per run."""
        tracks = []
        for track, added in zip(self.tracks, displacements, strict=True):
            sightings = track.sightings.copy()
            sightings[track.fix_rows, SIGHTING.x : SIGHTING.phi + 1] -= added[track.fix_ticks]
            tracks.append(replace(track, sightings=sightings))
        return self._residuals(tracks, values)

    def nuisances(
        self, values: Values
    ) -> list[tuple[int, dict[str, np.ndarray]]]:
        """The changes of the residuals by every offset that a run may have, one prior standard deviation large.

        Returns:
            (run, stream -> (rows, channels)) of each, in the order of the runs.
        """
        numbers, share = self.replay.parameters(values), self._dropouts(values)
        at, jobs, ticks = self.residuals(values), [], []
        for i, track in enumerate(self.tracks):
            moved = [(k, lambda t=track, o=o: replace(t, measured=t.measured + o)) for k, o in self._offsets(track)]
            moved += [(k, lambda t=track, f=f: self.replay.pushed(t, f)) for k, f in self._slow_forces(track)]
            moved += [
                (k, lambda t=track, k=k: self.replay.pushed(t, _only(t.unsure, k))) for k in self._unsure_ticks(track)
            ]
            ticks.append([since for since, _ in moved])
            jobs += [(i, *job) for job in moved]
        begun = each(
            lambda *run: Begun(self.replay, run[0], run[1], numbers, run[2]), self.tracks, self.starts, ticks
        )

        def one(job):
            i, since, moved = job
            track = moved()
            return i, change(self._streams(i, track, *begun[i].run(track, since), share), at[i])

        return each(one, jobs)

    def _slow_forces(self, track):
        """Yield the tick from which on, and an unknown force (rows, 3) along one axis over a few seconds, one standard
        deviation large."""
        robot = self.replay.body.robot
        if robot.driven == COMMAND or robot.unknown_forces is None or not self.channels["motion"]:
            return
        for axis, size in enumerate(robot.unknown_forces):
            for start in range(0, track.ticks, _SLOW_TICKS):
                force = np.zeros((len(track.command), 3))
                force[start : start + _SLOW_TICKS, axis] = _SLOW_SHARE * size
                yield start, force

    def _unsure_ticks(self, track) -> list[int]:
        """The ticks in which the command changes at an unknown moment; of a long run those of the largest changes."""
        if track.unsure is None or not self.channels["motion"]:
            return []
        sizes = np.linalg.norm(track.unsure[: track.ticks], axis=1)
        return sorted(np.argsort(-sizes, kind="stable")[: min(_MOST_MOMENTS, np.count_nonzero(sizes))].tolist())

    def under_other_noise(self, values: Values) -> list[Residuals]:
        """The residuals under each of the filter's other gains, as if its assumptions about noise were wrong."""
        share = self._dropouts(values)
        return [
            [self._of_run(i, track, changed, share) for i, track in enumerate(self.tracks)]
            for changed in (self.replay.parameters(values, number) for number in range(self.replay.others))
        ]

    def under_other_timing(self, values: Values) -> list[Residuals]:
        """The residuals if the accelerometer showed jumps of the torque at another moment of the tick, 0 to 2 ticks on.

        An accelerometer shows what acts at the very instant of its sample, or behind a low pass of its own. In the
        model a torque is its mean over the tick, which determines where the robot goes, but not what acts at that
        instant. Without an IMU, or without the stream "motion", the list is empty.
        """
        if not self.replay.body.robot.has_imu or not self.channels["motion"]:
            return []
        late = lambda track, ticks: replace(track, measured=track.measured + self._jumps_shown(track, ticks))  # noqa: E731
        return [self._residuals([late(t, ticks) for t in self.tracks], values) for ticks in range(_LATE_TICKS)]

    def _jumps_shown(self, track, ticks):
        """(rows, p) change of `measured` if the timing of the torque's jump of `ticks` ago were half a tick off."""
        imu = self.replay.body.wheels
        robot, plant = self.replay.body.robot, self.replay.body.plant
        acceleration = (track.command @ np.linalg.solve(robot.mass_matrix(plant), robot.effort(plant)).T)[:, 0]
        jump, change = 0.5 * np.diff(acceleration), np.zeros(track.measured.shape)
        keep = 1.0 - TICK_S / _TILT_S
        ax, pitching = track.measured[:, imu], track.measured[:, imu + 4]
        tilt = lfilter([1.0], [1.0, -keep], keep * TICK_S * pitching - (1.0 - keep) * ax / GRAVITY)
        change[2 + ticks :, imu] = jump[: len(jump) - 1 - ticks]
        change[:, imu + 2] = np.sin(tilt) * change[:, imu]
        return change

    def _offsets(self, track):
        """Yield the tick from which on, and an offset (rows or 1, p) of `measured`, one standard deviation large.

        A wheel is anywhere within its count, and stays there while it rests. An IMU has a bias.
        """
        rows, p = track.measured.shape
        wheels, count = self.replay.body.wheels, track.count_rad
        starts = range(0, track.ticks, _SEGMENT_TICKS) if count > COARSE_COUNT else [0]
        for column in range(wheels):
            for start in starts:
                offset = np.zeros((rows, p))
                end = start + _SEGMENT_TICKS if len(starts) > 1 and start < starts[-1] else rows
                offset[start:end, column] = count / np.sqrt(12.0)
                yield start, offset
        for column, size in enumerate(IMU_OFFSETS.values() if p > wheels else (), wheels):
            if column in self.columns:
                offset = np.zeros((1, p))
                offset[0, column] = size
                yield 0, offset

    def classes(self, values: Values, speeds: Speeds | None = None) -> list[dict[str, np.ndarray]]:
        """Per run, stream -> (rows,) class of motion by the speed of the slowest wheel; only of the stream "motion".

        Noise differs between rest and motion. Class 0, at rest, is not scored: a wheel that hardly turns sticks or not
        by chance. A wheel too slow for the dry friction that the model has with the effects in `values` is at rest,
        too, but for the fastest class.

        speeds: of the wheels from their angles, default `wheel_speeds`.
        """
        speeds, wheels, by_run = speeds or wheel_speeds, self.replay.body.wheels, []
        speeds_of_runs = [np.abs(speeds(track.turned[: track.ticks, :wheels])) for track in self.tracks]
        edges = np.array(_CLASS_EDGES) * np.sqrt(np.mean(np.vstack(speeds_of_runs) ** 2))
        turning = min(self.replay.turning_rad_s(values), edges[-1])
        for track, moving in zip(self.tracks, speeds_of_runs, strict=True):
            slowest = moving.min(axis=1)
            classes = np.where(slowest < turning, 0, np.searchsorted(edges, slowest))
            if self.replay.body.robot.friction(self.replay.body.plant).coulomb_n_m > 0.0:
                rests = maximum_filter1d(classes == 0, _RECOVERY_TICKS, origin=_RECOVERY_TICKS // 2 - 1)
                classes[rests] = 0
            by_run.append({"motion": classes[track.scored_ticks]})
        return by_run

    def modulations(self) -> list[Residuals]:
        """What the form of an effect could go with besides: by run and stream (rows, 1), each of root mean square 1.

        Speed, its direction, torque or command, and time; where there are fixes also the place, along x and y.
        """
        found = []
        for shape in (_speed, _forward, _load, _time, *([_place_x, _place_y] if self.channels["room"] else [])):
            by_run = [shape(self.replay.body, track) for track in self.tracks]
            size = np.sqrt(np.mean(np.concatenate(by_run) ** 2)) or 1.0
            found.append([
                {name: m[rows, None] / size for name, rows in self._ticks(i).items()} for i, m in enumerate(by_run)
            ])
        return found

    def _ticks(self, i):
        """Stream -> the tick of each row of run `i`, as far as these streams have an instant."""
        track = self.tracks[i]
        room = np.minimum(track.fix_ticks[track.scored_fixes], track.ticks - 1)
        return {"motion": track.scored_ticks, "room": room}

    def _dropouts(self, values):
        """The share of captures that these effects leave without a fix."""
        return values.get("camera_dropouts", {}).get("share", 0.0)

    def _of_run(self, i, track, numbers, dropouts):
        """Stream -> residuals of run `i`, in the form `track`, under these run-time numbers."""
        return self._streams(i, track, *self.replay.run(track, self.starts[i], numbers), dropouts)

    def _streams(self, i, track, motion, room, dropouts):
        """Stream -> residuals of run `i` from innovations of the outputs and of the fixes."""
        room = room[:, : len(self.channels["room"])]
        first = room[: int(self.anchored[i])]
        return {
            "motion": motion[np.ix_(track.scored_ticks, self.columns)], "room": room[track.scored_fixes],
            "start": first,
            "looks": track.missed[:, None] - dropouts if len(track.missed) else np.empty((0, 1)),
        }


def _only(rows, number):
    """The rows (k, n) of which all but one are zero."""
    one = np.zeros(rows.shape)
    one[number] = rows[number]
    return one


def _forward(body, track):
    """(ticks,) mean speed of the wheels, signed."""
    return wheel_speeds(track.turned[: track.ticks, : body.wheels]).mean(axis=1)


def _speed(body, track):
    return np.abs(wheel_speeds(track.turned[: track.ticks, : body.wheels])).mean(axis=1)


def _load(body, track):
    return np.abs(track.command[: track.ticks]).mean(axis=1)


def _time(body, track):
    return track.since_s + np.arange(track.ticks) * TICK_S


def _place_x(body, track):
    return _place(track, 0)


def _place_y(body, track):
    return _place(track, 1)


def _place(track, axis):
    """(ticks,) a coordinate of the fixes, between them on a straight line."""
    if not len(track.fix_ticks):
        return np.zeros(track.ticks)
    return np.interp(np.arange(track.ticks), track.fix_ticks, track.poses[:, axis])


def predict(replay: Replay, tracks: Sequence[Track], tune: bool = True) -> Prediction:
    """Set a model against runs, each starting at its first way point, or where the camera first saw the robot.

    tune: whether the gains of the room view are chosen anew where the robot is driven by velocity.
    """
    starts, anchored = [], []
    for track in tracks:
        start, is_known = _start(track)
        starts.append(np.concatenate([start, track.measured[0, : replay.body.wheels]]))
        anchored.append(is_known)
    robot, wheels = replay.body.robot, replay.body.wheels
    if robot.driven == COMMAND and tune:
        replay = tuned(replay, tracks, starts)
    names = [f"wheel {i + 1}" for i in range(wheels)] + (list(IMU_OFFSETS) if robot.has_imu else [])
    # without encoders, or without the IMU of a robot that has one, nothing holds the model on the motion: residuals
    # would show unknown forces, not physics that the model lacks
    followed = replay.feeds >= {"encoder", robot.driven} | ({"imu"} if robot.has_imu else set())
    columns = [i for i, name in enumerate(names) if followed and name != _NOT_PREDICTED]
    pose = ["x", "y", "heading"] if robot.in_room and replay.feeds & {"encoder", "command"} else []
    channels = {"motion": [names[i] for i in columns], "room": pose, "start": pose, "looks": ["seen"]}
    return Prediction(replay, list(tracks), starts, anchored, channels, columns)


def _start(track):
    """(3,) the pose at t = 0, and whether it is the scenario's start."""
    if not len(track.fix_ticks):
        return (np.zeros(3) if track.aim is None else track.aim), False
    first = track.poses[0]
    if track.aim is None or track.fix_t[0] > 0.2:
        return first, False
    if np.hypot(*(first - track.aim)[:2]) > _START_M or abs(wrap(first[2] - track.aim[2])) > _START_RAD:
        return first, False
    return track.aim, True


def past_speeds(angles: np.ndarray) -> np.ndarray:
    """(ticks, n) speeds of wheels [rad/s] at angles (ticks, n) [rad], each from the counts until then.

    Later counts share their noise with the residuals: a force that went with them would go with that noise as well.
    The speed is the mean over as many ticks as ten counts usually take, but over 20 at most.
    """
    steps = np.diff(angles, axis=0)
    usual = np.sqrt(np.mean(steps**2)) if len(steps) else 0.0
    ticks = int(min(np.ceil(_SPEED_COUNTS * smallest_step(angles, 0.1) / max(usual, 1e-12)), _SPEED_TICKS))
    return _mean_speeds(angles, ticks, 0)


def wheel_speeds(angles: np.ndarray) -> np.ndarray:
    """(ticks, n) speeds of wheels [rad/s] at angles (ticks, n) [rad], averaged over 20 ticks around each."""
    return _mean_speeds(angles, _SPEED_TICKS // 2, _SPEED_TICKS // 2)


def _mean_speeds(angles, before, after):
    """(ticks, n) speeds, averaged from `before` ticks before each to `after` ticks after it."""
    at = np.arange(len(angles))
    first, last = np.maximum(at - before, 0), np.minimum(at + after, len(angles) - 1)
    return (angles[last] - angles[first]) / (np.maximum(last - first, 1)[:, None] * TICK_S)

