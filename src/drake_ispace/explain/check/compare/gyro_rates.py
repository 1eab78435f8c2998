"""How many times as fast a gyro turns as the headings of a camera say that goes with the wheels.

A gyro whose range is set to another one is off by 2, 4 or 8, or by any factor: no list holds them. The ratio is said as
it is measured, as that of a command is, unless it is that of a unit. Without a camera the wheels may as well be wrong.
"""

from collections.abc import Iterable, Sequence

import numpy as np

from drake_ispace.explain.check.compare.agreement import WELL
from drake_ispace.explain.check.compare.foreign import follows
from drake_ispace.explain.check.compare.links import FEWEST, LATENCY_S, Base, camera_link, integral
from drake_ispace.explain.check.compare.motion import has_motion, windows
from drake_ispace.explain.check.compare.regression import scale_of, weights
from drake_ispace.explain.check.compare.scale import is_unit
from drake_ispace.explain.levels import CERTAIN
from drake_ispace.files.recording import Channel, Recording

_ROUNDS = 20
_RATES = ("wx", "wy", "wz")


def ratios(runs: Sequence[Recording], bases: Sequence[Base | None]) -> list[float | None]:
    """That of each run with a gyro and wheels; None: not known."""
    both = zip(runs, bases, strict=True)
    return [_ratio(run, base) for run, base in both if base is not None and "imu" in run.channels]


def _ratio(run, base):
    """The ratio of the column of a gyro that goes with the turns most clearly, as its board may be on its side."""
    link = camera_link(run, base) if base.robot.in_room and has_motion(run) else None
    share = None if link is None else follows(link, base)
    if share is None or share < WELL:
        return None
    turns = turns_seen(run.channels["kinect"])
    fits = [fit for fit in (fitted(run.channels["imu"], *turns, name) for name in _RATES) if fit is not None]
    clear = [(abs(factors[0]) / std[0], abs(float(factors[0]))) for factors, std in fits]
    clearest, factor = max(clear, default=(0.0, 0.0))
    return 1.0 / factor if clearest > CERTAIN else None


def scales(measured: Iterable[float | None], factors: Iterable[float]) -> list[float]:
    """The ratios that no unit explains, that which most runs have first; factors: of the units, none among them."""
    known, found, scale = [ratio for ratio in measured if ratio is not None], [1.0, *factors], []
    usual = np.median(known) if known else 1.0
    for ratio in sorted(known, key=lambda one: abs(np.log(one / usual))):
        if not any(is_unit(ratio * factor) for factor in found):
            found.append(1.0 / ratio)
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
