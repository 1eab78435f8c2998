"""Logs of a robot that the package does not know, made by plain NumPy: wheels' counters, motion capture with its own
clock, each with the names and units of somebody else."""

from pathlib import Path

import numpy as np

STEP_S = 1e-3
COUNTS, WRAPS = 4096, 65536
UPTIME_S, EPOCH_S, LATE_S = 12.345, 1_700_000_000.0, 0.080
OFFSET_S = EPOCH_S + LATE_S - UPTIME_S  # of the camera's clock, its delay included


def drive(run: int, seconds: float):
    """Forward speed [m/s], sideways speed [m/s] and turning rate [rad/s] of a run, (n,) each, and times."""
    t = np.arange(round(seconds / STEP_S)) * STEP_S
    forward = 0.25 + 0.12 * np.sin(2 * np.pi * t / (7 + run) + run) + 0.08 * np.sin(2 * np.pi * t / 2.9 + 2 * run)
    turning = 0.9 * np.sin(2 * np.pi * t / (5 + 0.7 * run) + 0.5 * run)
    turning = turning + 0.4 * np.sign(np.sin(2 * np.pi * t / (11 + run)))
    return t, forward, 0.15 * np.sin(2 * np.pi * t / (4 + run)), turning


def travelled(velocity, start=(0.0, 0.0, 0.3)):
    """(n, 3) pose from body velocities (n, 3), step by step."""
    phi = start[2] + np.cumsum(velocity[:, 2]) * STEP_S
    x = start[0] + np.cumsum(velocity[:, 0] * np.cos(phi) - velocity[:, 1] * np.sin(phi)) * STEP_S
    y = start[1] + np.cumsum(velocity[:, 0] * np.sin(phi) + velocity[:, 1] * np.cos(phi)) * STEP_S
    return np.column_stack([x, y, phi])


def cart(run: int, seconds: float = 40.0, left_share: float = 0.04):
    """(t, angles (n, 2) left and right [rad], pose (n, 3)) of a cart of 0.1 m wheels and 0.3 m track, its left wheel
    larger by a share."""
    t, forward, _, turning = drive(run, seconds)
    right, left = (forward + 0.15 * turning) / 0.05, (forward - 0.15 * turning) / 0.05
    v_right, v_left = 0.05 * right, 0.05 * (1.0 + left_share) * left
    velocity = np.column_stack([(v_right + v_left) / 2, np.zeros(len(t)), (v_right - v_left) / 0.3])
    return t, np.cumsum(np.column_stack([left, right]), axis=0) * STEP_S, travelled(velocity)


def samples(run, seconds=40.0, left_share=0.04, late_s=LATE_S):
    """Of the cart: uptime [ms] and counts (m, 2) left and right; stamps since 1970 [s] and poses (k, 3)."""
    rng = np.random.default_rng(run)
    t, angles, pose = cart(run, seconds, left_share)
    every = slice(None, None, 20)
    counts = np.floor(angles[every] * [-1.0, 1.0] * COUNTS / (2 * np.pi)).astype(int) % WRAPS
    seen = slice(None, None, 33)
    noisy = pose[seen] + rng.normal(0.0, [4e-4, 4e-4, 9e-4], (len(pose[seen]), 3))
    noisy[:, 2] = (noisy[:, 2] + np.pi) % (2 * np.pi) - np.pi
    return 1e3 * (t[every] + UPTIME_S), counts, EPOCH_S + 1000.0 * run + t[seen] + late_s, noisy


def write_csv(folder: Path, run: int, seconds: float = 40.0, left_share: float = 0.04) -> None:
    """wheels.csv with semicolons, mocap.csv in millimetres and degrees, and a third file that no recording needs."""
    uptime_ms, counts, stamps, poses = samples(run, seconds, left_share)
    folder.mkdir(parents=True, exist_ok=True)
    lines = [f"{t:.0f};{left};{right}" for t, (left, right) in zip(uptime_ms, counts, strict=True)]
    (folder / "wheels.csv").write_text("\n".join(["uptime_ms;enc_links;enc_rechts", *lines, ""]))
    lines = [
        f"{t:.4f},{1e3 * x:.3f},{1e3 * y:.3f},{np.degrees(phi):.4f}"
        for t, (x, y, phi) in zip(stamps, poses, strict=True)
    ]
    (folder / "mocap.csv").write_text("\n".join(["stamp,X,Y,yaw_deg", *lines, ""]))
    (folder / "battery.csv").write_text("uptime_ms,volt\n" + "".join(f"{t:.0f},11.9\n" for t in uptime_ms[::50]))
