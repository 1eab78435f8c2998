"""Structures of the regression: the regressors, a parameter of every method.

A `Problem` is Y = Theta'phi + error, one row a sample. The servo experiment's are (3.63)-(3.68), the friction
experiment's Table 4.1, a plain time series' (3.4).
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.signal import lfilter, savgol_filter

from drake_ispace.blocks.errors import InputError
from drake_ispace.blocks.rates import TICK_S
from drake_ispace.files.recording import Recording
from drake_ispace.plants.slip import GRAVITY
from drake_ispace.robots.library import robots

# of a run of the pendulum
_RADIUS_M = 0.08  # of its wheels
_DEAD_BAND_RAD_S = 0.1  # wheel speed whose sign counts as known
_LOW_PASS_S = 0.02  # that every signal passes
_CORRECTION_S = 20.0  # over which the specific force corrects the tilt


@dataclass(frozen=True)
class Problem:
    """A linear regression.

    Attributes:
        names: of the regressors, (n,); outputs: of the targets, (m,).
        regressor: Phi (N, n); target: Y (N, m).
        rate_hz: samples per second.
        reference: (N,) external signal that excites the loop, the source of instruments; None when there is none.
    """

    names: tuple[str, ...]
    outputs: tuple[str, ...]
    regressor: np.ndarray
    target: np.ndarray
    rate_hz: float
    reference: np.ndarray | None = None

    @property
    def scale(self) -> np.ndarray:
        """(n,) root mean square of each regressor, 1 where it is zero."""
        rms = np.sqrt(np.mean(self.regressor**2, axis=0))
        return np.where(rms > 0.0, rms, 1.0)

    def without(self, name: str) -> "Problem":
        """Without the regressor called `name`."""
        kept = [i for i, other in enumerate(self.names) if other != name]
        return replace(self, names=tuple(self.names[i] for i in kept), regressor=self.regressor[:, kept])


def full_state(position, tilt, torque, acceleration, rate_hz, reference=None) -> Problem:
    """(3.63)-(3.65): [s, theta, u] -> [s'', theta''], u = tau_r + tau_l.

    B's columns are equal and u_r = u_l, so only their sum can be identified: the coefficient of u is one column's.

    Args:
        position, tilt: (N,) [m], [rad], measured; torque: (N,) tau_r + tau_l [N m]; acceleration: (N, 2) Y.
    """
    return Problem(
        ("s", "theta", "u"), ("s_ddot", "theta_ddot"), np.column_stack([position, tilt, torque]),
        np.asarray(acceleration, dtype=float), rate_hz, reference,
    )


def optimised(position, tilt, torque, acceleration, rate_hz) -> Problem:
    """Section 3.4.3: components that the state matrix does not contain are left out, here s: [theta, u]."""
    return full_state(position, tilt, torque, acceleration, rate_hz).without("s")


def time_series(y: np.ndarray, u: np.ndarray, na: int, nb: int, delay: int = 1, rate_hz: float = 1.0) -> Problem:
    """(3.4), several outputs and inputs: [-y(t-1) .. -y(t-na), u(t-delay) .. u(t-delay-nb+1)] -> y(t).

    Args:
        y: (N, m); u: (N, l); na, nb: numbers of past outputs and inputs; delay: of the first input, in samples.
    """
    y, u = np.asarray(y, dtype=float).reshape(len(y), -1), np.asarray(u, dtype=float).reshape(len(u), -1)
    first = max(na, nb + delay - 1)
    if len(y) <= first:
        raise InputError(f"{len(y)} samples are too few for na = {na}, nb = {nb}, delay = {delay}")
    columns, names = [], []
    for signal, label, lags, sign in ((y, "y", range(1, na + 1), -1.0), (u, "u", range(delay, delay + nb), 1.0)):
        for lag in lags:
            for i in range(signal.shape[1]):
                columns.append(sign * signal[first - lag : len(y) - lag, i])
                names.append(f"{'-' if sign < 0 else ''}{label}{i + 1}(t-{lag})")
    outputs = tuple(f"y{i + 1}" for i in range(y.shape[1]))
    return Problem(tuple(names), outputs, np.column_stack(columns), y[first:], rate_hz)


def friction_problem(recording: Recording) -> Problem:
    """Table 4.1 from a run of the pendulum: [theta, sgn w, w, tau] -> [s'', theta''], both wheels summed.

    Y is differentiated once only: s'' from the accelerometer with gravity taken off, theta'' a difference of the gyro.
    The tilt is `tilt_of`'s. Wheel speed is a count difference; every signal passes the same low-pass, so that the
    linear relation holds between the filtered ones.

    Args:
        recording: with channels torque, encoder and imu, all every 5 ms.

    Raises:
        InputError: another robot, a channel that is missing or has another rate.
    """
    balancing = [name for name, robot in robots().items() if robot.own_dynamics]
    if recording.robot not in balancing:
        raise InputError(f"the run is of robot {recording.robot!r}, expected {' or '.join(balancing)}")
    for name in ("torque", "encoder", "imu"):
        if name not in recording.channels:
            raise InputError(f"the run has no channel {name}, expected torque, encoder and imu")
    tick_of = {name: np.round(c.t / TICK_S).astype(int) for name, c in recording.channels.items()}
    for name in ("torque", "encoder", "imu"):
        if len(tick_of[name]) < 400 or np.any(np.diff(tick_of[name]) != 1):
            raise InputError(f"channel {name}: expected at least 400 samples, one every 5 ms without gaps")
    first = max(tick_of[name][0] for name in ("torque", "encoder", "imu"))
    last = min(tick_of[name][-1] for name in ("torque", "encoder", "imu"))

    def rows(name):
        values = recording.channels[name].values
        return values[first - tick_of[name][0] : last + 1 - tick_of[name][0]]

    tau = rows("torque")[:-1].sum(axis=1)  # held on [t_k, t_k+1)
    imu, angle = rows("imu"), rows("encoder")
    tilt = tilt_of(imu, angle, _RADIUS_M)
    memory = float(np.exp(-TICK_S / _LOW_PASS_S))

    def smooth(signal):
        return lfilter([1.0 - memory], [1.0, -memory], signal, axis=0)

    speed = smooth(np.diff(angle, axis=0) / TICK_S)
    level = (imu[1:, 0] + GRAVITY * np.sin(tilt[1:])) / np.cos(tilt[1:])
    middle = 0.5 * (tilt[1:] + tilt[:-1])
    signs = np.where(np.abs(speed) > _DEAD_BAND_RAD_S, np.sign(speed), 0.0).sum(axis=1)
    regressor = np.column_stack([smooth(middle), smooth(signs), speed.sum(axis=1), smooth(tau)])
    target = np.column_stack([smooth(level), smooth(np.diff(imu[:, 4]) / TICK_S)])
    reference = None
    if "reference" in recording.channels:
        channel = recording.channels["reference"]
        at = np.searchsorted(channel.t, np.arange(first, last) * TICK_S + 1e-9, side="right") - 1
        gap, heading = channel.values[:, :2] - channel.values[0, :2], channel.values[0, 2]
        along = np.cos(heading) * gap[:, 0] + np.sin(heading) * gap[:, 1]
        reference = along[np.maximum(at, 0)]
    return Problem(
        ("theta", "sgn", "omega", "tau"), ("s_ddot", "theta_ddot"), regressor, target, 1.0 / TICK_S, reference
    )


def tilt_of(imu: np.ndarray, angle: np.ndarray, radius_m: float) -> np.ndarray:
    """Tilt [rad] (N,) after the run: the gyro's integral, its mean corrected by the specific force over 20 s.

    The rate's mean is the gyro's bias, as the tilt stays bounded. The specific force also holds the robot's own
    acceleration, which goes with its friction: it is taken off, from the wheels' second derivative over 0.2 s. (Left
    in, the tilt errs by 1 mrad in step with the motion, and C_cu by 12 %.)

    Args:
        imu: (N, 6) specific force [m/s^2] and rate [rad/s]; angle: (N, 2) of the wheels [rad]; radius_m: of the wheels.
    """
    rate = imu[:, 4] - imu[:, 4].mean()
    wheels = 0.5 * angle.sum(axis=1) + TICK_S * np.cumsum(rate)
    own = radius_m * savgol_filter(wheels, 41, 2, deriv=2, delta=TICK_S)
    lean = np.arctan2(own - imu[:, 0], imu[:, 2])
    keep = np.exp(-TICK_S / _CORRECTION_S)
    middle = 0.5 * (rate + np.concatenate([[0.0], rate[:-1]]))
    return lfilter([1.0], [1.0, -keep], keep * TICK_S * middle + (1.0 - keep) * lean)


def error_index(estimated: np.ndarray, actual: np.ndarray) -> float:
    """E_er [%] of (3.74): the mean of |P_est / P_act - 1|, with |P_est| itself where P_act is zero."""
    estimated, actual = np.ravel(estimated), np.ravel(actual)
    return float(100.0 * np.mean(np.abs(estimated - actual) / np.where(actual == 0.0, 1.0, np.abs(actual))))
