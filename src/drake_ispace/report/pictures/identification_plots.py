"""Pictures of identification: data, convergence, responses."""

from pathlib import Path

import numpy as np

from drake_ispace.report.pictures.plots import plt, save
from drake_ispace.thesis.methods.estimate import Estimate

_COLORS = ("#2980b9", "#c0392b", "#27ae60", "#8e44ad", "#e67e22", "0.4")


def plot_convergence(
    estimates: dict[str, Estimate], seconds: float, out: Path, actual: np.ndarray | None = None,
    rows: int | None = None,
) -> None:
    """Plot coefficients over time, one panel each (Figs. 3.11, 4.3): methods with a history as curves, others as lines.

    Args:
        estimates: label -> estimate of the same problem. seconds: length of the record.
        actual: (n, m) true coefficients, dashed. rows: how many regressors to show, default those of the first
            estimate.
    """
    first = next(iter(estimates.values()))
    n, m = rows or len(first.names), len(first.outputs)
    figure, axes = plt.subplots(n, m, figsize=(5.6 * m, 2.1 * n), squeeze=False, sharex=True, layout="constrained")
    for i in range(n):
        for j in range(m):
            axis = axes[i, j]
            ends = []
            for color, (label, estimate) in zip(_COLORS, estimates.items(), strict=False):
                if estimate.history is None:
                    axis.axhline(estimate.theta[i, j], color=color, lw=1.2, ls="-.", label=label)
                else:
                    values = estimate.history[:, i, j]
                    axis.plot(np.linspace(0.0, seconds, len(values)), values, color=color, lw=1.2, label=label)
                    ends.append(values[len(values) // 10 :])
                ends.append(estimate.theta[i : i + 1, j])
            if actual is not None:
                axis.axhline(actual[i, j], color="0.2", ls="--", lw=1.0, label="actual")
                ends.append(actual[i : i + 1, j])
            low, high = np.min(np.concatenate(ends)), np.max(np.concatenate(ends))
            room = 0.15 * (high - low) + 1e-9 + 0.02 * max(abs(low), abs(high))
            axis.set_ylim(low - room, high + room)
            axis.set_ylabel(f"{first.names[i]} in {first.outputs[j]}", fontsize=8)
            axis.grid(alpha=0.3)
    axes[0, 0].legend(fontsize=8, ncols=3)
    for axis in axes[-1]:
        axis.set_xlabel("time [s]")
    save(figure, out)


def plot_signals(time_s: np.ndarray, panels: dict[str, dict[str, np.ndarray]], out: Path, span=None) -> None:
    """Plot panels over time.

    Args:
        panels: label of the axis -> label of the curve -> values (N,). span: (2,) interval to shade [s].
    """
    size = (10, 2.3 * len(panels))
    figure, axes = plt.subplots(len(panels), 1, figsize=size, squeeze=False, sharex=True, layout="constrained")
    for axis, (label, curves) in zip(axes[:, 0], panels.items(), strict=True):
        if span is not None:
            axis.axvspan(*span, color="0.9", label="impulse")
        for color, (name, values) in zip(_COLORS, curves.items(), strict=False):
            axis.plot(time_s, values, color=color, lw=1.0, label=name)
        axis.set_ylabel(label)
        axis.grid(alpha=0.3)
    axes[0, 0].legend(fontsize=8, ncols=3)
    axes[-1, 0].set_xlabel("time [s]")
    save(figure, out)


def plot_gain_map(frequencies: list[str], amplitudes: list[float], ratio: np.ndarray, out: Path) -> None:
    """Plot E_er of ARMAXD over that of ARX, (amplitudes, frequencies); below 1 ARMAXD is better."""
    figure, axis = plt.subplots(figsize=(8.5, 3.6), layout="constrained")
    image = axis.imshow(np.log2(ratio), cmap="RdYlGn_r", vmin=-2.0, vmax=2.0, aspect="auto")
    for (i, j), value in np.ndenumerate(ratio):
        axis.text(j, i, f"{value:.2f}", ha="center", va="center", fontsize=9,
                  color="white" if value < 0.4 else "black")
    axis.set_xticks(range(len(frequencies)), frequencies)
    axis.set_yticks(range(len(amplitudes)), [f"{a:g}" for a in amplitudes])
    axis.set(xlabel="noise frequency [Hz]", ylabel="amplitude / that of §3.4.1", title="E_er of ARMAXD / E_er of ARX")
    bar = figure.colorbar(image, ticks=[-2, -1, 0, 1, 2])
    bar.ax.set_yticklabels(["1/4", "1/2", "1", "2", "4"])
    save(figure, out)
