"""The demonstration: an effect hidden and found, both robots driven through the space, compared, drawn, on one page."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np

from drake_ispace.blocks.messages import WAY_POINT
from drake_ispace.comparison import compare
from drake_ispace.files.places import check_own_folder, fresh_folder
from drake_ispace.metrics import Metrics
from drake_ispace.report.hidden_effect import write_hidden_effect
from drake_ispace.report.pages import render, write_text
from drake_ispace.report.pictures.drawing import draw
from drake_ispace.report.pictures.plots import plot_comparison, plt, save
from drake_ispace.scenario import load_scenario, with_option
from drake_ispace.wiring.catalog import CATALOG, build_diagram

_COMPARISONS = (
    (
        "omni_square", "The omni robot on a square",
        "Multi-rate control estimates the pose every 5 ms and corrects it with every fix; vision feedback acts on the "
        "fix alone; conventional multi-rate mixes fix and raw odometry. Way point at 0.25 m/s, 10 % slip.",
        ("omni_multirate", "omni_vision_feedback", "omni_conventional_multirate"), ["omni.trajectory.kind=square"],
    ),
    (
        "pendulum_circle", "The inverted pendulum on a circle",
        "It balances at 5 ms on encoders and IMU; way point and trajectory tracker live in the room and act every 95 "
        "ms. Look-ahead 0.2 m, which is most of the lag; friction compensated.",
        ("pendulum_multirate", "pendulum_vision_feedback", "pendulum_jacobian_tracking"),
        ["pendulum.trajectory.kind=circle"],
    ),
    (
        "omni_step", "What the position estimator is for (Fig. 6.11)",
        "A 1 m step on carpet that adds 130 % to every movement. With the estimator the robot comes to rest at the "
        "reference, without it where the raw odometry takes it.",
        ("omni_multirate", "omni_conventional_multirate"),
        ["omni.trajectory.kind=step", "omni.plant.slip.frame=additive", "omni.plant.slip.ratio=[1.3, 1.3, 1.3]",
         "space.width_m=6", "space.depth_m=6", "omni.control.gains=given"],
    ),
    (
        "shared_space", "Both robots under one Kinect",
        "The omni robot circles, the pendulum drives a square around it.",
        ("shared_space",),
        ["omni.trajectory.kind=circle", "omni.trajectory.radius_m=0.35", "pendulum.trajectory.side_m=1.5"],
    ),
)


def write_demo(
    out: Path, seconds: float | None, seed: int | None, progress: Callable[[str], None]
) -> tuple[Path, dict]:
    """Run the whole demonstration and write `out`/index.html with its pictures.

    Args:
        out: folder. seconds: duration of each run that is compared, default the scenario's. seed: default 0.
            progress: called with the name of each step.

    Returns:
        The path of the page, and the numbers on it.

    Raises:
        InputError: seconds or seed out of range, or a folder that cannot be written or holds something else.
    """
    check_own_folder(out, "a demonstration")
    sections, numbers, simulated_s, wall_s = [], {}, 0.0, 0.0
    seed = seed or 0
    comparisons = {key: [_scenario(name, overrides, seconds, seed) for name in names]
                   for key, _, _, names, overrides in _COMPARISONS}
    # Files are made in a folder beside and moved at the end, so that the page never shows pictures of another run.
    with fresh_folder(out, "a demonstration") as fresh:
        explained, answer = write_hidden_effect(fresh, seed, progress)
        for key, title, text, names, _ in _COMPARISONS:
            progress(title)
            results = compare(dict(zip(names, comparisons[key], strict=True)))
            if len(comparisons[key]) == 1:
                _plot_shared(results, fresh / f"{key}.png")
            else:
                plot_comparison({name: (run, robot) for name, (run, robot, _) in results.items()}, fresh / f"{key}.png")
            for name, (_, _, metrics) in results.items():
                numbers[f"{key}/{name}"] = metrics.to_data()
            runs = {id(run): run for run, _, _ in results.values()}.values()  # two robots may share one
            simulated_s += sum(float(run.time_s[-1]) for run in runs)
            wall_s += sum(run.wall_s for run in runs)
            rows = [_row(name, metrics) for name, (_, _, metrics) in results.items()]
            sections.append({"title": title, "text": text, "rows": rows, "picture": f"{key}.png", "wiring": False})
        for name in ("omni_multirate", "pendulum_multirate"):
            progress(f"drawing {name}")
            draw(build_diagram(load_scenario(name)), fresh / f"{name}.svg")
            sections.append({
                "title": f"The wiring of {name}", "text": "Every box is a LeafSystem; drawn from the Diagram itself.",
                "rows": [], "picture": f"{name}.svg", "wiring": True,
            })
        space = load_scenario("omni_multirate").space
        data = {"explained": answer, "runs": numbers, "simulated_s": simulated_s, "wall_s": wall_s, "seed": seed}
        write_text(fresh / "demo.json", json.dumps(data, indent=2, allow_nan=False))
        write_text(fresh / "index.html", render(
            "demo.html.j2", sections=sections, width=space.width_m, depth=space.depth_m, simulated_s=simulated_s,
            wall_s=wall_s, seed=seed, explained=explained,
        ))
    return out / "index.html", data


def _scenario(name, overrides, seconds, seed):
    slip = [f"{robot}.plant.slip.ratio=[0.1, 0.1, 0.1]" for robot in CATALOG["shared_space"].robots]
    scenario = with_option(load_scenario(name, slip + overrides), "seed", seed)
    return scenario if seconds is None else with_option(scenario, "seconds", seconds)


def _row(name: str, metrics: Metrics) -> dict:
    def millimetres(value):
        return "–" if value is None else f"{1e3 * value:.1f} mm"

    return {
        "name": name, "rms": millimetres(metrics.rms_position_error_m), "cross": millimetres(metrics.rms_cross_track_m),
        "lag": millimetres(metrics.mean_lag_m), "final": millimetres(metrics.final_error_m),
        "end": "–" if metrics.time_to_end_s is None else f"{metrics.time_to_end_s:.2f} s",
        "lost": f"lost at {metrics.diverged_at_s:.2f} s" if metrics.diverged else "",
    }


def _plot_shared(results, out):
    figure, axis = plt.subplots(figsize=(8, 6.4), layout="constrained")
    run = next(iter(results.values()))[0]
    width, depth = run.scenario.space.width_m, run.scenario.space.depth_m
    axis.add_patch(plt.Rectangle((-width / 2, -depth / 2), width, depth, fill=False, ls=":", ec="0.6"))
    for (_, robot, _), colour in zip(results.values(), ("#2980b9", "#c0392b"), strict=True):
        way_point, pose = run.signals[f"{robot}_way_point"], run.signals[f"{robot}_pose"]
        shown = way_point[:, WAY_POINT.tick] >= 0.0
        axis.plot(way_point[shown, WAY_POINT.x], way_point[shown, WAY_POINT.y], "--", color="0.5", lw=1)
        axis.plot(pose[:, 0], pose[:, 1], color=colour, label=robot)
        for row in np.linspace(0, len(pose) - 1, 12).astype(int):
            x, y, phi = pose[row]
            axis.annotate("", (x + 0.09 * np.cos(phi), y + 0.09 * np.sin(phi)), (x, y),
                          arrowprops={"arrowstyle": "->", "color": colour})
    axis.set(xlabel="x [m]", ylabel="y [m]", aspect="equal")
    axis.grid(alpha=0.3)
    axis.legend(loc="upper right")
    save(figure, out)
