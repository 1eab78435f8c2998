"""Recordings of a two-wheeled robot with a velocity command, wheel encoders and motion capture; plain numpy.

Three things may be hidden at once: a left wheel that is larger than believed, motion capture that reports late, and a
drive that lags behind its command.
"""

import numpy as np
from scipy.signal import lfilter

from drake_ispace.files.recording import Channel, Recording

RADIUS_M, HALF_TRACK_M = 0.05, 0.15
COUNTS = 2048
_STEP_S = 1e-3
_FIX_RMS = (5e-4, 5e-4, 2e-3)
_SLIP_RMS = 2e-3


def drive(
    seed: int, seconds: float = 30.0, left_share: float = 0.04, late_s: float = 0.08, lag_s: float = 0.06,
    camera_hz: float = 30.0, encoder_hz: float = 50.0,
) -> Recording:
    """A run: two seconds at rest, then speeds and turning rates that change every few seconds.

    Args:
        seed: of the commands and of all noise. left_share: by which the left wheel is larger than believed.
        late_s: by which motion capture stamps its poses late [s]. lag_s: time constant of the drive [s].
    """
    random = np.random.default_rng([seed, 77])
    n = round(seconds / _STEP_S)
    t = _STEP_S * np.arange(n)
    v, w = _wandering(random, t, 0.1, 0.5), _wandering(random, t, -1.0, 1.0)
    command = np.column_stack([v, np.zeros(n), w])
    sent = np.column_stack([v + HALF_TRACK_M * w, v - HALF_TRACK_M * w]) / RADIUS_M  # right, left, as it believes
    keep = np.exp(-_STEP_S / lag_s) if lag_s > 0.0 else 0.0
    rate = lfilter([1.0 - keep], [1.0, -keep], sent, axis=0)
    angle = np.vstack([np.zeros(2), np.cumsum(rate[:-1] * _STEP_S, axis=0)])
    slip = 1.0 - _SLIP_RMS * lfilter([0.05], [1.0, -0.95], random.standard_normal((n, 2)), axis=0) / 0.16
    ground = rate * slip * [RADIUS_M, RADIUS_M * (1.0 + left_share)]
    turn = (ground[:, 0] - ground[:, 1]) / (2.0 * HALF_TRACK_M)
    phi = 0.3 + np.concatenate([[0.0], np.cumsum(turn[:-1] * _STEP_S)])
    forward = ground.mean(axis=1)
    x = 1.0 + np.concatenate([[0.0], np.cumsum((forward * np.cos(phi))[:-1] * _STEP_S)])
    y = -0.5 + np.concatenate([[0.0], np.cumsum((forward * np.sin(phi))[:-1] * _STEP_S)])
    stamps = np.arange(0.013, seconds - _STEP_S, 1.0 / camera_hz)
    seen = np.column_stack([np.interp(stamps - late_s, t, column) for column in (x, y, phi)])
    seen += random.standard_normal(seen.shape) * _FIX_RMS
    seen[:, 2] = np.mod(seen[:, 2] + np.pi, 2.0 * np.pi) - np.pi
    read = np.arange(0, n, round(1.0 / encoder_hz / _STEP_S))
    count = 2.0 * np.pi / COUNTS
    counted = count * np.floor(angle[read] / count + random.uniform(0.0, 1.0, 2))
    return Recording("mine", "velocity_base", {
        "command": Channel(t[read], ("vx", "vy", "wz"), command[read], {}, 1.0 / encoder_hz),
        "encoder": Channel(t[read], ("theta_1", "theta_2"), counted, {}, 1.0 / encoder_hz),
        "kinect": Channel(np.round(stamps, 6), ("x", "y", "phi"), seen, {}, None),
    }, f"two wheels, seed {seed}")


def _wandering(random, t, low, high):
    """(k,) values that are held for one to four seconds each; zero in the first two."""
    values, at = np.zeros(len(t)), 2.0
    while at < t[-1]:
        until = at + random.uniform(1.0, 4.0)
        values[(t >= at) & (t < until)] = random.uniform(low, high)
        at = until
    return values
