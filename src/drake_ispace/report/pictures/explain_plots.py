"""Plots of an Explanation: prediction errors and the driven path, with the model as given and with the effects."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.ticker import FormatStrFormatter, LogLocator, NullFormatter

from drake_ispace.explain.prove.errors.free_run import PREDICTION, STEP, seconds_of
from drake_ispace.explain.prove.errors.gap import GapRow
from drake_ispace.explain.prove.left.remainder import amount
from drake_ispace.files.recording import Channel
from drake_ispace.report.pictures.plots import plt, save

BEFORE, AFTER, MEASURED = "#c0392b", "#27ae60", "#2980b9"
_MODELS = ((BEFORE, "model as given"), (AFTER, "with the effect"))


def plot_gap(rows: Sequence[GapRow], out: Path) -> None:
    """Plot the errors on unseen runs before and after, over what sensors and chance leave, which is 1 on the axis.

    Places over every horizon, and each sensor at its shortest one. What noise leaves must be known of every row.

    Raises:
        InputError: the folder cannot be written.
    """
    rows = _drawn(rows)
    figure, axis = plt.subplots(figsize=(10.5, 1.3 + 0.36 * len(rows)), layout="constrained")
    heights = np.arange(len(rows))[::-1]
    floors = np.array([max(float(np.hypot(row.sensors, row.chance)), 1e-300) for row in rows])
    before, after = (np.array([getattr(row, name) for row in rows]) / floors for name in ("before", "after"))
    axis.axvline(1.0, color="0.5", lw=1.2, ls="--", label="what noise leaves")
    axis.hlines(heights, np.minimum(before, after), np.maximum(before, after), color="0.75", lw=3, zorder=1)
    axis.plot(before, heights, "o", color=BEFORE, ms=8, label="model as given")
    axis.plot(after, heights, "o", color=AFTER, ms=6, label="with the effect")
    axis.set_xscale("log")
    axis.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axis.xaxis.set_major_formatter(FormatStrFormatter("%g"))
    axis.xaxis.set_minor_formatter(NullFormatter())
    axis.margins(x=0.12)
    for height, row in zip(heights, rows, strict=True):
        closed = "" if row.closed is None else f",  {100 * row.closed:.0f} % closed"
        text = f"{amount(row.before, row.unit)} → {amount(row.after, row.unit)}{closed}"
        axis.text(1.02, height, text, transform=axis.get_yaxis_transform(), va="center", fontsize=8.5)
    axis.set_yticks(heights, [_label(row) for row in rows])
    axis.set(xlabel="rms error on unseen runs, over what sensors and chance leave", ylim=(-0.6, len(rows) - 0.4))
    axis.grid(alpha=0.3, axis="x")
    figure.legend(*axis.get_legend_handles_labels(), loc="outside upper left", ncols=3, fontsize=9, frameon=False)
    save(figure, out)


def _drawn(rows):
    """The rows that are drawn: of a sensor only that of the shortest horizon but the next sample."""
    shortest = {}
    for row in rows:
        if row.metric == PREDICTION and row.horizon != STEP:
            known = shortest.setdefault((row.channel, row.kind), row)
            if seconds_of(row.horizon) < seconds_of(known.horizon):
                shortest[row.channel, row.kind] = row
    return [
        row for row in rows if row.metric != PREDICTION or any(row is other for other in shortest.values())
    ]


def _label(row):
    driven = f" ({row.driven_by})" if row.metric != PREDICTION else ""
    return f"{row.channel}{driven}, {row.horizon}{f', {row.kind}' if row.kind else ''}".replace("$", r"\$")


def plot_path(
    seen: Channel, reference: Channel | None, paths: Sequence[Channel | None], out: Path
) -> list[float | None]:
    """Plot what the camera saw and what it would have seen of the model, on the floor and over time.

    Args:
        seen: channel "kinect" as measured. reference: None where the model did not follow it. paths: channel "kinect"
            of the model as given and, where there are effects, of the model with them (None: it refuses the path).

    Returns:
        Root mean square distance [m] of each path to the measured positions.

    Raises:
        InputError: the folder cannot be written.
    """
    figure, (floor, time) = plt.subplots(
        1, 2, figsize=(12.5, 5.4), layout="constrained", gridspec_kw={"width_ratios": [1.15, 1.0]}
    )
    if reference is not None:
        floor.plot(reference.values[:, 0], reference.values[:, 1], "--", color="0.4", lw=1.0, label="reference")
    floor.plot(seen.values[:, 0], seen.values[:, 1], ".", color=MEASURED, ms=5, label="measured")
    rms_m = []
    for channel, (colour, label) in zip(paths, _MODELS, strict=False):
        if channel is None:
            rms_m.append(None)
            continue
        floor.plot(channel.values[:, 0], channel.values[:, 1], color=colour, lw=1.4, label=label)
        t, distance_m = distances(seen, channel)
        rms_m.append(float(np.sqrt(np.mean(distance_m**2))))
        time.plot(t, 1e3 * distance_m, color=colour, lw=1.3, label=f"{label}: {1e3 * rms_m[-1]:.1f} mm rms")
    title = "Dead reckoning against measurement" if reference is None else "Simulation against measurement"
    floor.set(xlabel="x [m]", ylabel="y [m]", title="What the camera sees", aspect="equal")
    time.set(xlabel="time [s]", ylabel="distance to the measurement [mm]", title=title)
    time.set_ylim(0.0, 1.25 * time.get_ylim()[1])
    floor.margins(0.08)
    for axis, place in ((floor, "best"), (time, "upper right")):
        axis.grid(alpha=0.3)
        axis.legend(fontsize=9, loc=place)
    save(figure, out)
    return rms_m


def distances(seen: Channel, simulated: Channel) -> tuple[np.ndarray, np.ndarray]:
    """Times (k,) [s] of the measured positions, and distances (k,) [m] to the simulated ones at these times.

    Measurements after the end of the simulation are left out.
    """
    t = seen.t[seen.t <= simulated.t[-1] + 1e-6]
    at = np.column_stack([np.interp(t, simulated.t, simulated.values[:, i]) for i in range(2)])
    return t, np.linalg.norm(seen.values[: len(t), :2] - at, axis=1)
