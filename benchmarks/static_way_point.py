"""Fig. 6.2: the pendulum goes to a way point that stands still, off to its side, with and without trajectory tracker.

Shown are
1. the distance from the straight line to the way point, "position feedback with Jacobian matrix" (our reading: s_e is
   the whole distance) against the trajectory tracker, over the yaw gain K_phi;
2. the same loops on a way point that slides along the square;
3. (6.31) as printed, which sees nothing of a way point straight ahead on the y axis, against the corrected form;
4. how far the heading turns in all, and between which bounds, once the robot is within 0.1 m of the way point.
"""

import numpy as np
from _runs import Job, options, print_json, print_table, run_all, summary, values

import drake_ispace as di
from drake_ispace.blocks.rates import TICK_S
from drake_ispace.control.feedback.balance_gains import balance_gain, linearised
from drake_ispace.control.feedback.dlqr import spectral_radius

LOOPS = {"tracker": "pendulum_multirate", "Jacobian": "pendulum_jacobian_tracking"}
DISTANCE_M, NEAR_M = 0.6, 0.1
STILL = values(pendulum__trajectory__kind="step", pendulum__trajectory__start_s=0.0)
IDEAL = values(
    space__localizer__noise_std_pixels=0.0, space__localizer__whole_pixels=False, pendulum__encoder__counts_per_turn=0,
    pendulum__imu__accelerometer_noise_density=0.0, pendulum__imu__gyro_noise_density=0.0,
    pendulum__plant__friction__coulomb_n_m=0.0, pendulum__plant__friction__viscous_n_m_s=0.0,
    pendulum__control__friction_compensation__enabled=False,
)

ROBOTS = {
    "ideal": IDEAL, "ideal, printed gains": IDEAL + values(pendulum__control__gains="given"), "default": (),
    "default, hold radius 0.3 m": values(pendulum__control__tracker__hold_radius_m=0.3),
    "default, compensation with dead band": values(
        pendulum__control__friction_compensation__dead_band_rad_s=0.1,
        pendulum__control__friction_compensation__speed_scale_rad_s=0.2,
    ),
}  # ideal: no noise, no friction


def outcome(run):
    """How straight the robot went, where it ended, and how it turned near the way point."""
    pose = run.signals["pendulum_pose"]
    start, goal = pose[0, :2], np.array(run.scenario.pendulum.trajectory.goal_m)
    along = (goal - start) / np.linalg.norm(goal - start)
    off_line = np.abs((pose[:, 0] - start[0]) * along[1] - (pose[:, 1] - start[1]) * along[0])
    gap = np.linalg.norm(goal - pose[:, :2], axis=1)
    turning = np.degrees(np.abs(np.diff(pose[:, 2])))
    arrived = int(np.argmax(gap < NEAR_M)) if (gap < NEAR_M).any() else None
    return {
        "max_off_line_m": float(off_line.max()), "rms_off_line_m": float(np.sqrt(np.mean(off_line**2))),
        "final_gap_m": float(gap[-200:].mean()), "turned_deg": float(turning.sum()),
        "arrived_s": None if arrived is None else float(run.time_s[arrived]),
        "turned_after_arrival_deg": None if arrived is None else float(turning[arrived:].sum()),
        "heading_range_after_arrival_deg": None if arrived is None else float(np.degrees(np.ptp(pose[arrived:, 2]))),
        "diverged_s": run.diverged_s,
    }


def trace(run):
    return {"pose": run.signals["pendulum_pose"]}


def scaled_yaw(scale, damped):
    """Own gains with K_phi times `scale`, and the yaw rate's gain times its root where `damped`."""
    settings = di.load_scenario("pendulum_multirate").pendulum
    gain = -balance_gain(settings.plant, settings.control)[0]
    gain[1] *= scale
    gain[4] *= np.sqrt(scale) if damped else 1.0
    return gain


def radius(gain):
    """Spectral radius of the balance loop at 5 ms with the right wheel's printed-sign gains (6,)."""
    left = gain * np.array([1.0, -1.0, 1.0, 1.0, -1.0, 1.0])
    a, b = linearised(di.load_scenario("pendulum_multirate").pendulum.plant)
    return spectral_radius(a, b, -np.vstack([gain, left]), TICK_S)


def yaw_overrides(scale, damped):
    gain = scaled_yaw(scale, damped)
    return values(
        pendulum__control__gains="given", pendulum__control__k_right=list(gain[:2]),
        pendulum__control__f1_right=list(gain[2:]),
    )


def at(degrees):
    return values(
        pendulum__initial_pose=[0, 0, 0],
        pendulum__trajectory__goal_m=[DISTANCE_M * f(np.radians(degrees)) for f in (np.cos, np.sin)],
    )


def sweep_jobs(seed, scales, angles, dampings):
    return [
        Job((degrees, scale, damped, name), loop, values(seed=seed, seconds=20.0) + STILL + at(degrees)
            + yaw_overrides(scale, damped))
        for degrees in angles for scale in scales for damped in dampings for name, loop in LOOPS.items()
    ]


def printed_jobs(seed, robots):
    starts = {"facing y": np.pi / 2.0, "facing x": 0.0}
    return [
        Job((facing, mode, robot), "pendulum_multirate", values(
            seed=seed, seconds=30.0, pendulum__initial_pose=[0, 0, heading], pendulum__control__tracker__mode=mode,
            pendulum__trajectory__goal_m=[0, DISTANCE_M],
        ) + STILL + ROBOTS[robot])
        for facing, heading in starts.items() for mode in ("as_printed", "corrected") for robot in robots
    ]


def main():
    asked = options(__doc__)
    scales, angles, dampings = (0.3, 0.5, 1.0, 2.0, 5.0, 10.0), (90, 120), (True, False)
    if asked.quick:
        scales, angles, dampings = (1.0,) if asked.tiny else (1.0, 5.0), (90,), (True,)
    still = run_all(sweep_jobs(asked.seed, scales, angles, dampings), outcome, asked.at_most_s)
    robots = ("ideal",) if asked.tiny else ("ideal", "default") if asked.quick else ROBOTS
    printed = run_all(printed_jobs(asked.seed, robots), outcome, asked.at_most_s)
    slide = [Job(name, loop, values(seed=asked.seed, seconds=24.0)) for name, loop in LOOPS.items()]
    sliding = {} if asked.quick else run_all(slide, summary)
    cases = list(dict.fromkeys(key[:3] for key in still))
    if asked.figures:
        draw(asked, still, asked.figures / "static_way_point.png")
    if asked.json:
        print_json({
            "seed": asked.seed,
            "still": [
                {"bearing_deg": d, "k_phi_scale": s, "rate_gain_scaled": c, "radius": radius(scaled_yaw(s, c)),
                 **{name: still[d, s, c, name] for name in LOOPS}} for d, s, c in cases
            ],
            "sliding": sliding,
            "printed": [{"start": f, "mode": m, "robot": r, **row} for (f, m, r), row in printed.items()],
        })
        return
    print_table(
        f"A way point that stands still {DISTANCE_M} m away: largest (RMS) distance from the straight line, turning",
        ["bearing", "K_phi", "rate gain", "radius", "tracker", "Jacobian", "turned near: tracker", "range", "Jacobian"],
        [[
            f"{d} deg", f"x {s:g}", "x sqrt" if c else "x 1", f"{radius(scaled_yaw(s, c)):.4f}",
            *(f"{1e3 * still[d, s, c, n]['max_off_line_m']:.1f} ({1e3 * still[d, s, c, n]['rms_off_line_m']:.1f}) mm"
              for n in LOOPS),
            shown(still[d, s, c, "tracker"]["turned_after_arrival_deg"], "deg"),
            shown(still[d, s, c, "tracker"]["heading_range_after_arrival_deg"], "deg"),
            shown(still[d, s, c, "Jacobian"]["turned_after_arrival_deg"], "deg"),
        ] for d, s, c in cases],
    )
    if sliding:
        print_table(
            "A way point that slides along the 1.2 m square", ["loop", "cross-track", "lag", "final gap"],
            [[n, *(f"{1e3 * sliding[n][key]:.1f} mm" for key in ("rms_cross_track_m", "mean_lag_m", "final_error_m"))]
             for n in LOOPS],
        )
    print_table(
        f"(6.31) as printed: way point {DISTANCE_M} m away on the y axis",
        ["start", "tracker", "robot", "ends short by", "within 0.1 m after", "turned from then on", "range"],
        [[
            f, m, r, f"{1e3 * row['final_gap_m']:.0f} mm", shown(row["arrived_s"], "s"),
            shown(row["turned_after_arrival_deg"], "deg"),
            shown(row["heading_range_after_arrival_deg"], "deg"),
        ] for (f, m, r), row in printed.items()],
    )


def shown(value, unit):
    return None if value is None else f"{value:.1f} {unit}"


def draw(asked, still, out):
    from drake_ispace.report.pictures.plots import plt, save

    scale = 1.0
    curves = run_all(sweep_jobs(asked.seed, (scale,), (90, 120), (True,)), trace, asked.at_most_s)
    figure, axes = plt.subplots(1, 2, figsize=(9.5, 4.2), layout="constrained", width_ratios=[1.0, 1.6])
    colours = {"tracker": "#c0392b", "Jacobian": "#2980b9"}
    for degrees in (90, 120):
        goal = DISTANCE_M * np.array([np.cos(np.radians(degrees)), np.sin(np.radians(degrees))])
        axes[0].plot([0, goal[0]], [0, goal[1]], color="0.3", ls="--", lw=1.0)
        axes[0].plot(*goal, "k+", ms=9)
        for name, colour in colours.items():
            pose = curves[degrees, scale, True, name]["pose"]
            axes[0].plot(pose[:, 0], pose[:, 1], color=colour, lw=1.4, label=name if degrees == 90 else None)
    axes[0].set(xlabel="x [m]", ylabel="y [m]", aspect="equal", title="own gains, starting towards +x")
    axes[0].legend(fontsize=8)
    for degrees, marker in ((90, "o"), (120, "s")):
        for name, colour in colours.items():
            rows = sorted((s, row["max_off_line_m"]) for (d, s, c, n), row in still.items()
                          if d == degrees and c and n == name)
            if rows:
                axes[1].loglog([s for s, _ in rows], [1e3 * m for _, m in rows], marker=marker, color=colour, lw=1.2,
                               ls="-" if degrees == 90 else ":", label=f"{name}, {degrees} deg")
    axes[1].set(xlabel="K_phi over its own design (its rate gain grows with the root)",
                ylabel="largest distance from the line [mm]", title="distance from the straight line")
    axes[1].legend(fontsize=8)
    for axis in axes:
        axis.grid(alpha=0.3, which="both")
    save(figure, out)


if __name__ == "__main__":
    main()
