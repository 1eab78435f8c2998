"""Plots of runs."""

from pathlib import Path

import matplotlib
import numpy as np

from drake_ispace.blocks.messages import ESTIMATE, FIX, WAY_POINT
from drake_ispace.control.guide.paths import build_path
from drake_ispace.files.places import whole_file
from drake_ispace.simulation import Run

matplotlib.use("Agg")

import matplotlib.pyplot as plt

# Drawn in this order: what lies under the others is broad and pale.
_STYLES = {
    "estimate": {"color": "#27ae60", "lw": 3.0, "alpha": 0.35},
    "odometry": {"color": "#8e44ad", "lw": 1.2},
    "Kinect": {"color": "#2980b9", "ls": "", "marker": ".", "ms": 3},
    "actual": {"color": "#c0392b", "lw": 1.2},
    "reference": {"color": "0.2", "ls": "--", "lw": 1.0},
}


def plot_comparison(runs: dict[str, tuple[Run, str]], out: Path) -> None:
    """Plot reference, actual, odometry, Kinect and estimate of every run, on the floor and over time (Fig. 6.4b).

    Raises:
        InputError: the folder cannot be written.
    """
    figure, axes = plt.subplots(len(runs), 2, figsize=(12.5, 4.6 * len(runs)), squeeze=False, layout="constrained")
    for row, (name, (run, robot)) in zip(axes, runs.items(), strict=True):
        curves = _curves(run, robot)
        plot_floor(row[0], curves, run)
        title = name.replace("$", r"\$")  # a file's name is no formula
        row[0].set_title(title + (f"  (lost at {run.diverged_s:.2f} s)" if run.diverged_s is not None else ""))
        for label, (time, pose) in curves.items():
            row[1].plot(time, pose[:, 0], label=label, **_STYLES[label])
        row[1].set(xlabel="time [s]", ylabel="x [m]", title="x over time")
        row[1].grid(alpha=0.3)
        row[1].legend(fontsize=8)
    save(figure, out)


def plot_floor(axis, curves, run: Run) -> None:
    """Plot the curves in the plane, with the border of the space."""
    width, depth = run.scenario.space.width_m, run.scenario.space.depth_m
    axis.add_patch(plt.Rectangle((-width / 2, -depth / 2), width, depth, fill=False, ls=":", ec="0.6"))
    for label, (_, pose) in curves.items():
        axis.plot(pose[:, 0], pose[:, 1], label=label, **_STYLES[label])
    axis.set(xlabel="x [m]", ylabel="y [m]", aspect="equal")
    actual = curves["actual"][1]
    for limit, size, values in ((axis.set_xlim, width, actual[:, 0]), (axis.set_ylim, depth, actual[:, 1])):
        limit(max(-size / 2 - 0.1, values.min() - 0.5), min(size / 2 + 0.1, values.max() + 0.5))
    axis.grid(alpha=0.3)
    axis.legend(fontsize=8)


def _curves(run, robot):
    """Label -> (time [s], poses) of each curve that a run has."""
    time = run.time_s
    signal = {name.removeprefix(f"{robot}_"): rows for name, rows in run.signals.items()}
    way_point = signal["way_point"]
    trajectory = getattr(run.scenario, robot).trajectory
    reference = way_point[:, WAY_POINT.x : WAY_POINT.y + 1]
    if trajectory.kind not in ("step", "pulse"):
        is_there = way_point[:, [WAY_POINT.tick]] >= 0.0
        reference = np.where(is_there, reference, build_path(trajectory, robot).points_m[0])
    fix = signal["fix"]
    fresh = (np.diff(fix[:, FIX.tick], prepend=-1.0) != 0.0) & (fix[:, FIX.seen] > 0.0)
    estimated = signal["estimate"][:, ESTIMATE.tick] >= 0.0
    sampled = signal["odometry"][:, ESTIMATE.tick] >= 0.0
    return {
        "estimate": (time[estimated], signal["estimate"][estimated, ESTIMATE.x :]),
        "odometry": (time[sampled], signal["odometry"][sampled, ESTIMATE.x :]),
        "Kinect": (time[fresh], fix[fresh, FIX.x :]),
        "actual": (time, signal["pose"]), "reference": (time, reference),
    }


def save(figure, out: Path) -> None:
    """Write a figure beside its place, then rename.

    Raises:
        InputError: the folder cannot be written.
    """
    try:
        with whole_file(out) as beside:
            figure.savefig(beside, dpi=110)
    finally:
        plt.close(figure)
