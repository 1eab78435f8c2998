"""What each channel says of the robot's motion, beside what the wheels say: motions over windows, of equal length.

The wheels' clock is the reference. A channel may be moved against it in time.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import Any

import numpy as np
from scipy.integrate import cumulative_trapezoid

from drake_ispace.blocks.rates import TICK_S
from drake_ispace.explain.check.compare.motion import (
    WINDOW_S,
    Windows,
    arm,
    camera_noise,
    change_over,
    has_motion,
    seen,
    turned,
    windows,
    within,
)
from drake_ispace.explain.check.compare.regression import CAMERA, MOST_ROWS, PHYSICS, SLACK, Slack, relation
from drake_ispace.explain.levels import CERTAIN
from drake_ispace.files.recording import Channel, Recording
from drake_ispace.plants.wheels import skidding
from drake_ispace.robots.robot import COMMAND, TORQUE, Robot

LATENCY_S = 0.2  # by which a channel may be late or early without its clock being wrong
UNKNOWN_INERTIA = Slack.of_factor(5.0)  # of a plant of one's own, of which a parameter may be free
PLACES_AND_TURNS = ((0, 1), (2,))  # components of a motion that share a scale
FEWEST = 6  # windows, below which a channel is not compared
RATE_S = 0.05  # half of the time over which angles are differentiated: no motion is told in more detail


def lags(most_s: float, step_s: float) -> np.ndarray:
    """(n,) multiples [s] of a step, from -most_s to most_s."""
    steps = round(most_s / step_s)
    return np.arange(-steps, steps + 1) * step_s


#: Latencies [s] that a sound channel may have.
LATENCIES_S = lags(LATENCY_S, TICK_S)
#: Number of series of overlapping windows, of which some begin within every latency.
SERIES = int(np.ceil(WINDOW_S / LATENCY_S))


@dataclass(frozen=True)
class Base:
    """A model and what the wheels of one run of it say.

    Attributes:
        robot, settings: of the model. encoder: the channel. rate_s: half of the time over which angles are
            differentiated. spoilt: stretches [s] in which the encoder is at fault.
    """

    robot: Robot
    settings: Any
    encoder: Channel
    rate_s: float = RATE_S
    spoilt: tuple[tuple[float, float], ...] = ()

    @cached_property
    def geometry(self):
        """The wheels, of which tyres that hold turns skid."""
        return skidding(self.settings.plant.geometry)

    @property
    def skids(self) -> bool:
        """Whether the robot of the model cannot turn, as its tyres hold it, and is compared as if they skid."""
        return self.settings.plant.geometry.holds_turns

    def moved(self, since_s: np.ndarray, until_s: np.ndarray) -> np.ndarray:
        """(n, 3) motion of the body [m, m, rad] in its own axes, as the wheels say."""
        return turned(self.encoder, since_s, until_s) @ self.geometry.forward.T

    @cached_property
    def parts(self) -> np.ndarray:
        """(k, 2) from and to [s] of the encoder's time between what is spoilt."""
        since, until = np.reshape(sorted(self.spoilt), (-1, 2)).T
        t = self.encoder.t
        return np.column_stack([np.append(t[0], np.maximum.accumulate(until)), np.append(since, t[-1])])

    @cached_property
    def load(self) -> Callable[[np.ndarray, np.ndarray], np.ndarray] | None:
        """A function of since_s, until_s (n,): (n, wheels) impulse [N m s] of what turns the wheels of a plant of one's
        own without torque; None: not known."""
        load = None if self.robot.in_room else self.settings.plant.load
        if load is None:
            return None
        t = np.arange(self.encoder.t[0] + self.rate_s, self.encoder.t[-1] - self.rate_s, self.rate_s)
        torques = load(self.angles(t), self.wheel_rates(t))
        if not np.isfinite(torques).all():
            return None
        return partial(change_over, t, cumulative_trapezoid(torques, t, axis=0, initial=0.0))

    def angles(self, t: np.ndarray) -> np.ndarray:
        """(n, wheels) [rad] of the wheels at times t (n,) [s]."""
        return np.column_stack([np.interp(t, self.encoder.t, angle) for angle in self.encoder.values.T])

    @property
    def count_rad(self) -> float:
        """A count of the encoders [rad]; 0 where these are exact."""
        counts = self.settings.encoder.counts_per_turn
        return 2.0 * np.pi / counts if counts > 0 else 0.0

    @property
    def lags_s(self) -> np.ndarray:
        """Lags [s] of torques at which they are compared: none in a room, where windows are as long as a usual lag."""
        return np.zeros(1) if self.robot.in_room else lags(LATENCY_S, self.rate_s)

    @property
    def noise(self) -> np.ndarray:
        """(3,) standard deviation [m, m, rad] of `moved` by whole counts."""
        return self.rounding(self.count_rad)

    def rounding(self, count_rad: float) -> np.ndarray:
        """(3,) the same where angles are whole numbers of `count_rad`."""
        return count_rad / np.sqrt(6.0) * np.linalg.norm(self.geometry.forward, axis=1)

    def noise_beside(self, of_fixes: np.ndarray) -> np.ndarray:
        """(3,) standard deviation [m, m, rad] of what the camera and `moved` differ by; of_fixes: (3,) of one fix."""
        return np.hypot(np.sqrt(2.0) * of_fixes, self.noise)

    def wheel_rates(self, t: np.ndarray) -> np.ndarray:
        """(n, wheels) [rad/s] of the wheels."""
        return turned(self.encoder, t - self.rate_s, t + self.rate_s) / (2.0 * self.rate_s)


@dataclass(frozen=True)
class Link:
    """A channel beside the wheels.

    Attributes:
        channel: name. since_s, until_s: (n,) windows on the channel's clock. measured: (n, d). predicted: of windows on
            the wheels' clock, (n, d). groups, noise (d,): as of regression.scores. besides: of windows, motions of any
            share; None: none. usual_s: from and to, by how much later [s] the wheels may say what a sound channel says.
        slack: of the relation. t: (k,) the channel's stamps. finer: the same in windows about as long as a usual
            latency, in which a late channel tells of little of the same motion; None: not told apart.
    """

    channel: str
    since_s: np.ndarray
    until_s: np.ndarray
    measured: np.ndarray
    predicted: Callable[[np.ndarray, np.ndarray], np.ndarray]
    groups: tuple[tuple[int, ...], ...]
    noise: np.ndarray
    besides: Callable[[np.ndarray, np.ndarray], np.ndarray] | None = None
    usual_s: tuple[float, float] = (-LATENCY_S, LATENCY_S)
    slack: Slack = PHYSICS
    t: np.ndarray = field(default_factory=lambda: np.empty(0))
    finer: "Link | None" = None

    @property
    def any_share(self) -> bool:
        """Whether motions besides may have any share, so that the channel may follow them without following the wheels.
        """
        return self.besides is not None and np.isinf(self.slack.besides)

    @property
    def differ_s(self) -> float:
        """By how much [s] latencies of a sound channel may differ in a run: a camera has one, as far as shows."""
        return RATE_S if self.channel == "kinect" else LATENCY_S

    def is_usual(self, lag_s):
        """Whether a sound channel may have this lag [s], or (n,) of several."""
        low, high = self.usual_s
        return (lag_s >= low - 1e-9) & (lag_s <= high + 1e-9)

    def only(self, kept: np.ndarray) -> "Link":
        """The Link with these of its windows (n,)."""
        times = {"since_s": self.since_s[kept], "until_s": self.until_s[kept]}
        return replace(self, **times, measured=self.measured[kept], finer=None)

    def outside(self, stretches: Iterable[tuple[float, float]], lag_s: float = 0.0) -> np.ndarray:
        """(n,) whether a window, and the same one lag_s later, lies outside of all stretches [s]."""
        kept = np.ones(len(self.since_s), bool)
        for begin, end in stretches:
            kept &= (self.until_s + lag_s < begin) | (self.since_s > end)
        return kept


def base_of(run: Recording, robot: Robot, settings: Any, spoilt: Iterable[tuple[float, float]] = ()) -> Base | None:
    """The wheels of a run; None without an encoder that can be compared. spoilt: as of Base."""
    encoder = run.channels.get("encoder")
    if encoder is None or len(encoder.t) < 3 or len(encoder.columns) != len(settings.plant.geometry.wheels):
        return None
    # of a plant of unknown quickness so short that a run has as many windows of torque as count
    most_s = RATE_S if robot.in_room else RATE_S / LATENCY_S * (encoder.t[-1] - encoder.t[0]) / MOST_ROWS
    return Base(robot, settings, encoder, float(min(RATE_S, most_s)), tuple(spoilt))


def links(run: Recording, base: Base) -> dict[str, Link]:
    """Channel -> Link of every channel of the run that can be compared."""
    found = {name: link_of(run, base, name) for name in ("kinect", "imu", TORQUE, COMMAND)}
    return {name: link for name, link in found.items() if link is not None}


def link_of(run: Recording, base: Base, channel: str) -> Link | None:
    """The Link of one channel; None where it cannot be compared."""
    makers = {"kinect": camera_link, "imu": turn_link, TORQUE: torque_link, COMMAND: command_link}
    link = makers[channel](run, base) if channel in makers and channel in run.channels else None
    if link is None or len(link.since_s) < FEWEST:
        return None
    finer = camera_link(run, base, window_s=LATENCY_S) if channel == "kinect" else None
    return replace(link, t=run.channels[channel].t, finer=finer)


def camera_link(
    run: Recording, base: Base, starts: int = 1, window_s: float = WINDOW_S, way_of: Callable = seen
) -> Link | None:
    """The camera's motion, in body axes; turns as lengths. starts, window_s: as of `windows`. way_of: motions of
    windows, `seen` or `seen_along`.
    """
    if not has_motion(run):
        return None
    kinect = run.channels["kinect"]
    stretches, unit = windows(kinect, starts, window_s), np.array([1.0, 1.0, arm(base.geometry)])
    return Link(
        "kinect", stretches.since_s, stretches.until_s, way_of(kinect, stretches) * unit,
        lambda since, until: base.moved(since, until) * unit, PLACES_AND_TURNS,
        base.noise_beside(camera_noise(kinect)) * unit, slack=CAMERA,
    )


def seen_of_wheels(run: Recording, base: Base, lag_s: float = 0.0) -> np.ndarray:
    """(3, 3) what turns motions [m, m, rad] (n, 3) that wheels make into those that the camera sees, all in all.

    It is not the identity where the marker is beside the robot's middle, or the wheels are larger than believed.
    lag_s: by how much later the wheels say what the camera sees.
    """
    link, unit = camera_link(run, base), np.array([1.0, 1.0, arm(base.geometry)])
    kept = inside(base, link.since_s, link.until_s, lag_s)
    if not kept.any():
        return np.eye(3)
    wheels = link.predicted(link.since_s[kept] + lag_s, link.until_s[kept] + lag_s)
    return relation(wheels[None], link.measured[kept][None], link.slack)[0] * unit[:, None] / unit


def turn_link(run: Recording, base: Base) -> Link | None:
    """The gyro's turns about the vertical. Of wheels that differ a little, a share of the way looks like a turn."""
    imu = run.channels["imu"]
    stretches = _grid(imu, base, WINDOW_S)
    measured = integral(imu, ("wz",), *stretches)
    return Link(
        "imu", *stretches, measured, lambda since, until: base.moved(since, until)[:, 2:], ((0,),), base.noise[2:],
        lambda since, until: base.moved(since, until)[:, None, :2], slack=Slack(besides=SLACK / arm(base.geometry)),
    )


def torque_link(run: Recording, base: Base) -> Link | None:
    """The torques' impulse, beside the momentum that the wheels say.

    Friction and a steady force from the floor or the room may take any share of it. So may what a plant of one's own
    does without torque, and a spring and a weight on its wheels if they stay within a turn. Of coordinates of a robot
    on which weight acts, nothing is compared.
    """
    plant, robot, torque = base.settings.plant, base.robot, run.channels[TORQUE]
    if robot.driven != TORQUE or len(torque.columns) != len(base.geometry.wheels):
        return None
    if robot.has_imu and "imu" not in run.channels:
        return None
    free = robot.unweighted
    mass, effort = robot.mass_matrix(plant)[free], robot.effort(plant)[free]
    size = np.abs(effort).max(axis=1)  # rows as torques
    # in windows no longer than a latency, a late torque would tell of none of the same motion
    stretches = _grid(torque, base, LATENCY_S / RATE_S * base.rate_s)
    pitch = run.channels.get("imu") if robot.has_imu else None

    def rates(t):
        wheels = base.wheel_rates(t)
        near = t - base.rate_s, t + base.rate_s
        lean = None if pitch is None else integral(pitch, ("wy",), *near)[:, 0] / (2.0 * base.rate_s)
        return robot.rates(plant, wheels, lean)

    def predicted(since, until):
        before, after = rates(since), rates(until)
        turning = robot.turning(0.5 * (before + after)) * (until - since)[:, None]
        return (after - before + turning) @ mass.T / size

    def besides(since, until):
        middle, lasts = 0.5 * (since + until), (until - since)[:, None]
        of_wheels = [turned(base.encoder, since, until), lasts * np.sign(base.wheel_rates(middle))]
        of_wheels += [] if base.load is None else [base.load(since, until)]
        if robot.in_room:
            place = base.moved(np.full(len(since), base.encoder.t[0]), middle)[:, 2:]
            of_place = [np.ones_like(place), np.cos(place), np.sin(place)]
        else:
            place = base.angles(middle) * (np.ptp(base.encoder.values, axis=0) < 2.0 * np.pi)
            of_place = [np.ones_like(place), np.cos(place), np.sin(place), place]
        of_place = [lasts * part * np.ones(len(free)) for part in of_place]
        return np.stack([*(part @ effort.T / size for part in of_wheels), *of_place], axis=2)

    impulse = held_integral(torque, *stretches) @ effort.T / size
    counts = np.abs(mass) @ np.resize(base.noise, mass.shape[1]) / (np.sqrt(2.0) * base.rate_s * size)
    slack = PHYSICS if robot.in_si else UNKNOWN_INERTIA
    return Link(TORQUE, *stretches, impulse, predicted, (tuple(range(len(free))),), counts, besides, slack=slack)


def command_link(run: Recording, base: Base) -> Link | None:
    """The commanded motion, of a robot that takes a velocity; turns as lengths."""
    command = run.channels[COMMAND]
    if base.robot.driven != COMMAND:
        return None
    stretches, unit = _grid(command, base, WINDOW_S), np.array([1.0, 1.0, arm(base.geometry)])
    return Link(
        COMMAND, *stretches, held_integral(command, *stretches) * unit,
        lambda since, until: base.moved(since, until) * unit, PLACES_AND_TURNS, base.noise * unit,
        usual_s=(-LATENCY_S, WINDOW_S),  # a drive may follow its command: later, it does nothing of it in the window
    )


def integral(channel: Channel, columns: tuple[str, ...], since_s: np.ndarray, until_s: np.ndarray) -> np.ndarray:
    """(n, columns) integrals over windows of a signal that is sampled, by the trapezoidal rule."""
    steps = np.diff(channel.t)[:, None]
    values = np.column_stack([channel.column(name) for name in columns])
    total = np.vstack([np.zeros(len(columns)), np.cumsum(0.5 * steps * (values[1:] + values[:-1]), axis=0)])
    return change_over(channel.t, total, since_s, until_s)


def held_integral(channel: Channel, since_s: np.ndarray, until_s: np.ndarray) -> np.ndarray:
    """(n, columns) integrals over windows of a signal that is held from sample to sample."""
    impulses = np.diff(channel.t)[:, None] * channel.values[:-1]
    total = np.vstack([np.zeros(channel.values.shape[1]), np.cumsum(impulses, axis=0)])
    return change_over(channel.t, total, since_s, until_s)


def _grid(channel, base, window_s):
    """Windows end to end over the channel's time, without those in which it has a gap."""
    margin = 2.0 * base.rate_s
    begin, end = channel.t[0] + margin, channel.t[-1] - margin
    number = np.unique(np.floor((channel.t - begin) / window_s))  # of those with a sample
    number = number[(number >= 0.0) & (begin + window_s * (number + 1.0) < end)]
    since, until = begin + window_s * number, begin + window_s * (number + 1.0)
    if not len(since):
        return since, until
    # a window with a gap: fewer samples in it than in half of the typical one
    inside = np.searchsorted(channel.t, until) - np.searchsorted(channel.t, since)
    kept = inside >= 0.5 * np.median(inside)
    return since[kept], until[kept]


def inside(base: Base, since_s: np.ndarray, until_s: np.ndarray, lag_s: float = 0.0) -> np.ndarray:
    """(n,) which windows lie inside the wheels' time, moved by lag_s, and outside of what is spoilt."""
    t, begin, end = base.encoder.t, since_s + lag_s - 2 * base.rate_s, until_s + lag_s + 2 * base.rate_s
    kept = (begin >= t[0]) & (end <= t[-1])
    for since, until in base.spoilt:
        kept &= (end <= since) | (begin >= until)
    return kept


def inside_late_or_early(base: Base, stretches: Windows) -> np.ndarray:
    """(n,) which stretches of a camera lie inside the wheels' time, by whatever usual time it is late or early."""
    return within(base.encoder, stretches, -LATENCY_S) & within(base.encoder, stretches, LATENCY_S)


def moves(link: Link) -> bool:
    """Whether a channel moves enough to tell the time."""
    return len(link.since_s) >= FEWEST and any(
        moving(link.measured[:, list(group)], link.noise[list(group)]) for group in link.groups
    )


def in_motion(x: np.ndarray, y: np.ndarray, noise: np.ndarray) -> np.ndarray:
    """(n,) in which of n windows one of two motions (n, d) is more than noise (d,) makes: rest says nothing of either.
    """
    return (np.maximum(np.abs(x), np.abs(y)) > CERTAIN * noise).any(axis=1)


def moving(motion: np.ndarray, noise: np.ndarray) -> bool:
    """Whether a motion (n, d) is more than its noise (d,) makes."""
    return bool(np.sqrt((motion**2).sum(axis=1).mean()) > CERTAIN * noise.max())
