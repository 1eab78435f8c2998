"""Section 6.7.2 and Fig. 6.11: wheel slip with and without position estimator, omni robot, 1 m step.

The conventional loop feeds back raw odometry between two fixes (our reading of the thesis's words); the estimator (6.6)
carries the last fix on by odometry. Slip is constant on the robot's axes (s < 1: the robot travels (1 - s) of what its
wheels do), constant and additive ((6.5) taken literally: (1 + s) of it, the only reading in which the thesis's s = 1.3
makes sense), or drawn at every tick. The final error is the mean over the last second, its maximum beside it.
"""

import numpy as np
from _runs import Job, options, print_json, print_table, run_all, values

LOOPS = {"estimator": "omni_multirate", "conventional": "omni_conventional_multirate"}
GOAL_M = 1.0
REACHED_M = 0.005
STEP = values(omni__trajectory__kind="step", omni__trajectory__goal_m=[GOAL_M, 0], omni__trajectory__start_s=0.0)
ROOMY = values(space__width_m=6.0, space__depth_m=6.0)  # the thesis's 2.5 m would hide an overshoot to 2.15 m
PRINTED = values(
    omni__control__gains="given", omni__control__velocity_feed_forward=False,
    omni__control__acceleration_feed_forward=False,
)


def cases(quick):
    """(kind, s) -> overrides and simulated time [s]."""
    body = (0.0, 0.3) if quick else (0.0, 0.1, 0.2, 0.3, 0.4, 0.5)
    additive = (1.3,) if quick else (0.1, 0.3, 0.6, 1.0, 1.3)
    noise = () if quick else (0.1, 0.3, 1.0)
    found = {("constant", s): (slip(s, "body"), 20.0) for s in body}
    found |= {("additive", s): (slip(s, "additive"), 20.0) for s in additive}
    found |= {("random", s): (values(omni__plant__slip__noise_std=[s] * 3), 20.0) for s in noise}
    if not quick:
        found |= {("random, mean 0.2", s): (values(omni__plant__slip__noise_std=[s] * 3) + slip(0.2, "body"), 20.0)
                  for s in noise}
        found |= {("additive, printed gains", s): (PRINTED + slip(s, "additive"), 40.0) for s in (0.0, 1.3)}
    return found


def slip(s, frame):
    return values(omni__plant__slip__ratio=[s] * 3, omni__plant__slip__frame=frame)


def jobs(seed, found):
    return [
        Job((*case, name), loop, values(seed=seed, seconds=seconds) + STEP + ROOMY + overrides)
        for case, (overrides, seconds) in found.items() for name, loop in LOOPS.items()
    ]


def outcome(run):
    pose = run.signals["omni_pose"]
    gap = np.hypot(pose[-200:, 0] - GOAL_M, pose[-200:, 1])
    return {
        "final_x_m": float(pose[-200:, 0].mean()), "final_error_m": float(gap.mean()),
        "largest_final_error_m": float(gap.max()), "reached": bool(gap.max() < REACHED_M and run.diverged_s is None),
        "diverged_s": run.diverged_s,
    }


def trace(run):
    return {"t": run.time_s, "x": run.signals["omni_pose"][:, 0]}


def main():
    asked = options(__doc__)
    found = cases(asked.quick)
    results = run_all(jobs(asked.seed, found), outcome, asked.at_most_s)
    if asked.figures:
        draw(asked, results, asked.figures / "estimator_vs_slip.png")
    if asked.json:
        print_json({"seed": asked.seed, "runs": [
            {"slip": kind, "s": s, **{name: results[kind, s, name] for name in LOOPS}} for kind, s in found
        ]})
        return
    print_table(
        "1 m step: final error, mean (largest) over the last second",
        ["slip", "s", *(f"{name}{what}" for name in LOOPS for what in ("", ": stops at", ""))],
        [[kind, f"{s:g}", *(text for name in LOOPS for text in row(results[kind, s, name]))] for kind, s in found],
    )


def row(result):
    mean, largest = 1e3 * result["final_error_m"], 1e3 * result["largest_final_error_m"]
    return f"{mean:.1f} ({largest:.1f}) mm", f"{result['final_x_m']:.4f} m", "reached" if result["reached"] else "NOT"


def draw(asked, results, out):
    from drake_ispace.report.pictures.plots import plt, save

    shown = {("printed gains", s): (PRINTED + slip(s, "additive"), 20.0) for s in (0.0, 1.3)}
    curves = run_all(jobs(asked.seed, shown), trace, asked.at_most_s)
    figure, axes = plt.subplots(1, 2, figsize=(10.5, 3.9), layout="constrained")
    colours = {"estimator": "#c0392b", "conventional": "#2980b9"}
    axes[0].axhline(GOAL_M, color="0.2", ls="--", lw=1.0, label="reference")
    for (_, s, name), curve in curves.items():
        width = 3.0 if s == 0.0 and name == "estimator" else 1.5  # without slip both curves are the same
        axes[0].plot(
            curve["t"], curve["x"], "-" if s else ":", color=colours[name], lw=width, label=f"{name}, s = {s:g}"
        )
    axes[0].set(xlabel="time [s]", ylabel="x [m]", title="1 m step, additive slip, printed gains (Fig. 6.11)")
    axes[0].legend(fontsize=8, loc="lower right")
    for name, colour in colours.items():
        for kind, marker in (("constant", "o"), ("additive", "s")):
            rows = sorted((s, 1e3 * r["final_error_m"]) for (k, s, n), r in results.items() if k == kind and n == name)
            axes[1].semilogy(
                *zip(*rows, strict=True), "-" if kind == "constant" else ":", marker=marker, color=colour, lw=1.2,
                label=f"{name}, {kind} slip",
            )
    axes[1].axhline(1e3 * REACHED_M, color="0.5", lw=1.0, ls="--")
    axes[1].text(1.3, 1e3 * REACHED_M, "5 mm", ha="right", va="bottom", fontsize=8, color="0.4")
    axes[1].set(xlabel="slip s", ylabel="final error [mm]", title="final error, own gains")
    axes[1].legend(fontsize=8, loc="center right")
    for axis in axes:
        axis.grid(alpha=0.3)
    save(figure, out)


if __name__ == "__main__":
    main()
