"""Repairs of a recording: what undoes a fault, as small objects that say themselves in one line."""

import abc
import math
from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import Akima1DInterpolator

from drake_ispace.blocks.frames import rotated
from drake_ispace.blocks.rates import TICK_S
from drake_ispace.files.recording import PERIOD_TOLERANCE, Channel, Recording


def time_text(t_s: float, digits: int = 6) -> str:
    """A time [s] to so many digits after the point, however long ago its clock began."""
    return f"{round(t_s, digits) + 0.0:.{digits}f}".rstrip("0").rstrip(".")  # without a minus before zero


def span_text(from_s: float, to_s: float, digits: int = 6) -> str:
    """Begin and end of a stretch of time [s]."""
    return f"from {time_text(from_s, digits)} s to {time_text(to_s, digits)} s"


@dataclass(frozen=True)
class _OfChannel(abc.ABC):
    """Undoes a mistake of one channel."""

    channel: str

    @abc.abstractmethod
    def repaired(self, channel: Channel) -> Channel:
        """The channel without the mistake."""

    def apply(self, recording: Recording) -> Recording:
        """A copy of the recording with the channel repaired; one that does not have the channel stays as it is."""
        if self.channel not in recording.channels:
            return recording
        return with_channel(recording, self.channel, self.repaired(recording.channels[self.channel]))


@dataclass(frozen=True)
class Mixed(_OfChannel):
    """The columns of a channel as sums of what was recorded: signs, units and order.

    Attributes:
        channel: name. columns: of it, n. matrix: n rows of n numbers; new values = matrix times recorded values.
        offset: n numbers, added afterwards.
    """

    columns: tuple[str, ...]
    matrix: tuple[tuple[float, ...], ...]
    offset: tuple[float, ...] = ()

    def __str__(self):
        rows, offsets = self.matrix, self.offset or (0.0,) * len(self.columns)
        said = []
        for name, row, offset in zip(self.columns, rows, offsets, strict=True):
            terms = [
                column if factor == 1.0 else f"-{column}" if factor == -1.0 else f"{factor:.6g} {column}"
                for factor, column in zip(row, self.columns, strict=True) if factor
            ]
            if offset:
                terms.append(f"{offset:.6g}")
            text = " + ".join(terms).replace("+ -", "- ") or "0"
            if text != name:
                said.append(f"{name} = {text}")
        return f"{self.channel}: {', '.join(said)}"

    def repaired(self, channel: Channel) -> Channel:
        """The channel with these columns."""
        at = [channel.columns.index(name) for name in self.columns]
        values = channel.values.copy()
        values[:, at] = channel.values[:, at] @ np.array(self.matrix).T
        if self.offset:
            values[:, at] += self.offset
        return replace(channel, values=values)


@dataclass(frozen=True)
class Unwrapped(_OfChannel):
    """Columns whose counter starts anew after `turn`, made continuous."""

    columns: tuple[str, ...]
    turn: float

    def __str__(self):
        return f"{self.channel}: {', '.join(self.columns)} continued by {self.turn:.6g} wherever it jumps by that"

    def repaired(self, channel: Channel) -> Channel:
        """The channel with continuous columns."""
        values = channel.values.copy()
        for name in self.columns:
            at = channel.columns.index(name)
            values[:, at] = np.unwrap(values[:, at], period=self.turn)
        return replace(channel, values=values)


@dataclass(frozen=True)
class Clock(_OfChannel):
    """Other time stamps of a channel, of its samples from since_s on: t' = rate t + offset_s."""

    rate: float
    offset_s: float
    since_s: float = -math.inf

    def __str__(self):
        # the farther a rate moves the times, the more of its digits matter
        rate = f"{self.rate:.9g}" if abs(self.offset_s) < 1.0 else repr(float(self.rate))
        scale = "t" if self.rate == 1.0 else f"{rate} t"
        by = time_text(abs(self.offset_s))
        offset = f" {'-' if self.offset_s < 0 else '+'} {by} s" if by != "0" else ""
        since = f" from {time_text(self.since_s)} s on" if self.since_s > -math.inf else ""
        return f"{self.channel}: t = {scale}{offset}{since}"

    def moved(self, t: np.ndarray) -> np.ndarray:
        """(n,) the times [s] that stand for times t (n,) of the recorded clock."""
        return np.where(t >= self.since_s, self.rate * t + self.offset_s, t)

    def repaired(self, channel: Channel) -> Channel:
        """The channel by the other clock; the nominal period follows a clock that drifts.

        Samples that would come before an earlier one are left out.
        """
        values, t, late = channel.values.copy(), self.moved(channel.t), channel.t >= self.since_s
        if "t_received" in channel.columns:
            at = channel.columns.index("t_received")
            values[:, at] = np.where(late, self.rate * values[:, at] + self.offset_s, values[:, at])
        latest = np.maximum.accumulate(np.concatenate([[-np.inf], t[:-1]]))
        is_sound = abs(self.rate - 1.0) <= PERIOD_TOLERANCE  # stamps in another unit need not have a period in it
        period_s = channel.period_s * self.rate if is_sound and channel.period_s else None
        return rows(replace(channel, t=t, values=values, period_s=period_s), t > latest)


@dataclass(frozen=True)
class Evened(_OfChannel):
    """The samples of a channel at the even steps that its stamps lie nearest to, by least squares."""

    def __str__(self):
        return f"{self.channel}: stamps at even steps"

    def repaired(self, channel: Channel) -> Channel:
        """The channel with even stamps."""
        number = np.arange(len(channel.t)) - 0.5 * (len(channel.t) - 1)
        step_s = float(number @ channel.t / max(number @ number, 1.0))
        even = channel.t.mean() + step_s * number
        return replace(channel, t=even, period_s=None)


@dataclass(frozen=True)
class Gridded(_OfChannel):
    """The samples of a channel at since_s and multiples of a step after it, of which some may be missing."""

    step_s: float
    since_s: float

    def __str__(self):
        return f"{self.channel}: stamps at {time_text(self.since_s)} s and multiples of {self.step_s:.6g} s after it"

    def repaired(self, channel: Channel) -> Channel:
        """The channel with such stamps: the nearest ones that no earlier sample has."""
        order = np.arange(len(channel.t))
        number = np.maximum.accumulate(np.rint((channel.t - self.since_s) / self.step_s) - order) + order
        even = replace(channel, t=self.since_s + number * self.step_s, period_s=None)
        return even


@dataclass(frozen=True)
class Interpolated(_OfChannel):
    """A channel's values along a smooth curve through its samples, held for a step each; across a gap as recorded.

    The curve is Akima's: exact for ramps but beside their corners, right to 2e-5 for a sine of a hundred samples.
    """

    step_s: float

    def __str__(self):
        return f"{self.channel}: a smooth curve through its samples, every {self.step_s:.6g} s"

    def repaired(self, channel: Channel) -> Channel:
        """The channel with the curve's value in the middle of each step, from its first sample to its last."""
        apart = np.diff(channel.t)
        gaps = np.flatnonzero(apart > 2.0 * np.median(apart))
        at = np.insert(channel.t, gaps + 1, channel.t[gaps + 1] - self.step_s)
        values = np.insert(channel.values, gaps + 1, channel.values[gaps], axis=0)
        t = np.arange(channel.t[0], channel.t[-1], self.step_s)
        middles = np.minimum(t + 0.5 * self.step_s, channel.t[-1])
        return replace(channel, t=t, values=Akima1DInterpolator(at, values)(middles), period_s=self.step_s)


@dataclass(frozen=True)
class Restamped(_OfChannel):
    """Some samples of a channel at earlier times.

    Attributes:
        channel: name. samples: their numbers. earlier_s: by how much each is earlier.
    """

    samples: tuple[int, ...]
    earlier_s: tuple[float, ...]

    def __str__(self):
        return f"{self.channel}: {len(self.samples)} samples up to {1e3 * max(self.earlier_s):.2g} ms earlier"

    def repaired(self, channel: Channel) -> Channel:
        """The channel with such stamps; none comes before the sample before it."""
        t = channel.t.copy()
        t[list(self.samples)] -= self.earlier_s
        return rows(replace(channel, t=t), np.diff(t, prepend=-math.inf) > 0.0)


@dataclass(frozen=True)
class LeftOut(_OfChannel):
    """Some samples of a channel left out; samples: their numbers."""

    samples: tuple[int, ...]

    def __str__(self):
        return f"{self.channel}: {len(self.samples)} samples left out"

    def repaired(self, channel: Channel) -> Channel:
        """The channel without these samples."""
        kept = np.ones(len(channel.t), bool)
        kept[list(self.samples)] = False
        return rows(replace(channel, period_s=None), kept)


@dataclass(frozen=True)
class Dropped(_OfChannel):
    """The samples of a channel from from_s to to_s left out."""

    from_s: float
    to_s: float

    def __str__(self):
        return f"{self.channel}: samples {span_text(self.from_s, self.to_s)} left out"

    def repaired(self, channel: Channel) -> Channel:
        """The channel without these samples."""
        return rows(channel, (channel.t < self.from_s) | (channel.t > self.to_s))


@dataclass(frozen=True)
class Mirrored(_OfChannel):
    """The samples of a channel from from_s to to_s in the opposite order; what was received when stays."""

    from_s: float
    to_s: float

    def __str__(self):
        return f"{self.channel}: samples {span_text(self.from_s, self.to_s)} in the opposite order"

    def repaired(self, channel: Channel) -> Channel:
        """The channel with these samples turned round."""
        inside = np.flatnonzero((channel.t >= self.from_s) & (channel.t <= self.to_s))
        measured = [at for at, name in enumerate(channel.columns) if name != "t_received"]
        values = channel.values.copy()
        values[np.ix_(inside, measured)] = channel.values[np.ix_(inside[::-1], measured)]
        return replace(channel, values=values)


@dataclass(frozen=True)
class Turned(_OfChannel):
    """Headings of a channel turned by angle_rad, from from_s to to_s."""

    from_s: float
    to_s: float
    angle_rad: float

    def __str__(self):
        angle = f"{abs(math.degrees(self.angle_rad)):.4g} degrees"
        sense = "clockwise" if self.angle_rad < 0 else "counterclockwise"
        return f"{self.channel}: phi {span_text(self.from_s, self.to_s)} turned {sense} by {angle}"

    def repaired(self, channel: Channel) -> Channel:
        """The channel with these headings turned."""
        values = channel.values.copy()
        inside = (channel.t >= self.from_s) & (channel.t <= self.to_s)
        values[inside, channel.columns.index("phi")] += self.angle_rad
        return replace(channel, values=values)


@dataclass(frozen=True)
class AlongRobot:
    """A commanded velocity along the axes of the room, turned into the robot's by the headings that a camera sees.

    What is held for longer than from fix to fix is turned anew about as often.
    """

    channel: str
    camera: str

    def __str__(self):
        return f"{self.channel}: vx, vy turned from the axes of the room into the robot's by phi of {self.camera}"

    def apply(self, recording: Recording) -> Recording:
        """A copy of the recording with the velocity along the robot; without a camera it stays as it is."""
        told, camera = (recording.channels.get(name) for name in (self.channel, self.camera))
        if told is None or camera is None or len(camera.t) < 2:
            return recording
        step_s = max((camera.t[-1] - camera.t[0]) / (len(camera.t) - 1), TICK_S)
        holds = np.diff(told.t, append=told.t[-1:])
        parts = np.maximum(np.ceil(holds / step_s - PERIOD_TOLERANCE), 1.0).astype(int)
        of = np.repeat(np.arange(len(holds)), parts)
        part, lasts = np.arange(len(of)) - np.searchsorted(of, of), holds[of] / parts[of]
        t, values = told.t[of] + part * lasts, told.values[of]
        phi = np.interp(t + 0.5 * lasts, camera.t, np.unwrap(camera.column("phi")))
        at = [told.columns.index(name) for name in ("vx", "vy")]
        values[:, at] = rotated(values[:, at], -phi)
        period_s = told.period_s if len(t) == len(told.t) else None
        return with_channel(recording, self.channel, replace(told, t=t, values=values, period_s=period_s))


@dataclass(frozen=True)
class Without:
    """The channel left out."""

    channel: str

    def __str__(self):
        return f"{self.channel}: left out"

    def apply(self, recording: Recording) -> Recording:
        """A copy of the recording without the channel."""
        return replace(recording, channels={k: v for k, v in recording.channels.items() if k != self.channel})


@dataclass(frozen=True)
class CutOut:
    """A stretch left out of all channels, so that the run falls into the parts before and after it."""

    from_s: float
    to_s: float

    def __str__(self):
        return f"all channels: {span_text(self.from_s, self.to_s)} cut out"


OfStretch = Dropped | Mirrored | CutOut
OfStamps = Clock | Evened | Gridded | Restamped
Repair = Mixed | Unwrapped | Turned | AlongRobot | OfStamps | Interpolated | LeftOut | Without | OfStretch


def with_channel(recording: Recording, name: str, channel: Channel) -> Recording:
    """A copy of the recording with another channel of that name, of which no sample is received before its stamp."""
    if "t_received" in channel.columns:
        values, at = channel.values.copy(), channel.columns.index("t_received")
        values[:, at] = np.maximum(values[:, at], channel.t)
        channel = replace(channel, values=values)
    return replace(recording, channels={**recording.channels, name: channel})


def rows(channel: Channel, kept: np.ndarray) -> Channel:
    """The channel's samples at which `kept` (n,) is true."""
    return replace(channel, t=channel.t[kept], values=channel.values[kept])


def from_zero(recording: Recording, channels: Iterable[str]) -> Recording:
    """The recording with its clocks set to 0 where the first of these channels begins.

    Samples before that are left out. A recording that begins with the first tick stays as it is.
    """
    first = min(recording.channels[name].t[0] for name in channels)
    if 0.0 <= first < 2.0 * TICK_S:
        return recording
    for name, channel in recording.channels.items():
        kept = with_channel(recording, name, rows(channel, channel.t >= first))
        recording = Clock(name, 1.0, -float(first)).apply(kept)
    return recording


def repaired(recording: Recording, repairs: Iterable[Repair]) -> Recording:
    """The recording after all repairs but cuts, one after the other."""
    for repair in repairs:
        recording = recording if isinstance(repair, CutOut) else repair.apply(recording)
    return recording


def parts(recording: Recording, cuts: list[CutOut], shortest_s: float) -> list[Recording]:
    """The stretches of a recording between its cuts; those shorter than shortest_s are left out.

    Times stay as they are. A channel that has no sample in a stretch is missing there.
    """
    start = min(channel.t[0] for channel in recording.channels.values())
    end = max(channel.t[-1] for channel in recording.channels.values())
    found = []
    for cut in [*sorted(cuts, key=lambda cut: cut.from_s), CutOut(end + 1.0, end + 1.0)]:
        if min(cut.from_s, end) - start >= shortest_s:
            inside = {
                name: rows(channel, (channel.t >= start) & (channel.t <= cut.from_s))
                for name, channel in recording.channels.items()
            }
            held = {name: channel for name, channel in inside.items() if len(channel.t)}
            path = recording.path
            named = None if path is None else path.with_name(f"{path.name} from {time_text(start, 3)} s")
            found.append(replace(recording, channels=held, path=named))
        start = max(start, cut.to_s)
    return found
