"""Figs. 6.12-6.14: both robots follow a 1.2 m square and a circle of 0.6 m radius at 0.25 m/s, under 10 % wheel slip.

Shown are
1. for each control law, from the printed one to the default, the RMS distance from the path (cross-track), the mean lag
   behind the way point, and how far odometry alone would have been off; the median and the worst of some seeds;
2. the lag of the omni robot as printed on a long run;
3. the pendulum at rest: how far it swings to and fro under Coulomb friction, by friction model and compensation.
"""

from statistics import median

import numpy as np
from _runs import Job, options, print_json, print_table, run_all, summary, values

from drake_ispace.blocks.messages import ESTIMATE, WAY_POINT

PATHS = {"square": 24.0, "circle": 20.0}
OMNI_SLIP, PENDULUM_SLIP = (values(**{f"{r}__plant__slip__ratio": [0.1] * 3}) for r in ("omni", "pendulum"))
NO_ACCELERATION = values(omni__control__acceleration_feed_forward=False)
NO_FEED_FORWARD = values(omni__control__velocity_feed_forward=False) + NO_ACCELERATION
OMNI_PRINTED, PENDULUM_PRINTED = values(omni__control__gains="given"), values(pendulum__control__gains="given")
AS_PRINTED = values(pendulum__control__tracker__mode="as_printed")
NO_COMPENSATION = values(pendulum__control__friction_compensation__enabled=False)
WIDE = values(
    pendulum__control__friction_compensation__dead_band_rad_s=0.1,
    pendulum__control__friction_compensation__speed_scale_rad_s=0.2,
)  # compensation that waits until the wheels turn
COMPENSATIONS = {
    "none": NO_COMPENSATION, "default": (), "dead band 0.1 rad/s": WIDE,
    **{f"Coulomb part x {share}": values(pendulum__control__friction_compensation__coulomb_n_m=0.0061 * share)
       for share in (3, 6)},
}
OMNI, PENDULUM = "omni, default", "pendulum, default"
LAWS = {
    "omni, as printed": ("omni_multirate", OMNI_SLIP + OMNI_PRINTED + NO_FEED_FORWARD),
    "omni, printed gains, velocity fed forward": ("omni_multirate", OMNI_SLIP + OMNI_PRINTED + NO_ACCELERATION),
    "omni, own gains, no feed-forward": ("omni_multirate", OMNI_SLIP + NO_FEED_FORWARD),
    "omni, own gains, velocity fed forward": ("omni_multirate", OMNI_SLIP + NO_ACCELERATION),
    OMNI: ("omni_multirate", OMNI_SLIP),
    "pendulum, as printed": ("pendulum_multirate", PENDULUM_SLIP + PENDULUM_PRINTED + AS_PRINTED),
    "pendulum, as printed, no compensation":
        ("pendulum_multirate", PENDULUM_SLIP + PENDULUM_PRINTED + AS_PRINTED + NO_COMPENSATION),
    "pendulum, printed gains, corrected tracker": ("pendulum_multirate", PENDULUM_SLIP + PENDULUM_PRINTED),
    "pendulum, own gains, no look-ahead":
        ("pendulum_multirate", PENDULUM_SLIP + values(pendulum__control__tracker__look_ahead_m=0.0)),
    PENDULUM: ("pendulum_multirate", PENDULUM_SLIP),
    "pendulum, default, compensation with dead band": ("pendulum_multirate", PENDULUM_SLIP + WIDE),
    "pendulum, default, no compensation": ("pendulum_multirate", PENDULUM_SLIP + NO_COMPENSATION),
}
QUICK = ("omni, as printed", OMNI, "pendulum, as printed", PENDULUM)
KEYS = ("rms_cross_track_m", "mean_lag_m", "odometry_end_m", "odometry_most_m")
REST_S = 10.0


def outcome(run):
    """Metrics, and how far odometry's pose is from the true one when the way point stops, and at most until then."""
    result, robot = summary(run), run.robots[0]
    trajectory = getattr(run.scenario, robot).trajectory
    way_point = run.signals[f"{robot}_way_point"]
    moving = np.flatnonzero(np.linalg.norm(way_point[:, WAY_POINT.vx : WAY_POINT.vy + 1], axis=1) > 0.0)
    stop = int(moving[-1]) if len(moving) else len(way_point) - 1
    believed = run.signals[f"{robot}_odometry"][1:, ESTIMATE.x : ESTIMATE.y + 1]
    off = np.linalg.norm(believed - run.signals[f"{robot}_pose"][:-1, :2], axis=1)
    result |= {"odometry_end_m": float(off[stop - 1]), "odometry_most_m": float(off[:stop].max())}
    return result | {"laps": trajectory.laps}


def swing(run):
    """Peak-to-peak of the last 10 s: along the robot's heading, in tilt, and where that is around."""
    rows = run.time_s > run.time_s[-1] - REST_S
    x, tilt = run.signals["pendulum_pose"][rows, 0], run.signals["pendulum_balance"][rows, 0]
    goal = run.scenario.pendulum.trajectory.goal_m[0]
    return {
        "position_swing_m": float(np.ptp(x)), "tilt_swing_deg": float(np.degrees(np.ptp(tilt))),
        "mean_offset_m": float(abs(x.mean() - goal)), "diverged_s": run.diverged_s,
    }


def tracking_jobs(seeds, laws):
    return [
        Job((path, law, seed), LAWS[law][0], LAWS[law][1] + values(
            seed=seed, seconds=seconds, omni__trajectory__kind=path, pendulum__trajectory__kind=path,
        )) for path, seconds in PATHS.items() for law in laws for seed in seeds
    ]


def long_jobs(seed):
    common = values(seed=seed, seconds=120.0, omni__trajectory__laps=6) + OMNI_PRINTED + NO_FEED_FORWARD
    straight = values(
        seconds=40.0, space__width_m=12.0, omni__trajectory__kind="line", omni__trajectory__centre_m=[-4.8, 0],
        omni__trajectory__goal_m=[4.8, 0],
    )
    return [
        Job("six laps of the square", "omni_multirate", common),
        Job("six laps of the square, 10 % slip", "omni_multirate", common + OMNI_SLIP),
        Job("a straight line of 9.6 m", "omni_multirate", common + straight),
    ]


def rest_jobs(seeds, models, compensations):
    return [
        Job((model, name, seed), "pendulum_multirate", COMPENSATIONS[name] + values(
            seed=seed, seconds=60.0, pendulum__trajectory__kind="step", pendulum__trajectory__goal_m=[0.3, 0],
            pendulum__plant__friction__model=model,
        )) for model in models for name in compensations for seed in seeds
    ]


def spread(rows, keys):
    """key -> median and worst of the seeds."""
    return {key: {"median": median(r[key] for r in rows), "worst": max(r[key] for r in rows)} for key in keys}


def main():
    asked = options(__doc__)
    seeds = range(asked.seed, asked.seed + (1 if asked.quick else 3))
    laws = QUICK if asked.quick else tuple(LAWS)
    runs = run_all(tracking_jobs(seeds, laws), outcome, asked.at_most_s)
    tracking = [
        {"path": path, "law": law, "diverged": sum(runs[path, law, s]["diverged"] for s in seeds),
         **spread([runs[path, law, s] for s in seeds], KEYS)} for path in PATHS for law in laws
    ]
    long_runs = {} if asked.quick else run_all(long_jobs(asked.seed), outcome)
    models, compensations = ("smooth", "elastoplastic"), ("none", "default") if asked.quick else tuple(COMPENSATIONS)
    if asked.tiny:
        models, compensations = models[:1], compensations[:1]
    rests = run_all(rest_jobs(seeds, models, compensations), swing, asked.at_most_s)
    resting = []
    for model in models:
        for name in compensations:
            rows = [rests[model, name, seed] for seed in seeds]
            resting.append({
                "friction": model, "compensation": name, "fallen": sum(row["diverged_s"] is not None for row in rows),
                **spread(rows, ("position_swing_m", "tilt_swing_deg", "mean_offset_m")),
            })
    if asked.figures:
        draw_paths(asked, asked.figures / "tracking_paths.png")
    if asked.json:
        print_json({"seeds": list(seeds), "tracking": tracking, "resting": resting, "long_runs": long_runs})
        return
    print_table(
        f"Tracking under 10 % slip, {len(seeds)} seeds: median (worst)",
        ["path", "law", "cross-track", "lag", "odometry off at the end", "at most", ""],
        [[row["path"], row["law"], *(millimetres(row[key]) for key in KEYS), "lost" if row["diverged"] else ""]
         for row in tracking],
    )
    if long_runs:
        print_table(
            "Omni robot as printed, long runs", ["", "cross-track", "mean lag", "largest distance to the way point"],
            [[name, *(f"{m[key]:.3f} m" for key in ("rms_cross_track_m", "mean_lag_m", "max_position_error_m"))]
             for name, m in long_runs.items()],
        )
    print_table(
        f"Pendulum at rest, peak to peak over the last {REST_S:g} s of 60 s: median (worst)",
        ["friction", "compensation", "position", "tilt", "mean offset", ""],
        [[row["friction"], row["compensation"], millimetres(row["position_swing_m"]),
          f"{row['tilt_swing_deg']['median']:.2f} ({row['tilt_swing_deg']['worst']:.2f}) deg",
          millimetres(row["mean_offset_m"]), "fallen" if row["fallen"] else ""] for row in resting],
    )


def millimetres(pair):
    return f"{1e3 * pair['median']:.1f} ({1e3 * pair['worst']:.1f}) mm"


def trace(run):
    robot = run.robots[0]
    odometry = run.signals[f"{robot}_odometry"]
    start = 1 + np.argmax(odometry[:, ESTIMATE.tick] >= 0.0)
    return {"pose": run.signals[f"{robot}_pose"], "odometry": odometry[start:, ESTIMATE.x : ESTIMATE.y + 1]}


def draw_paths(asked, out):
    from drake_ispace.control.guide.paths import Trajectory, build_path
    from drake_ispace.report.pictures.plots import plt, save

    pairs = {"omni": ("omni, as printed", OMNI), "pendulum": ("pendulum, as printed", PENDULUM)}
    laws = [law for pair in pairs.values() for law in pair]
    curves = run_all(tracking_jobs([asked.seed], laws), trace, asked.at_most_s)
    figure, axes = plt.subplots(1, 4, figsize=(13.0, 3.7), layout="constrained")
    cells = [(robot, path) for robot in pairs for path in PATHS]
    for axis, (robot, path) in zip(axes, cells, strict=True):
        printed, default = (curves[path, law, asked.seed] for law in pairs[robot])
        axis.plot(*build_path(Trajectory(kind=path), "path").points_m.T, color="0.2", ls="--", lw=1.0, label="path")
        axis.plot(*default["odometry"].T, color="#8e44ad", lw=0.9, label="default: odometry alone")
        axis.plot(*printed["pose"][:, :2].T, color="#2980b9", lw=1.2, label="as printed")
        axis.plot(*default["pose"][:, :2].T, color="#c0392b", lw=1.4, label="default")
        axis.set(title=f"{robot}, {path}", xlabel="x [m]", aspect="equal", xlim=(-1.0, 1.0), ylim=(-1.0, 1.0))
        axis.grid(alpha=0.3)
    axes[0].set_ylabel("y [m]")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=4, fontsize=8)
    save(figure, out)


if __name__ == "__main__":
    main()
