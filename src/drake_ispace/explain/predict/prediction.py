"""Stage 0, predict: every prediction that the channels allow, and what is left of the measurement after each.

Residuals come in streams, each with its own clock and noise: `motion`, recorded command -> encoder and IMU, at every
tick (what is left of a count's rounding at one tick shows at the next: means over several would hide that it does, and
make a command that followed it look late); `room`, measured wheels -> the camera's fixes, at the camera's own instants;
`start`, the first fix against the pose from which the scenario starts; `looks`, captures that bring no fix.
"""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import maximum_filter1d
from scipy.signal import lfilter

from drake_ispace.blocks.frames import wrap
from drake_ispace.blocks.rates import TICK_S
from drake_ispace.explain.predict.replay import Replay, Values
from drake_ispace.explain.predict.room_gain import tuned
from drake_ispace.explain.predict.room_view import SIGHTING
from drake_ispace.explain.predict.tracks import Track
from drake_ispace.plants.slip import GRAVITY
from drake_ispace.robots.robot import COMMAND

_SETTLING_TICKS = 60  # of the filter
_SPEED_TICKS = 20  # over which a wheel's speed is taken
_SLOWNESS = (0.02, 0.05, 0.1, 0.2, 0.4)  # of the root mean square of wheel speed: classes of motion
RESTING = 2  # classes of motion below this are not scored: a wheel that hardly turns sticks or not by chance
_RECOVERY_TICKS = 120  # after a rest with dry friction, during which the filter forgets it
_COARSE_COUNT = 0.01  # rad, from which on a wheel at rest hides more than its friction
_SEGMENT_TICKS = 500  # for which a wheel at rest may hide the same part of a count
_SLOW_TICKS, _SLOW_SHARE = 400, 0.4  # of unknown forces: how long they last, and their share
_WITHIN_COUNT = 0.4  # of a count, standard deviation
_START_M, _START_RAD = 0.15, 0.3  # farther from the scenario's start than this, where a run starts is unknown
#: What a consumer IMU may be off without anything being wrong, per run (standard deviations): its mounting tilts too.
_IMU_OFFSETS = {"ax": 0.07, "ay": 0.1, "az": 0.05, "wx": 0.004, "wy": 0.004, "wz": 0.004}
#: The roll rate of a body that leans, -yaw rate times tilt, mostly shows how far the tilt that nobody measures is off:
#: with a sign and a size that turn with the robot, for which no noise that stays the same can stand.
_NOT_PREDICTED = "wx"
_LATE_TICKS = 3  # within which an accelerometer shows a jump of the torque
_TILT_S = 0.5  # over which the direction of gravity is averaged

Residuals = list[dict[str, np.ndarray]]  # per run: stream -> (rows, channels)


@dataclass(frozen=True)
class Prediction:
    """A model against runs: residuals at any effects, and those of everything that is a nuisance.

    Attributes:
        replay: the compiled prediction Diagram. tracks: the runs. starts: pose and wheel angles at t = 0 of each,
            (3 + n,).
        anchored: whether the start of each run is that of the scenario. channels: stream -> names.
        columns: of the replay's outputs, those in the stream "motion".
    """

    replay: Replay
    tracks: list[Track]
    starts: list[np.ndarray]
    anchored: list[bool]
    channels: dict[str, list[str]]
    columns: list[int]

    def residuals(self, values: Values, pool: ThreadPoolExecutor | None = None) -> Residuals:
        """Of every run with these effects in the model."""
        numbers = self.replay.parameters(values)
        share = self._dropouts(values)
        jobs = range(len(self.tracks))
        one = lambda i: self._one(i, self.tracks[i], numbers, share)  # noqa: E731
        return list((pool.map if pool else map)(one, jobs))

    def injected(self, commands: Sequence[np.ndarray], values: Values) -> Residuals:
        """With `commands` (ticks + LEAD, m) added to the recorded ones, one per run."""
        return self._changed([
            replace(track, command=track.command + added) for track, added in zip(self.tracks, commands, strict=True)
        ], values)

    def pushed(self, forces: Sequence[np.ndarray], values: Values) -> Residuals:
        """With `forces` (ticks + LEAD, 3), as Replay.pushed takes them, on the body, one per run."""
        tracks = [self.replay.pushed(track, force) for track, force in zip(self.tracks, forces, strict=True)]
        return self._changed(tracks, values)

    def _changed(self, tracks, values):
        numbers, share = self.replay.parameters(values), self._dropouts(values)
        return [self._one(i, track, numbers, share) for i, track in enumerate(tracks)]

    def displaced(self, displacements: Sequence[np.ndarray], values: Values) -> Residuals:
        """Of a model that moves by `displacements` (ticks + LEAD, 3) [m, m, rad] more, one per run."""
        tracks = []
        for track, added in zip(self.tracks, displacements, strict=True):
            sightings = track.sightings.copy()
            sightings[track.fix_rows, SIGHTING.x : SIGHTING.phi + 1] -= added[track.fix_ticks]
            tracks.append(replace(track, sightings=sightings))
        return self._changed(tracks, values)

    def nuisances(
        self, values: Values, pool: ThreadPoolExecutor | None = None
    ) -> list[tuple[int, dict[str, np.ndarray]]]:
        """(run, residual change per standard deviation, by stream) of every offset that a run may have, run by run."""
        numbers, share = self.replay.parameters(values), self._dropouts(values)
        at, jobs = self.residuals(values, pool), []
        for i, track in enumerate(self.tracks):
            jobs += [(i, lambda t=track, o=o: replace(t, measured=t.measured + o)) for o in self._offsets(track)]
            jobs += [(i, lambda t=track, f=f: self.replay.pushed(t, f)) for f in self._slow_forces(track)]

        def one(job):
            i, moved = job
            return i, {name: rows - at[i][name] for name, rows in self._one(i, moved(), numbers, share).items()}

        return list((pool.map if pool else map)(one, jobs))

    def _slow_forces(self, track):
        """(rows, 3) force of unknown cause, one standard deviation large, over each stretch of a few seconds."""
        robot = self.replay.body.robot
        if robot.driven == COMMAND or robot.unknown_forces is None or not self.channels["motion"]:
            return
        for axis, size in enumerate(robot.unknown_forces):
            for start in range(0, track.ticks, _SLOW_TICKS):
                force = np.zeros((len(track.command), 3))
                force[start : start + _SLOW_TICKS, axis] = _SLOW_SHARE * size
                yield force

    def under_other_noise(self, values: Values) -> list[Residuals]:
        """With the filter's other gains: were the assumptions about noise wrong, residuals would change like this."""
        numbers, share = self.replay.parameters(values), self._dropouts(values)
        return [
            [self._one(i, track, changed, share) for i, track in enumerate(self.tracks)]
            for changed in (self.replay.under_noise(numbers, other) for other in self.replay.others)
        ]

    def under_other_timing(self, values: Values) -> list[Residuals]:
        """With torque's jumps felt by the accelerometer at another moment of the tick, and up to two ticks later.

        It shows what acts at the very instant of its sample, or behind a low pass of its own; to the model a torque is
        its mean over the tick, which says all about where the robot goes, but nothing about that instant.
        """
        if not self.replay.body.robot.has_imu or not self.channels["motion"]:
            return []
        return [
            self._changed([replace(t, measured=t.measured + self._felt(t, ticks)) for t in self.tracks], values)
            for ticks in range(_LATE_TICKS)
        ]

    def _felt(self, track, ticks):
        """(rows, p) how much of the last jump of the torque, `ticks` ago, IMUs show by half a tick of other timing."""
        imu = self.replay.body.wheels
        robot, plant = self.replay.body.robot, self.replay.body.plant
        acceleration = (track.command @ np.linalg.solve(robot.mass_matrix(plant), robot.effort(plant)).T)[:, 0]
        jump, felt = 0.5 * np.diff(acceleration), np.zeros(track.measured.shape)
        keep = 1.0 - TICK_S / _TILT_S
        ax, pitching = track.measured[:, imu], track.measured[:, imu + 4]
        tilt = lfilter([1.0], [1.0, -keep], keep * TICK_S * pitching - (1.0 - keep) * ax / GRAVITY)
        felt[2 + ticks :, imu] = jump[: len(jump) - 1 - ticks]
        felt[:, imu + 2] = np.sin(tilt) * felt[:, imu]
        return felt

    def _offsets(self, track):
        """(rows or 1, p) to add to `measured`, one standard deviation long: a wheel is somewhere within its count, and
        stays there while it rests; an IMU has a bias."""
        rows, p = track.measured.shape
        wheels = self.replay.body.wheels
        steps = np.abs(np.diff(track.measured[: track.ticks, :wheels], axis=0))
        count = np.min(steps, where=steps > 1e-9, initial=0.1)
        starts = range(0, track.ticks, _SEGMENT_TICKS) if count > _COARSE_COUNT else [0]
        for column in range(wheels):
            for start in starts:
                offset = np.zeros((rows, p))
                end = start + _SEGMENT_TICKS if len(starts) > 1 and start < starts[-1] else rows
                offset[start:end, column] = _WITHIN_COUNT * count
                yield offset
        for column, size in enumerate(_IMU_OFFSETS.values() if p > wheels else (), wheels):
            if column in self.columns:
                offset = np.zeros((1, p))
                offset[0, column] = size
                yield offset

    def classes(self) -> list[dict[str, np.ndarray]]:
        """Per run and stream, (rows,) how slow the slowest wheel is: noise differs between rest and motion."""
        wheels, found = self.replay.body.wheels, []
        turned = [np.abs(wheel_speeds(track.measured[: track.ticks, :wheels])) for track in self.tracks]
        edges = np.array(_SLOWNESS) * np.sqrt(np.mean(np.vstack(turned) ** 2))
        for speeds in turned:
            classes = np.searchsorted(edges, speeds.min(axis=1))
            if self.replay.body.robot.friction(self.replay.body.plant).coulomb_n_m > 0.0:
                rests = maximum_filter1d(classes < RESTING, _RECOVERY_TICKS, origin=_RECOVERY_TICKS // 2 - 1)
                classes[rests] = 0
            found.append({"motion": classes[_SETTLING_TICKS:]})
        return found

    def _dropouts(self, values):
        return values.get("camera_dropouts", {}).get("share", 0.0)

    def _one(self, i, track, numbers, dropouts):
        motion, room = self.replay.run(track, self.starts[i], numbers)
        motion, room = motion[:, self.columns], room[:, : len(self.channels["room"])]
        first = room[: int(self.anchored[i])]
        return {
            "motion": motion[_SETTLING_TICKS:], "room": room[1:], "start": first,
            "looks": track.missed[:, None] - dropouts if len(track.missed) else np.empty((0, 1)),
        }


def predict(replay: Replay, tracks: Sequence[Track]) -> Prediction:
    """Place every run: it starts where its first way point lies, or where the camera saw it first."""
    starts, anchored = [], []
    for track in tracks:
        start, is_known = _start(track)
        starts.append(np.concatenate([start, track.measured[0, : replay.body.wheels]]))
        anchored.append(is_known)
    robot, wheels = replay.body.robot, replay.body.wheels
    if robot.driven == COMMAND:
        replay = tuned(replay, tracks, starts)
    names = [f"wheel {i + 1}" for i in range(wheels)] + (list(_IMU_OFFSETS) if robot.has_imu else [])
    followed = replay.feeds >= {"encoder", robot.driven} | ({"imu"} if robot.has_imu else set())
    columns = [i for i, name in enumerate(names) if followed and name != _NOT_PREDICTED]
    pose = ["x", "y", "heading"] if robot.in_room else []
    # without encoders, or without the IMU of a robot that has one, nothing holds the model on the motion: what it
    # predicts then shows unknown forces, not physics that it lacks
    channels = {
        "motion": [names[i] for i in columns],
        "room": pose if "encoder" in replay.feeds or replay.feeds >= {"command"} else [],
        "start": pose if "encoder" in replay.feeds or replay.feeds >= {"command"} else [], "looks": ["seen"],
    }
    return Prediction(replay, list(tracks), starts, anchored, channels, columns)


def _start(track):
    if not len(track.fix_ticks):
        return (np.zeros(3) if track.aim is None else track.aim), False
    first = track.poses[0]
    if track.aim is None or track.fix_t[0] > 0.2:
        return first, False
    if np.hypot(*(first - track.aim)[:2]) > _START_M or abs(wrap(first[2] - track.aim[2])) > _START_RAD:
        return first, False
    return track.aim, True


def wheel_speeds(angles: np.ndarray) -> np.ndarray:
    """(ticks, n) speed of wheels [rad/s] over the ticks around each."""
    half = _SPEED_TICKS // 2
    at = np.arange(len(angles))
    after, before = np.minimum(at + half, len(angles) - 1), np.maximum(at - half, 0)
    return (angles[after] - angles[before]) / ((after - before)[:, None] * TICK_S)
