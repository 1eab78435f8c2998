"""One run as the checks see it: the motion that the camera saw, and what the model makes of the wheels' motion."""

from dataclasses import dataclass
from functools import cache

import numpy as np

from drake_ispace.blocks.frames import rotated
from drake_ispace.files.recording import Channel, Recording
from drake_ispace.plants.wheels import WheelGeometry

WINDOW_S = 0.7  # of camera, gyro and command
_ALIKE_S = 0.1  # within which the noise of fixes may be alike
_LONGEST = 2.0  # a window with a gap in it may last as many times as long


@dataclass(frozen=True)
class View:
    """How the camera's poses are to be read: p' = axes p, phi' = scale phi + offset_rad."""

    axes: tuple[tuple[float, float], tuple[float, float]] = ((1.0, 0.0), (0.0, 1.0))
    scale: float = 1.0
    offset_rad: float = 0.0

    @property
    def matrix(self) -> np.ndarray:
        """(2, 2) axes: in another order, of another sense or unit."""
        return np.array(self.axes)

    def then(self, other: "View") -> "View":
        """This reading, and another of what it gives."""
        axes = tuple(map(tuple, (np.array(other.axes) @ self.axes).tolist()))
        return View(axes, other.scale * self.scale, other.scale * self.offset_rad + other.offset_rad)


AS_GIVEN = View()


@dataclass(frozen=True)
class Windows:
    """Stretches of a run: since_s, until_s (n,) [s] on the camera's clock; numbers of their fixes first, last (n,)."""

    since_s: np.ndarray
    until_s: np.ndarray
    first: np.ndarray
    last: np.ndarray


def between(kinect: Channel, first: np.ndarray, last: np.ndarray) -> Windows:
    """The stretches from some fixes to later ones; first, last: (n,) their numbers."""
    return Windows(kinect.t[first], kinect.t[last], first, last)


def windows(kinect: Channel, starts: int = 1, window_s: float = WINDOW_S) -> Windows:
    """Windows that begin and end with a fix, end to end; starts: how many series, begun a share of a window apart.

    window_s: length of each, up to the next fix.
    """
    pairs = set()
    for k in range(starts):
        i = int(np.searchsorted(kinect.t, kinect.t[0] + k * window_s / starts))
        while i < len(kinect.t):
            j = int(np.searchsorted(kinect.t, kinect.t[i] + window_s - 1e-9))
            if j < len(kinect.t) and kinect.t[j] - kinect.t[i] <= _LONGEST * window_s:
                pairs.add((i, j))
            i = max(j, i + 1)
    first, last = np.array(sorted(pairs), dtype=int).reshape(-1, 2).T
    return between(kinect, first, last)


class Camera:
    """The motion that a camera saw in some stretches of a run, however its poses are to be read."""

    def __init__(self, kinect: Channel, stretches: Windows):
        self._places, self._first, self._last = kinect.values[:, :2], stretches.first, stretches.last
        wide = correlated(kinect)
        self._heading = cache(lambda scale: np.unwrap(scale * kinect.column("phi")))  # (k,) [rad], continuous
        self._noise_of_places = cache(lambda: np.array([noise_of(column, wide) for column in self._places.T]))
        self._noise_of_heading = cache(lambda scale: noise_of(self._heading(scale), wide))

    def motion(self, view: View = AS_GIVEN) -> np.ndarray:
        """(n, 3) motion [m, m, rad] in the body's axes at mid-heading."""
        moved, phi = (self._places[self._last] - self._places[self._first]) @ view.matrix.T, self._heading(view.scale)
        middle = 0.5 * (phi[self._last] + phi[self._first]) + view.offset_rad
        return np.column_stack([rotated(moved, -middle), phi[self._last] - phi[self._first]])

    def noise(self, view: View = AS_GIVEN) -> np.ndarray:
        """(3,) standard deviation of x, y [m], phi [rad], as of `camera_noise`."""
        return np.append(np.abs(view.matrix) @ self._noise_of_places(), self._noise_of_heading(view.scale))


def seen(kinect: Channel, stretches: Windows) -> np.ndarray:
    """(n, 3) motion [m, m, rad] in the body's axes at mid-heading, as the camera saw it."""
    return Camera(kinect, stretches).motion()


def seen_along(kinect: Channel, stretches: Windows) -> np.ndarray:
    """(n, 3) the same as it adds up from fix to fix along arcs, as that of wheels does, and with it noise of fixes."""
    phi = np.unwrap(kinect.column("phi"))
    steps = _along_arcs(np.diff(kinect.values[:, :2], axis=0), phi[:-1], np.diff(phi))
    path = np.vstack([np.zeros(3), np.cumsum(steps, axis=0)])
    return path[stretches.last] - path[stretches.first]


def seen_at_ends(kinect: Channel, stretches: Windows) -> np.ndarray:
    """(n, 3) the same as the first and the last fix alone tell it, of a robot that turns evenly between them."""
    places, phi = kinect.values[:, :2], np.unwrap(kinect.column("phi"))
    moved, turn = (of[stretches.last] - of[stretches.first] for of in (places, phi))
    return _along_arcs(moved, phi[stretches.first], turn)


def _along_arcs(moved, phi, turn):
    """(n, 3) motions in the body's axes, of places that move by `moved` (n, 2) along arcs, from a heading by a turn."""
    shorter = np.sinc(0.5 * np.clip(turn, -np.pi, np.pi) / np.pi)  # chords than arcs, of half a circle at most
    return np.column_stack([rotated(moved, -(phi + 0.5 * turn)) / shorter[:, None], turn])


def turned(encoder: Channel, since_s: np.ndarray, until_s: np.ndarray) -> np.ndarray:
    """(n, wheels) by which the wheels turned [rad] in the stretches."""
    return change_over(encoder.t, encoder.values, since_s, until_s)


def change_over(t: np.ndarray, values: np.ndarray, since_s: np.ndarray, until_s: np.ndarray) -> np.ndarray:
    """(n, columns) by how much values (k, columns) at times t (k,) change over windows, straight lines between them."""
    return np.column_stack([np.interp(until_s, t, one) - np.interp(since_s, t, one) for one in values.T])


def within(channel: Channel, stretches: Windows, lag_s: float = 0.0) -> np.ndarray:
    """(n,) which stretches lie inside the channel's time, the channel's clock being lag_s ahead."""
    return (stretches.since_s + lag_s >= channel.t[0]) & (stretches.until_s + lag_s <= channel.t[-1])


def arm(geometry: WheelGeometry) -> float:
    """Length [m] that makes turns comparable with distances: rms distance of the wheels from the centre."""
    return float(np.sqrt(np.mean([wheel.x_m**2 + wheel.y_m**2 for wheel in geometry.wheels]))) or 1.0


def camera_noise(kinect: Channel) -> np.ndarray:
    """(3,) standard deviation of x, y [m], phi [rad] beside a smooth motion, at most that of the sensor."""
    wide = correlated(kinect)
    return np.array([noise_of(column, wide) for column in (*kinect.values[:, :2].T, np.unwrap(kinect.column("phi")))])


def correlated(kinect: Channel) -> int:
    """Number of fixes within which their noise may be alike, as in a table that interpolates or smooths fixes."""
    apart = float(np.median(np.diff(kinect.t)))
    return max(round(_ALIKE_S / apart), 1) if apart > 0.0 else 1


def noise_of(values: np.ndarray, wide: int = 1) -> float:
    """The standard deviation of what changes from value to value (n,), or over `wide` values, beside a smooth motion.

    From third differences, in which that nearly vanishes; a tenth of the values may be off. Steps that are rare hide
    their rounding there.
    """
    if len(values) < 5:
        return 0.0
    changes = [of_third(_third_differences(values, lag)) for lag in {1, wide} if 3 * lag < len(values) - 1]
    return max(step_of(values) / np.sqrt(12.0), *map(float, changes))


def of_third(differences: np.ndarray) -> np.ndarray:
    """Standard deviation of the values whose third differences these are, along the first axis; a tenth may be off."""
    return np.quantile(np.abs(differences), 0.9, axis=0) / (1.645 * np.sqrt(20.0))


def _third_differences(values, lag):
    """(n - 3 lag,) of values (n,) that are `lag` apart."""
    for _ in range(3):
        values = values[lag:] - values[:-lag]
    return values


def step_of(values: np.ndarray) -> float:
    """The step that values (n,) are whole numbers of; 0 where they are not, or where most are different."""
    levels = np.unique(values)
    if len(levels) < 3 or len(levels) > len(values) / 4:
        return 0.0
    steps = np.diff(levels)
    step = float(steps.min())
    return step if np.abs(steps / step - np.rint(steps / step)).max() < 1e-3 else 0.0


def has_motion(recording: Recording) -> bool:
    """Whether a run has wheels and a camera that can be compared."""
    channels = recording.channels
    return all(name in channels and len(channels[name].t) > 2 for name in ("kinect", "encoder"))
