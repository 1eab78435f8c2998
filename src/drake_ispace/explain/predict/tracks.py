"""A recording made ready to be predicted: its channels on the robot's 5 ms clock, fixes at their own instants."""

from dataclasses import dataclass, replace

import numpy as np

from drake_ispace.blocks.errors import InputError
from drake_ispace.blocks.rates import TICK_S
from drake_ispace.explain.predict.room_view import LEAD_TICKS, SIGHTING
from drake_ispace.files.recording import Recording
from drake_ispace.robots.robot import COMMAND, Robot

IMU = 6
#: Where the velocity is commanded but not known, fixes of a camera that is faster than the first are taken the second
#: apart: within a few cycles of its drive, odometry and camera differ mostly by when within its cycle each was sampled
#: and by ripple of the speed controller, which fits at many shifts in time.
_FAST_S, _APART_S = 0.08, 1.0


@dataclass(frozen=True)
class Track:
    """One run on ticks 0 to `ticks`.

    Attributes:
        name: for messages. command: (ticks + LEAD, m) what the plant is driven with, zeros where not recorded.
        measured: (ticks + LEAD, p) outputs, zeros where not recorded. sightings: (ticks + LEAD, 5) for RoomView.
        fix_ticks: (k,) ticks whose camera fix is known; fix_t: their times [s].
        missed: (v,) 1 for every scheduled look of the camera without a fix, else 0; empty where there is no schedule.
        has: the channels that it has. aim: (3,) pose of the first way point; None: no reference.
        force: (ticks + LEAD, 3) of the ground on the plant, besides the model's; None: none.
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

    @property
    def fix_rows(self) -> np.ndarray:
        """(k,) rows of `sightings` that hold one."""
        return self.fix_ticks + LEAD_TICKS

    @property
    def poses(self) -> np.ndarray:
        """(k, 3) x, y [m], phi [rad] of the fixes."""
        return self.sightings[self.fix_rows, SIGHTING.x : SIGHTING.phi + 1]


def track(recording: Recording, robot: Robot, wheels: int, name: str) -> Track:
    """A run of the robot with that many wheels.

    Raises:
        InputError: channels of another number of columns, or none that a prediction can be compared with.
    """
    driven = robot.driven
    for channel, columns in (("torque", wheels), ("encoder", wheels)):
        found = recording.channels.get(channel)
        if found is not None and channel in (driven, "encoder") and len(found.columns) != columns:
            raise InputError(f"{name}: channel {channel} has {len(found.columns)} columns, expected {columns}")
    wanted = ["encoder", "kinect"] + (["imu"] if robot.has_imu else [])
    has = frozenset(c for c in [driven, *wanted] if c in recording.channels and len(recording.channels[c].t) > 1)
    if not has & set(wanted):
        raise InputError(f"{name}: has none of the channels {', '.join(wanted)}, expected at least one to compare with")
    recording = _from_zero(recording, has)
    dense = [c for c in has if c != "kinect"]  # what ends earlier cannot be predicted from, nor compared with, later on
    end_s = min(recording.channels[c].t[-1] for c in dense or has)
    ticks = int(nearest_ticks(end_s))
    rows = ticks + LEAD_TICKS
    m = 3 if driven == COMMAND else wheels
    command = _held(recording.channels[driven], rows) if driven in has else np.zeros((rows, m))
    parts = [_on_ticks(recording.channels["encoder"], rows) if "encoder" in has else np.zeros((rows, wheels))]
    if robot.has_imu:
        parts.append(_on_ticks(recording.channels["imu"], rows) if "imu" in has else np.zeros((rows, IMU)))
    apart_s = _APART_S if driven == COMMAND and driven not in has else 0.0
    sightings, fix_ticks, fix_t = _sightings(recording.channels["kinect"], rows, apart_s) if "kinect" in has else (
        np.zeros((rows, len(SIGHTING))), np.empty(0, int), np.empty(0)
    )
    reference = recording.channels.get("reference")
    aim = reference.values[0, :3] if reference is not None and len(reference.t) else None
    missed = _missed(recording.channels["kinect"], end_s) if "kinect" in has else np.empty(0)
    return Track(name, ticks, command, np.hstack(parts), sightings, fix_ticks, fix_t, missed, has, aim)


def _from_zero(recording, has):
    """The same run with a clock that starts with it, where it started elsewhere."""
    first = min(recording.channels[c].t[0] for c in has)
    if 0.0 <= first < 1.0:
        return recording
    shifted = {}
    for name, channel in recording.channels.items():
        kept = channel.t >= first
        shifted[name] = replace(channel, t=channel.t[kept] - first, values=channel.values[kept])
    return replace(recording, channels=shifted)


def nearest_ticks(times_s: np.ndarray) -> np.ndarray:
    """(k,) whole numbers: the tick nearest to each of `times_s` [s]."""
    return np.floor(times_s / TICK_S + 0.5)


def in_force(since: np.ndarray, rows: int) -> np.ndarray:
    """(rows,) which sample is in force at every tick from 0 on, each from its tick `since` on; -1 before the first."""
    return np.searchsorted(since, np.arange(rows), side="right") - 1


def _held(channel, rows):
    """Values in force at each tick: each held from its time on."""
    at = in_force(nearest_ticks(channel.t), rows)
    values = channel.values[np.maximum(at, 0)].copy()
    values[at < 0] = 0.0
    return values


def _on_ticks(channel, rows):
    ticks = nearest_ticks(channel.t)
    if np.array_equal(ticks, np.arange(ticks[0], ticks[0] + len(ticks))) and ticks[0] >= 0.0:
        return channel.values[np.clip(np.arange(rows) - int(ticks[0]), 0, len(ticks) - 1)]
    t = np.arange(rows) * TICK_S
    return np.column_stack([np.interp(t, channel.t, column) for column in channel.values.T])


def _sightings(channel, rows, apart_s):
    ticks = nearest_ticks(channel.t).astype(int)
    keep = np.concatenate([[True], np.diff(ticks) > 0]) & (ticks >= 0) & (ticks + LEAD_TICKS < rows)
    ticks, t, values = ticks[keep], channel.t[keep], channel.values[keep]
    if apart_s > 0.0 and len(t) > 1 and np.median(np.diff(t)) < _FAST_S:
        every = max(int(np.ceil(apart_s / np.median(np.diff(t)) - 1e-6)), 1)
        ticks, t, values = ticks[::every], t[::every], values[::every]
    sightings = np.zeros((rows, len(SIGHTING)))
    at = ticks + LEAD_TICKS
    sightings[at, SIGHTING.is_there], sightings[at, SIGHTING.x : SIGHTING.phi + 1] = 1.0, values[:, :3]
    sightings[at, SIGHTING.after_s] = t - ticks * TICK_S
    return sightings, ticks, t


def _missed(channel, end_s):
    if not channel.period_s:
        return np.empty(0)
    first = channel.t[0] - np.floor(channel.t[0] / channel.period_s + 1e-6) * channel.period_s
    looks = np.arange(first, end_s + 1e-6, channel.period_s)
    nearest = np.abs(channel.t[np.clip(np.searchsorted(channel.t, looks), 0, len(channel.t) - 1)] - looks)
    before = np.abs(channel.t[np.clip(np.searchsorted(channel.t, looks) - 1, 0, len(channel.t) - 1)] - looks)
    return (np.minimum(nearest, before) > 0.25 * channel.period_s).astype(float)
