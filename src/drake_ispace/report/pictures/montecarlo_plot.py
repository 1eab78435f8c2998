"""The figure of a campaign: how the tracking error is distributed, and what it depends on."""

from pathlib import Path

import numpy as np
import pyarrow.compute as compute

from drake_ispace.report.pictures.plots import plt, save
from drake_ispace.rollout.many.campaign import Campaign

_ERROR = "rms_position_error_m"
_MOST_PARAMETERS = 11
_MOST_POINTS = 5000  # of a scatter plot
_COLOURS = ("#2980b9", "#e67e22", "#27ae60", "#8e44ad")
_LOST = "#c0392b"


def plot_campaign(campaign: Campaign, out: Path) -> None:
    """Plot a histogram of the position error and the error against every parameter that differs between runs.

    Runs that diverged are marks at the top edge. Only the first 11 parameters and 5000 runs are drawn.

    Raises:
        InputError: the folder cannot be written.
    """
    table = campaign.table
    errors = [name for name in campaign.metrics if name.rpartition(".")[2] == _ERROR]
    names = table.column_names
    keys = names[names.index("seed") + 1 : names.index("diverged")]
    keys = [key for key in keys if len(table[key].unique()) > 1][:_MOST_PARAMETERS]
    columns = min(1 + len(keys), 3)
    lines = -(-(1 + len(keys)) // columns)
    size = (5.0 * columns, 3.9 * lines)
    figure, axes = plt.subplots(lines, columns, figsize=size, squeeze=False, layout="constrained")
    axes = axes.ravel()
    _histogram(axes[0], table, errors)
    for axis, key in zip(axes[1:], keys, strict=False):
        _scatter(axis, table, key, errors)
    for axis in axes[1 + len(keys) :]:
        axis.set_visible(False)
    save(figure, out)


def _histogram(axis, table, errors):
    values = {name: 1e3 * table[name].drop_null().to_numpy() for name in errors}
    together = np.concatenate(list(values.values()))
    bins = np.histogram_bin_edges(together, min(60, max(10, int(np.sqrt(len(together))))))
    if _is_wide(together):
        bins = np.geomspace(bins[0], bins[-1], len(bins))
        axis.set_xscale("log")
    for colour, (name, column) in zip(_COLOURS, values.items(), strict=False):
        if len(column):
            axis.hist(column, bins, color=colour, alpha=0.6, label=_robot(name))
            low, middle, high = np.quantile(column, [0.05, 0.5, 0.95])
            axis.axvline(middle, color=colour, lw=1.6, label=f"median {middle:.3g} mm")
            axis.axvspan(low, high, color=colour, alpha=0.1, lw=0, label=f"5 % to 95 %: {low:.3g} to {high:.3g} mm")
    lost = sum(table["diverged"].to_pylist())
    axis.set(xlabel="rms position error [mm]", ylabel="runs", title=f"{table.num_rows} runs, {lost} diverged")
    axis.grid(alpha=0.3)
    if len(together):
        axis.legend(fontsize=8)


def _scatter(axis, table, key, errors):
    table = table.slice(0, _MOST_POINTS)
    parameter = table[key].to_numpy()
    lost = table["diverged"].to_numpy(zero_copy_only=False)
    size = float(np.clip(6000.0 / len(parameter), 3.0, 14.0))
    if _is_wide(parameter):
        axis.set_xscale("log")
    if any(_is_wide(table[name].drop_null().to_numpy()) for name in errors):
        axis.set_yscale("log")
    for colour, name in zip(_COLOURS, errors, strict=False):
        error = compute.fill_null(table[name], np.nan).to_numpy()
        axis.scatter(parameter, 1e3 * error, s=size, color=colour, alpha=0.5, lw=0, label=_robot(name))
    if lost.any():
        edge = axis.get_xaxis_transform()
        axis.plot(parameter[lost], np.full(lost.sum(), 0.97), "x", color=_LOST, ms=4, transform=edge, label="diverged")
    axis.set(xlabel=key, ylabel="rms position error [mm]")
    axis.grid(alpha=0.3)
    if lost.any() or len(errors) > 1:
        axis.legend(fontsize=8)


def _is_wide(values):
    """Whether a logarithmic axis shows more of `values`."""
    return len(values) > 0 and 0.0 < 30.0 * values.min() < values.max() and np.median(values) < 0.2 * values.max()


def _robot(name):
    return name.rpartition(".")[0] or "runs"
