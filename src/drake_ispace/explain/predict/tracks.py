"""Recordings on the robot's 5 ms clock, ready to be predicted; camera fixes keep their own instants."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from drake_ispace.blocks.errors import InputError
from drake_ispace.blocks.rates import TICK_S, VISION_TICKS
from drake_ispace.explain.check.compare.command.drive import ramps
from drake_ispace.explain.check.compare.links import LATENCY_S
from drake_ispace.explain.check.runs import check_sizes
from drake_ispace.explain.counts import count_of, straightened
from drake_ispace.explain.levels import BLOCK_TICKS
from drake_ispace.explain.predict.room_view import LEAD_TICKS, SIGHTING
from drake_ispace.faults.repair import from_zero, span_text
from drake_ispace.files.recording import CHANNEL_COLUMNS, PERIOD_TOLERANCE, Recording, median_step
from drake_ispace.robots.robot import COMMAND, TORQUE, Robot

IMU = len(CHANNEL_COLUMNS["imu"])
SHORTEST_S = BLOCK_TICKS * TICK_S  # of a run
_SETTLING_TICKS = 60  # of the filter, which are not scored
_LONGEST_S = 3600.0


@dataclass(frozen=True, eq=False)
class Track:
    """One run on ticks 0 to `ticks`; rows is ticks + LEAD_TICKS. Its arrays do not change.

    Attributes:
        name: for messages. recording: the name of what it is or is a part of.
        ticks: the last one.
        command: (rows, m) input of the plant, torque of each wheel [N m] or velocity in B [m/s, m/s, rad/s]; zeros
            where not recorded.
        measured: (rows, p) wheel angles [rad], then the IMU's six columns of a robot that has one; zeros where not
            recorded.
        sightings: (rows, 5) input of a RoomView.
        fix_ticks: (k,) ticks of capture of the camera's fixes.
        fix_t: (k,) their times [s].
        missed: (v,) 1 for every scheduled capture of the camera without a fix, else 0; empty where the recording has
            no schedule, or where its fixes come at any time.
        has: names of the recorded channels that are used.
        aim: (3,) pose [m, m, rad] of the first way point; None: no reference.
        force: (rows, 3) force of the ground on the plant besides the model's; None: none.
        since_s: from the start of the recording to tick 0 [s]. begun_s: the recorded time at tick 0 [s].
        unscored_ticks: at the start, in which the state of a moving robot is not known yet.
        count_rad: of the encoders; 0 where they show none (`count_of`).
        unsure: (rows, 3) by how much a commanded velocity would be another if it changed earlier, by the standard
            deviation of a moment within a step of its log; None: each change is known to have come at its sample.
        rounding: (rows, p) what `measured` has besides the straightest motion of the wheels, where velocity is
            commanded; None: nothing.
        reads: (r,) ticks at which encoders were read of a robot that is driven by velocity, or of a user's own plant;
            None: at every tick.
        command_step_s: from sample to sample of what drives the robot, 0 where it was not recorded.
        seen: (n, 4) time [s] and pose x, y [m], phi [rad] of all fixes, of which `sightings` may have a few only.
    """

    name: str
    ticks: int
    command: np.ndarray
    measured: np.ndarray
    sightings: np.ndarray
    fix_ticks: np.ndarray
    fix_t: np.ndarray
    missed: np.ndarray
    has: frozenset[str]
    aim: np.ndarray | None
    force: np.ndarray | None = None
    since_s: float = 0.0
    begun_s: float = 0.0
    unscored_ticks: int = 0
    count_rad: float = 0.0
    unsure: np.ndarray | None = None
    rounding: np.ndarray | None = None
    reads: np.ndarray | None = None
    command_step_s: float = 0.0
    seen: np.ndarray = field(default_factory=lambda: np.empty((0, 4)))
    recording: str = ""

    @property
    def settled(self) -> int:
        """The first tick that is scored."""
        return max(_SETTLING_TICKS, self.unscored_ticks)

    @property
    def scored_ticks(self) -> np.ndarray:
        """(rows,) ticks at which the motion is scored, where it is measured and the filter has settled."""
        if self.reads is None:
            return np.arange(self.settled, self.ticks)
        return self.reads[(self.reads >= self.settled) & (self.reads < self.ticks)]

    @property
    def shown(self) -> np.ndarray:
        """(rows, p) `measured` at the ticks at which the encoders were read, no numbers at the others.

        From read to read `measured` is a straight line, whatever the wheels did at a step of the command.
        """
        if self.reads is None:
            return self.measured
        shown = np.full(self.measured.shape, np.nan)
        shown[self.reads] = self.measured[self.reads]
        return shown

    @property
    def turned(self) -> np.ndarray:
        """(rows, p) `measured` without rounding."""
        return self.measured if self.rounding is None else self.measured - self.rounding

    def earlier(self, channel: str, ticks: int) -> "Track":
        """The track with IMU, encoders or what drives it so many ticks earlier; beyond its ends samples are held.

        channel: "imu" or "encoder", of a robot that has both; any other is what drives it.
        """
        at = np.clip(np.arange(len(self.command)) + ticks, 0, self.ticks)
        if channel not in ("imu", "encoder"):
            return replace(self, command=self.command[at], unsure=None if self.unsure is None else self.unsure[at])
        of_wheels, of_imu = (at, slice(None)) if channel == "encoder" else (slice(None), at)
        wheels = self.measured.shape[1] - IMU
        return replace(self, measured=np.hstack([self.measured[of_wheels, :wheels], self.measured[of_imu, wheels:]]))

    def with_fixes_at(self, t: np.ndarray) -> "Track":
        """The track with its fixes at other times (k,) [s], those of them that the run has a tick for."""
        sightings, ticks, t = _seen_at(t, self.poses, len(self.sightings))
        return replace(self, sightings=sightings, fix_ticks=ticks, fix_t=t)

    @property
    def scored_fixes(self) -> slice:
        """Which fixes are scored: not the first, from which the pose is taken, nor those of an unknown state."""
        return slice(max(1, int(np.searchsorted(self.fix_ticks, self.unscored_ticks))), None)

    @property
    def fix_rows(self) -> np.ndarray:
        """(k,) rows of `sightings` that hold a fix."""
        return self.fix_ticks + LEAD_TICKS

    @property
    def poses(self) -> np.ndarray:
        """(k, 3) x, y [m], phi [rad] of the fixes."""
        return self.sightings[self.fix_rows, SIGHTING.x : SIGHTING.phi + 1]


def track(recording: Recording, robot: Robot, plant, name: str, shortest_s: float = SHORTEST_S) -> Track:
    """Put a recording of a robot with that plant, of shortest_s at least, on ticks; name: for messages.

    A tick has the sample of the torque that is next to it, or the mean over the tick of a velocity, or of the torque of
    a user's own plant.

    Raises:
        InputError: columns that are not one for each wheel, by its name, no channel to compare a prediction with,
            channels without a time in common, a run that is too short or lasts for hours, or an impossible number.
    """
    driven, wheels = robot.driven, robot.wheel_count(plant)
    channels = dict(recording.channels)
    for channel in (c for c in (TORQUE, "encoder") if c in channels and c in (driven, "encoder")):
        channels[channel] = robot.by_wheel(channels[channel], plant, f"{name}: channel {channel}")
    recording = replace(recording, channels=channels)
    wanted = ["encoder", "kinect"] + (["imu"] if robot.has_imu else [])
    recording, since_s = _since_felt(recording, ["encoder", *wanted[2:]], driven)
    has = frozenset(c for c in [driven, *wanted] if c in recording.channels and len(recording.channels[c].t) > 1)
    if not has & set(wanted):
        raise InputError(f"{name}: has none of the channels {', '.join(wanted)}, expected at least one to compare with")
    check_sizes(recording, name)
    _check_clocks(recording, has, name, shortest_s)
    felt, recording = recording, from_zero(recording, has)
    last = next(iter(has))
    begun_s = float(felt.channels[last].t[-1] - recording.channels[last].t[-1])
    # the run ends where the first of these does: nothing later can be predicted, or compared with
    dense = [c for c in has if c != "kinect"]
    end_s = min(recording.channels[c].t[-1] for c in dense or has)
    ticks = int(nearest_ticks(end_s))
    rows = ticks + LEAD_TICKS
    m = 3 if driven == COMMAND else wheels
    drive = _held if driven == TORQUE and robot.in_room else _means
    command = drive(recording.channels[driven], rows) if driven in has else np.zeros((rows, m))
    reference = recording.channels.get("reference")
    aim = reference.values[0, :3] if reference is not None and len(reference.t) and not since_s else None
    return Track(
        name, ticks, command, has=has, recording=name, aim=aim, since_s=since_s, begun_s=begun_s,
        command_step_s=float(np.median(np.diff(recording.channels[driven].t))) if driven in has else 0.0,
        unsure=_unsure(recording.channels[driven], rows) if driven == COMMAND and driven in has else None,
        **_of_wheels(recording, robot, wheels, has, rows), **_of_camera(recording, driven, has, rows, end_s),
    )


def _of_wheels(recording, robot, wheels, has, rows) -> dict:
    """What encoders and IMU measured, by the names of a Track's attributes."""
    imu, straight = [], None
    if robot.has_imu:
        imu = [_on_ticks(recording.channels["imu"], rows) if "imu" in has else np.zeros((rows, IMU))]
    if "encoder" not in has:
        return {"measured": np.hstack([np.zeros((rows, wheels)), *imu])}
    encoder = recording.channels["encoder"]
    measured = np.hstack([_on_ticks(encoder, rows), *imu])
    if robot.driven == COMMAND:
        straight = _on_ticks(replace(encoder, values=straightened(encoder.t, encoder.values)), rows)
    rarely = robot.driven == COMMAND or not robot.in_room
    return {
        "measured": measured, "count_rad": count_of(encoder.values),
        "rounding": None if straight is None else measured - np.hstack([straight, *imu]),
        "reads": _reads(encoder, rows) if rarely else None,
    }


def _of_camera(recording, driven, has, rows, end_s) -> dict:
    """What the camera saw, by the names of a Track's attributes."""
    if "kinect" not in has:
        return {
            "sightings": np.zeros((rows, len(SIGHTING))), "fix_ticks": np.empty(0, int), "fix_t": np.empty(0),
            "missed": np.empty(0), "seen": np.empty((0, 4)),
        }
    kinect = recording.channels["kinect"]
    thinned = driven == COMMAND and driven not in has
    sightings, fix_ticks, fix_t = _sightings(kinect, rows, thinned)
    return {
        "sightings": sightings, "fix_ticks": fix_ticks, "fix_t": fix_t, "missed": _missed(kinect, end_s),
        "seen": np.column_stack([kinect.t, kinect.values[:, :3]]),
    }


def _since_felt(recording, sensors, driven):
    """The recording from where the last of the sensors begins, and how late [s] that is.

    Before, nothing says how wheels or body moved. What drives the robot is in force from the sample before. Sensors
    that begin within a latency or a step of each other begin together, and one without a time in common with the rest
    is left for others to refuse.
    """
    names = {driven, "kinect", *sensors} & recording.channels.keys()
    known = {name: recording.channels[name].t for name in names if len(recording.channels[name].t) > 1}
    first, end = min((t[0] for t in known.values()), default=0.0), min((t[-1] for t in known.values()), default=0.0)
    late = [t[0] for name, t in known.items() if name in sensors and t[0] - first > max(median_step(t), LATENCY_S)]
    begin = max(late, default=first)
    if not first < begin < end:
        return recording, 0.0
    channels = {}
    for name, channel in recording.channels.items():
        since = int(np.searchsorted(channel.t, begin))
        if name == driven:
            since = max(int(np.searchsorted(channel.t, begin, side="right")) - 1, 0)
        t = np.maximum(channel.t[since:], begin)
        channels[name] = replace(channel, t=t, values=channel.values[since:])
    return replace(recording, channels=channels), float(begin - first)


def _check_clocks(recording, has, name, shortest_s):
    """Refuse channels without a time in common, and runs that last longer than any recording of a robot does."""
    spans = {c: (float(recording.channels[c].t[0]), float(recording.channels[c].t[-1])) for c in sorted(has)}
    starts, ends = max(start for start, _ in spans.values()), min(end for _, end in spans.values())
    if starts >= ends:
        said = ", ".join(f"{c} {span_text(start, end, 3)}" for c, (start, end) in spans.items())
        raise InputError(f"{name}: the channels have no time in common ({said}), expected one clock for all")
    lasts = ends - min(start for start, _ in spans.values())
    if not shortest_s <= lasts <= _LONGEST_S:
        raise InputError(
            f"{name}: lasts {lasts:.6g} s, expected {shortest_s:g} s to {_LONGEST_S:g} s, and stamps in seconds"
        )


def nearest_ticks(times_s: np.ndarray) -> np.ndarray:
    """(k,) the tick nearest to each of `times_s` [s], as whole floating-point numbers."""
    return np.floor(times_s / TICK_S + 0.5)


def in_force(since: np.ndarray, rows: int) -> np.ndarray:
    """(rows,) index of the sample in force at each tick from 0 on; sample i begins at tick since[i]; -1: none yet."""
    return np.searchsorted(since, np.arange(rows), side="right") - 1


def _held(channel, rows):
    """(rows, n) values of the channel, each held from its time on (zero-order hold); zeros before the first."""
    at = in_force(nearest_ticks(channel.t), rows)
    values = channel.values[np.maximum(at, 0)].copy()
    values[at < 0] = 0.0
    return values


def _means(channel, rows):
    """(rows, n) mean of the channel, held from its time on, over each tick; zeros before the first."""
    edges = np.arange(rows + 1) * TICK_S
    t = np.append(channel.t, max(edges[-1], channel.t[-1]) + TICK_S)
    sums = np.vstack([np.zeros(channel.values.shape[1]), np.cumsum(channel.values * np.diff(t)[:, None], axis=0)])
    inner = np.column_stack([np.interp(edges, t, column) for column in sums.T])
    return np.diff(inner, axis=0) / TICK_S


def _unsure(command, rows):
    """`Track.unsure` of a command of which some changes were moved between the even steps of its log; None: none was.

    One that came to lie at its sample was estimated as well. Between the samples that change nothing there is just the
    time for such changes at even steps, and yet they are off these, by more than samples that change nothing are.
    """
    t, sizes = command.t, np.diff(command.values, axis=0, prepend=command.values[:1])
    step_s, fixed = float(np.median(np.diff(t))), ~sizes.any(axis=1)
    at, changes = np.flatnonzero(fixed), np.flatnonzero(~fixed)
    changes = changes[changes < at[-1]]
    if not len(changes) or ramps(sizes[1:]):
        return None
    after = np.searchsorted(at, changes)
    before, after = at[after - 1], at[after]
    in_place = np.abs(t[after] - t[before] - (after - before) * step_s) <= PERIOD_TOLERANCE * step_s
    off = np.abs(t[changes] - t[before] - (changes - before) * step_s)
    jitter = np.abs(np.diff(t) - step_s)[fixed[1:] & fixed[:-1]]
    moved = in_place & (off > max(PERIOD_TOLERANCE * step_s, np.max(jitter[jitter < 0.5 * step_s], initial=0.0)))
    ticks = np.ceil(t[changes] / TICK_S - 1e-6).astype(int) - 1  # which an earlier change would alter
    within = (ticks >= 0) & (ticks < rows)
    if not (moved & within).any():
        return None
    unsure = np.zeros((rows, 3))
    np.add.at(unsure, ticks[within], sizes[changes[within]] * step_s / np.sqrt(12.0) / TICK_S)
    return unsure


def _on_ticks(channel, rows):
    """(rows, n) samples of the channel at each tick, interpolated where they are not one a tick."""
    ticks = nearest_ticks(channel.t)
    if np.array_equal(ticks, np.arange(ticks[0], ticks[0] + len(ticks))) and ticks[0] >= 0.0:
        return channel.values[np.clip(np.arange(rows) - int(ticks[0]), 0, len(ticks) - 1)]
    t = np.arange(rows) * TICK_S
    return np.column_stack([np.interp(t, channel.t, column) for column in channel.values.T])


def read_ticks(tracks: Sequence[Track]) -> int:
    """Ticks from one read of the encoders to the next, of the run in which they are read least often."""
    return max(1 if track.reads is None else round(float(np.median(np.diff(track.reads)))) for track in tracks)


def coarsest_count(tracks: Sequence[Track]) -> float:
    """The largest count [rad] of the encoders in any of the runs; 0 where they show none."""
    return max(track.count_rad for track in tracks)


def _reads(channel, rows):
    """`reads` of a Track: None where there is a sample a tick, as a rule."""
    ticks = np.unique(nearest_ticks(channel.t).astype(int))
    ticks = ticks[(ticks >= 0) & (ticks < rows)]
    return ticks if len(ticks) > 1 and np.median(np.diff(ticks)) > 1.0 else None


def _sightings(channel, rows, thinned):
    """sightings, fix_ticks, fix_t of a Track.

    thinned: where the velocity is commanded but not recorded, fixes faster than the room's camera are thinned to one a
    second or so. Over a few cycles of the drive, odometry and camera differ mostly by the moment within the cycle at
    which each was sampled, and by ripple of the speed controller. Such a difference fits many shifts in time.
    """
    ticks = nearest_ticks(channel.t).astype(int)
    keep = _have_rows(ticks, rows)
    ticks, t, values = ticks[keep], channel.t[keep], channel.values[keep]
    if thinned and len(t) > 1 and np.median(np.diff(ticks)) < VISION_TICKS:
        every = int(np.ceil(BLOCK_TICKS * TICK_S / np.median(np.diff(t)) - 1e-6))
        t, values = t[::every], values[::every]
    return _seen_at(t, values[:, :3], rows)


def _have_rows(ticks, rows):
    """(k,) whether a fix of each tick has a row of its own in `sightings`."""
    return (np.diff(ticks, prepend=ticks[:1] - 1) > 0) & (ticks >= 0) & (ticks + LEAD_TICKS < rows)


def _seen_at(t, poses, rows):
    """sightings, fix_ticks, fix_t of a Track: poses (k, 3) seen at times t (k,) [s], those that have a row."""
    ticks = nearest_ticks(t).astype(int)
    keep = _have_rows(ticks, rows)
    ticks, t = ticks[keep], t[keep]
    sightings, at = np.zeros((rows, len(SIGHTING))), ticks + LEAD_TICKS
    sightings[at, SIGHTING.is_there], sightings[at, SIGHTING.x : SIGHTING.phi + 1] = 1.0, poses[keep]
    sightings[at, SIGHTING.after_s] = t - ticks * TICK_S
    return sightings, ticks, t


def _missed(channel, end_s):
    """`missed` of a Track: as many captures lie between two fixes as periods, to the nearest.

    None is scheduled before the first fix or after the last: a camera may be switched on late, or off early. Stamps may
    be rounded or uneven: counted from the first fix on, a period that is off by a thousandth misses every capture.
    A fix that is late by more than half a period is of the capture before. Where fewer captures are without a fix in
    the end than have two, fixes come at any time, and count no captures.
    """
    t = channel.t[channel.t <= end_s + 1e-6]
    if not channel.period_s or not len(t):
        return np.empty(0)
    captures = np.rint(np.diff(t) / channel.period_s).astype(int)  # from one fix to the next
    fixes = np.arange(len(t))
    left_out = np.cumsum([0, *captures]) - fixes  # before each fix
    left_out = np.maximum(np.minimum.accumulate(left_out[::-1])[::-1], 0)
    if 0 < left_out[-1] < np.sum(captures == 0):
        return np.empty(0)
    missed = np.ones(len(t) + left_out[-1])
    missed[fixes + left_out] = 0.0
    return missed
