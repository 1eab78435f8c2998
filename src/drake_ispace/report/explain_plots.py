"""Plots of an Explanation: prediction errors and the driven path, with the model as given and with the effects."""

from pathlib import Path

import numpy as np

from drake_ispace.explain.answer.explanation import Gap
from drake_ispace.files.recording import Channel, Recording
from drake_ispace.report.plots import plt, save

BEFORE, AFTER, MEASURED = "#c0392b", "#27ae60", "#2980b9"


def plot_residuals(gaps: dict[str, Gap], out: Path) -> None:
    """Plot, for each channel, the root mean square prediction error on held-out runs, before and after.

    Both are divided by the error of the same effects refitted to the held-out runs, which is 1 on the axis.

    Args:
        gaps: channel -> Gap.

    Raises:
        InputError: the folder cannot be written.
    """
    figure, axis = plt.subplots(figsize=(9.5, 1.3 + 0.42 * len(gaps)), layout="constrained")
    rows = np.arange(len(gaps))[::-1]
    refitted = np.array([max(gap.refitted, 1e-300) for gap in gaps.values()])
    before = np.array([gap.before for gap in gaps.values()]) / refitted
    after = np.array([gap.after for gap in gaps.values()]) / refitted
    axis.axvline(1.0, color="0.5", lw=1.2, ls="--", label="effects refitted to these runs")
    axis.hlines(rows, np.minimum(before, after), np.maximum(before, after), color="0.75", lw=3, zorder=1)
    axis.plot(before, rows, "o", color=BEFORE, ms=8, label="model as given")
    axis.plot(after, rows, "o", color=AFTER, ms=8, label="with the effect")
    if before.max() > 8.0:
        axis.set_xscale("log")
    axis.margins(x=0.12)
    for row, gap in zip(rows, gaps.values(), strict=True):
        text = f"{_short(gap.before)} → {_short(gap.after)} {gap.unit},  {100 * gap.closed:.0f} % closed"
        axis.text(1.02, row, text, transform=axis.get_yaxis_transform(), va="center", fontsize=8.5)
    axis.set_yticks(rows, [name.replace("$", r"\$") for name in gaps])
    axis.set(xlabel="rms one-step-ahead prediction error on held-out runs, over that of the refitted effects")
    axis.set_ylim(-0.6, len(gaps) - 0.4)
    axis.grid(alpha=0.3, axis="x")
    figure.legend(*axis.get_legend_handles_labels(), loc="outside upper left", ncols=3, fontsize=9, frameon=False)
    save(figure, out)


def plot_path(recording: Recording, before: Channel, after: Channel | None, out: Path) -> tuple[float, float | None]:
    """Plot what the camera saw and what it would have seen of the model in closed loop, on the floor and over time.

    Args:
        recording: measured, with the channels "reference" and "kinect". before, after: channel "kinect" of the model as
            given, and of the model with the effects (None: there are none).

    Returns:
        Root mean square distance [m] to the measured positions of the model as given, and with the effects.

    Raises:
        InputError: the folder cannot be written.
    """
    seen, reference = recording.channels["kinect"], recording.channels["reference"]
    figure, (floor, time) = plt.subplots(
        1, 2, figsize=(12.5, 5.4), layout="constrained", gridspec_kw={"width_ratios": [1.15, 1.0]}
    )
    floor.plot(reference.values[:, 0], reference.values[:, 1], "--", color="0.4", lw=1.0, label="reference")
    floor.plot(seen.values[:, 0], seen.values[:, 1], ".", color=MEASURED, ms=5, label="measured")
    rms_m = []
    for channel, colour, label in ((before, BEFORE, "model as given"), (after, AFTER, "with the effect")):
        if channel is None:
            rms_m.append(None)
            continue
        floor.plot(channel.values[:, 0], channel.values[:, 1], color=colour, lw=1.4, label=label)
        t, distance_m = distances(seen, channel)
        rms_m.append(float(np.sqrt(np.mean(distance_m**2))))
        time.plot(t, 1e3 * distance_m, color=colour, lw=1.3, label=f"{label}: {1e3 * rms_m[-1]:.1f} mm rms")
    floor.set(xlabel="x [m]", ylabel="y [m]", title="What the camera sees", aspect="equal")
    time.set(xlabel="time [s]", ylabel="distance to the measurement [mm]", title="Simulation against measurement")
    time.set_ylim(0.0, 1.25 * time.get_ylim()[1])
    floor.margins(0.08)
    for axis, place in ((floor, "best"), (time, "upper right")):
        axis.grid(alpha=0.3)
        axis.legend(fontsize=9, loc=place)
    save(figure, out)
    return rms_m[0], rms_m[1]


def distances(seen: Channel, simulated: Channel) -> tuple[np.ndarray, np.ndarray]:
    """Times (k,) [s] of the measured positions, and distances (k,) [m] to the simulated ones at these times.

    Measurements after the end of the simulation are left out.
    """
    t = seen.t[seen.t <= simulated.t[-1] + 1e-6]
    at = np.column_stack([np.interp(t, simulated.t, simulated.values[:, i]) for i in range(2)])
    return t, np.linalg.norm(seen.values[: len(t), :2] - at, axis=1)


def _short(value):
    return f"{value:.3g}"
