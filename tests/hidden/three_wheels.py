"""Recordings of a robot on three omni wheels with a velocity command, wheel encoders and motion capture; plain numpy.

The wheels turn as they are told. What may be hidden shows between wheels and camera.
"""

import numpy as np
from scipy.signal import lfilter

from drake_ispace.files.recording import Channel, Recording
from drake_ispace.scenario import Scenario, load_scenario
from hidden.two_wheels import FIX_RMS, wandering

RADIUS_M, ARM_M = 0.05, 0.17
COUNTS = 2048
_STEP_S, _ENCODER_S, _CAMERA_S = 1e-3, 0.02, 1.0 / 30.0
_SLIP_RMS = 2e-3
_AROUND = np.pi / 3.0 + 2.0 * np.pi * np.arange(3) / 3.0  # directions of the wheels from the middle


def model() -> Scenario:
    """The robot as it is believed to be."""
    return load_scenario("velocity_base", [
        "rover.plant.wheels=omni3", f"rover.plant.radius_m={RADIUS_M}", f"rover.plant.centre_distance_m={ARM_M}",
        f"rover.plant.first_rad={_AROUND[0]}",
    ])


def drive(
    seed: int, seconds: float, radius_shares=(0.0, 0.0, 0.0), toe_rad=(0.0, 0.0, 0.0), understeer_s2_m2: float = 0.0,
    roller_slip: float = 0.0, slip_s: float = 0.0, ripple_rad: float = 0.0,
) -> Recording:
    """A run: two seconds at rest, then velocities that change every few seconds.

    Args:
        seed: of the commands and of all noise. radius_shares: by which the wheels are larger than believed. toe_rad: by
            which they are turned. understeer_s2_m2: share of its turn that the robot loses over the square of its
            speed. roller_slip: share of its way that it loses in the directions in which a wheel drives, and nothing
            between them. slip_s: the same over its turning rate. ripple_rad: of the encoders, twice a turn.
    """
    random = np.random.default_rng([seed, 91])
    t = _STEP_S * np.arange(round(seconds / _STEP_S))
    command = np.column_stack([wandering(random, t, -most, most, _ENCODER_S) for most in (0.4, 0.4, 1.0)])
    rate = command @ _rates(np.full(3, RADIUS_M), np.zeros(3)).T
    white = random.standard_normal((len(t), 3))
    ground = rate * (1.0 - _SLIP_RMS * lfilter([0.05], [1.0, -0.95], white, axis=0) / 0.16)
    body = ground @ np.linalg.inv(_rates(RADIUS_M * (1.0 + np.array(radius_shares)), np.array(toe_rad))).T
    body[:, 2] *= 1.0 - understeer_s2_m2 * (body[:, 0] ** 2 + body[:, 1] ** 2)
    heading = np.arctan2(body[:, 1], body[:, 0])
    body[:, :2] *= (1.0 - roller_slip * np.cos(3.0 * heading) ** 2 - slip_s * np.abs(body[:, 2]))[:, None]
    phi = 0.3 + _sums(body[:, 2])
    c, s = np.cos(phi), np.sin(phi)
    x, y = 1.0 + _sums(c * body[:, 0] - s * body[:, 1]), -0.5 + _sums(s * body[:, 0] + c * body[:, 1])
    stamps = np.arange(0.013, seconds - _STEP_S, _CAMERA_S)
    seen = np.column_stack([np.interp(stamps, t, column) for column in (x, y, phi)])
    seen += random.standard_normal(seen.shape) * FIX_RMS
    seen[:, 2] = np.mod(seen[:, 2] + np.pi, 2.0 * np.pi) - np.pi
    read, count = np.arange(0, len(t), round(_ENCODER_S / _STEP_S)), 2.0 * np.pi / COUNTS
    angle = np.column_stack([_sums(column) for column in rate.T])
    angle += ripple_rad * np.sin(2.0 * angle)
    counted = count * np.floor(angle[read] / count + random.uniform(0.0, 1.0, 3))
    return Recording("mine", "velocity_base", {
        "command": Channel(t[read], ("vx", "vy", "wz"), command[read], {}, _ENCODER_S),
        "encoder": Channel(t[read], ("theta_1", "theta_2", "theta_3"), counted, {}, _ENCODER_S),
        "kinect": Channel(np.round(stamps, 6), ("x", "y", "phi"), seen, {}, None),
    }, f"three wheels, seed {seed}")


def _rates(radii, toe):
    """(3, 3) speeds of the wheels over the velocity of the body."""
    along = _AROUND + np.pi / 2.0 + toe
    x, y = ARM_M * np.cos(_AROUND), ARM_M * np.sin(_AROUND)
    rows = np.column_stack([np.cos(along), np.sin(along), x * np.sin(along) - y * np.cos(along)])
    return rows / radii[:, None]


def _sums(rates):
    """(k,) integral of rates from 0."""
    return np.concatenate([[0.0], np.cumsum(rates[:-1] * _STEP_S)])
