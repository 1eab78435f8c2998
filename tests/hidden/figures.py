"""Pictures of a campaign: which name each hidden effect is given, and from what size on it is found.

    PYTHONPATH=tests python -m hidden.figures --records records.jsonl --out docs/pictures
"""

import argparse
from collections.abc import Sequence
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

from hidden.campaign import load
from hidden.effect_sizes import TYPICAL_UNKNOWN, effects_of
from hidden.summary import clear, is_detected, is_inside, judged, returned

_NOTHING, _UNKNOWN = "none missing", "unknown"
_INK, _FOUND, _RIGHT = "#333333", "#c98a1b", "#1f6f8b"
_TITLES = {"omni": "omnidirectional robot", "pendulum": "inverted pendulum"}


def answers(record: dict) -> dict[str, float]:
    """Answer -> share of this record: one over all names that were returned."""
    if record["verdict"] == "none":
        return {_NOTHING: 1.0}
    if record["verdict"] == "unknown":
        return {_UNKNOWN: 1.0}
    names = returned(record) | ({_UNKNOWN} if record["verdict"] == "incomplete" else set())
    return dict.fromkeys(names, 1.0 / len(names))


def confusion(records: Sequence[dict], robot: str) -> tuple[np.ndarray, list[str], list[str]]:
    """(shares (truths, answers), truths, answers): effects that are clear, nothing, and effects out of the library."""
    own = [r for r in records if r.get("robot") == robot]
    judgeable = [*clear(own), *judged(own, "none"), *[r for r in judged(own, "unknown") if is_detected(r)]]
    columns = [*effects_of(robot), _NOTHING, _UNKNOWN]
    wanted = [*effects_of(robot), "none", *TYPICAL_UNKNOWN[robot]]
    tried = {r["name"] for r in judgeable}
    truths = [name for name in wanted if name in tried]
    shares = np.zeros((len(truths), len(columns)))
    for record in judgeable:
        for name, share in answers(record).items():
            shares[truths.index(record["name"]), columns.index(name)] += share
    shares /= np.maximum(shares.sum(axis=1, keepdims=True), 1e-12)
    return shares, truths, columns


def draw_confusion(records: Sequence[dict], path: Path) -> None:
    """Both robots side by side."""
    robots = sorted({r["robot"] for r in records})
    figure, axes = plt.subplots(1, len(robots), figsize=(11.0 * len(robots), 11.5), layout="constrained", squeeze=False)
    for ax, robot in zip(axes[0], robots, strict=True):
        shares, truths, columns = confusion(records, robot)
        ax.imshow(shares, cmap="Blues", vmin=0.0, vmax=1.0, aspect="auto")
        ax.set_xticks(range(len(columns)), [_words(c) for c in columns], rotation=90, fontsize=9)
        labels = [_words(t) + (" (not in the library)" if t in TYPICAL_UNKNOWN[robot] else "") for t in truths]
        ax.set_yticks(range(len(truths)), labels, fontsize=9)
        for (row, column), share in np.ndenumerate(shares):
            if share > 0.005:
                ink = "white" if share > 0.6 else _INK
                ax.text(column, row, f"{100 * share:.0f}", ha="center", va="center", fontsize=7, color=ink)
        ax.set_xticks(np.arange(-0.5, len(columns)), minor=True)
        ax.set_yticks(np.arange(-0.5, len(truths)), minor=True)
        ax.grid(which="minor", color="#e6e6e6", linewidth=0.6)
        ax.tick_params(which="both", length=0)
        ax.spines[:].set_visible(False)
        ax.set_title(f"{_TITLES[robot]}: share of answers [%]", fontsize=13)
        ax.set_ylabel("hidden")
        ax.set_xlabel("answer (several names count in equal parts)")
    _save(figure, path)


def draw_detection(records: Sequence[dict], path: Path) -> None:
    """Shares of effects found, and found under their name, against their size and against detectability."""
    robots = sorted({r["robot"] for r in records})
    figure, axes = plt.subplots(2, len(robots), figsize=(5.2 * len(robots), 7.2), layout="constrained", squeeze=False)
    for column, robot in enumerate(robots):
        own = [r for r in judged(records, "effect") if r["robot"] == robot]
        nothing = [r for r in judged(records, "none") if r["robot"] == robot]
        top, bottom = axes[0, column], axes[1, column]
        factors = sorted({r["factor"] for r in own})
        groups = [nothing, *[[r for r in own if r["factor"] == factor] for factor in factors]]
        _curves(top, [0.0, *factors], groups)
        top.set_title(_TITLES[robot], fontsize=11)
        top.set_xlabel("size, of the typical one")
        edges = np.array([0.0, 3.0, 4.0, 5.0, 7.0, 10.0, 15.0, 25.0, 50.0])
        bins = [[r for r in own if low <= r["detectability"] < high]
                for low, high in zip(edges, [*edges[1:], np.inf], strict=True)]
        filled = [(low, group) for low, group in zip(edges, bins, strict=True) if group]
        _curves(bottom, [np.median([r["detectability"] for r in group]) for _, group in filled],
                [group for _, group in filled])
        bottom.axvline(5.0, color=_INK, linewidth=0.7, linestyle=":")
        bottom.set_xscale("symlog", linthresh=5.0)
        bottom.set_xlim(0.0, None)
        bottom.set_xlabel("detectability, as the runs show it [standard deviations]")
        for ax in (top, bottom):
            ax.set_ylim(-9.0, 104.0)
            ax.spines[["top", "right"]].set_visible(False)
            ax.grid(axis="y", color="#e6e6e6", linewidth=0.6)
            ax.set_ylabel("share of diagnoses [%]")
    axes[0, 0].legend(frameon=False, loc="lower right")
    _save(figure, path)


def _curves(ax, places, groups):
    shares = lambda is_so: [100.0 * np.mean([is_so(r) for r in group]) if group else np.nan for group in groups]  # noqa: E731
    ax.plot(places, shares(is_detected), "o-", color=_FOUND, label="something found")
    right = shares(is_inside)
    ax.plot(places, right, "s-", color=_RIGHT, label="the true name, alone or in the set")
    for place, share, group in zip(places, right, groups, strict=True):
        if group:
            ax.annotate(f"{len(group)}", (place, share), (0, -11), textcoords="offset points", ha="center", fontsize=7)


def _words(name):
    return name.replace("_", " ")


def _save(figure, path):
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=80)
    plt.close(figure)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--records", type=Path, nargs="+", required=True)
    parser.add_argument("--out", type=Path, required=True, help="folder")
    chosen = parser.parse_args()
    records = [record for path in chosen.records for record in load(path)]
    draw_confusion(records, chosen.out / "hidden_confusion.png")
    draw_detection(records, chosen.out / "hidden_detection.png")


if __name__ == "__main__":
    main()
