"""How many times as fast a gyro turns as it should, by the headings of a camera or else by the wheels.

A gyro whose range is set to another one is off by 2, 4 or 8, or by any factor: no list holds them. The ratio is said as
it is measured, as that of a command is, unless it is that of a unit.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from drake_ispace.explain.check.compare.links import FEWEST, LATENCY_S, Base, inside, integral, turn_link
from drake_ispace.explain.check.compare.motion import has_motion, windows
from drake_ispace.explain.check.compare.regression import scale_of, weights
from drake_ispace.explain.check.compare.scale import is_unit
from drake_ispace.explain.levels import CERTAIN
from drake_ispace.files.recording import Channel, Recording

_ROUNDS = 20
_RATES = ("wx", "wy", "wz")
_ADVICE = "look up the range of the gyro, and measure the track: the ratio cannot tell which is off"


@dataclass(frozen=True)
class Ratio:
    """How many times as fast as a reference says, "camera" or "wheels", a gyro turns."""

    times: float
    reference: str

    @property
    def said(self) -> str:
        """In words."""
        return f"{self.times:.3g} times as fast as the {'wheels say' if self.advice else 'camera says'}"

    @property
    def advice(self) -> str:
        """What to do where nothing tells which of both is off; empty: the camera does."""
        return "" if self.reference == "camera" else _ADVICE


def ratios(runs: Sequence[Recording], bases: Sequence[Base | None]) -> list[Ratio | None]:
    """That of each run with a gyro and wheels; None: not known."""
    both = zip(runs, bases, strict=True)
    return [_ratio(run, base) for run, base in both if base is not None and "imu" in run.channels]


def _ratio(run, base):
    """The ratio of the column of a gyro that goes with the turns most clearly, as its board may be on its side."""
    for reference, turns in (("camera", _seen(run, base)), ("wheels", _of_wheels(run, base))):
        fits = [fit for fit in (fitted(run.channels["imu"], *turns, name) for name in _RATES) if fit is not None]
        clear = [(abs(factors[0]) / std[0], abs(float(factors[0]))) for factors, std in fits]
        clearest, factor = max(clear, default=(0.0, 0.0))
        if clearest > CERTAIN:
            return Ratio(1.0 / factor, reference)
    return None


def _seen(run, base):
    return turns_seen(run.channels["kinect"]) if base.robot.in_room and has_motion(run) else (np.empty(0),) * 3


def _of_wheels(run, base):
    link = turn_link(run, base)
    kept = inside(base, link.since_s, link.until_s)
    since, until = link.since_s[kept], link.until_s[kept]
    return since, until, link.predicted(since, until)[:, 0]


def explains(ratio: Ratio, factor: float) -> bool:
    """Whether a gyro that is multiplied by a factor turns as fast as it should, but for what physics may do."""
    return is_unit(ratio.times * factor)


def scales(measured: Iterable[Ratio | None], factors: Iterable[float]) -> list[Ratio]:
    """The ratios that no unit explains, that which most runs have first; factors: of the units, none among them."""
    known, found = [ratio for ratio in measured if ratio is not None], [1.0, *factors]
    usual, scale = np.median([ratio.times for ratio in known]) if known else 1.0, []
    for ratio in sorted(known, key=lambda one: abs(np.log(one.times / usual))):
        if not any(explains(ratio, factor) for factor in found):
            found.append(1.0 / ratio.times)
            scale.append(ratio)
    return scale


def turns_seen(kinect: Channel) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Begin and end [s] of windows (n,), and the turns [rad] that a camera saw in them."""
    stretches, headings = windows(kinect), np.unwrap(kinect.column("phi"))
    return stretches.since_s, stretches.until_s, headings[stretches.last] - headings[stretches.first]


def fitted(
    imu: Channel, since: np.ndarray, until: np.ndarray, turns: np.ndarray, column: str = "wz"
) -> tuple[np.ndarray, np.ndarray] | None:
    """(3,) factors that make a column of a gyro these turns, and their standard deviations; None: too short a run.

    The factors are on its turns, on the time [rad/s], and on what a reference that is late adds, as the difference of
    what the gyro turns about the window's ends.
    """
    inner = (since - LATENCY_S >= imu.t[0]) & (until + LATENCY_S <= imu.t[-1])
    if inner.sum() < 2 * FEWEST:
        return None
    since, until = since[inner], until[inner]
    later = [integral(imu, (column,), at - LATENCY_S, at + LATENCY_S)[:, 0] for at in (since, until)]
    late = later[1] - later[0]  # what a camera that is late adds is in proportion to this
    return _fitted(
        np.column_stack([integral(imu, (column,), since, until)[:, 0], until - since, late]), turns[inner]
    )


def _fitted(x, y):
    """(k,) factors of x (n, k) that make y (n,), and their standard deviations; what is far out hardly counts."""
    size = np.sqrt((x**2).mean(axis=0)) + 1e-12
    x, weight = x / size, np.ones(len(y))  # errors are taken to be of Student's distribution
    steady = 1e-12 * np.eye(x.shape[1])
    for _ in range(_ROUNDS):
        covariance = np.linalg.inv((x * weight[:, None]).T @ x + steady)
        factors = covariance @ (x * weight[:, None]).T @ y
        left = y - x @ factors
        scale = float(scale_of(left)) + 1e-12
        weight = weights(left / scale)
    return factors / size, scale * np.sqrt(np.diag(covariance)) / size
