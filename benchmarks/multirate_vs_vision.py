"""Section 6.7.1 and Fig. 6.10: multi-rate control against vision feedback, on the omni robot.

Shown are
1. the spectral radius of both loops, computed from the discrete matrices: vision feedback with its backward difference
   over 95 ms, multi-rate control with the velocity at 5 ms. Above 1 the loop is unstable;
2. runs on a 1 m step and on the 1.2 m square: with the printed gains, with DLQR at each loop's own rate for the printed
   weights and for the default ones, with and without feed-forward;
3. a map of IAE(multi-rate) / IAE(vision feedback) on the step over gain and latency of the Kinect, same gains in both.
"""

import numpy as np
from _runs import Job, options, print_json, print_table, run_all, summary, values

import drake_ispace as di
from drake_ispace.blocks.rates import TICK_S, VISION_S, VISION_TICKS
from drake_ispace.control.feedback.dlqr import spectral_radius, zero_order_hold
from drake_ispace.control.feedback.omni_gains import omni_gains
from drake_ispace.plants.omni import mass_matrix

LOOPS = {"multi-rate": "omni_multirate", "vision": "omni_vision_feedback"}
PRINTED_WEIGHTS = values(omni__control__q=[1.4e4, 1.4e4, 975.0, 17.5e4, 17.55e4, 1e4])  # (6.24)
PRINTED_GAINS = values(omni__control__gains="given")
NO_FEED_FORWARD = values(omni__control__velocity_feed_forward=False, omni__control__acceleration_feed_forward=False)
STEP = values(omni__trajectory__kind="step", omni__trajectory__start_s=0.0)
DESIGNS = {"printed gains": PRINTED_GAINS, "DLQR, printed Q and R": PRINTED_WEIGHTS, "DLQR, default Q and R": ()}
CALM_YAW = "printed gains, yaw by DLQR at 95 ms"
ROOMY = values(space__width_m=6.0, space__depth_m=6.0)  # or a large overshoot takes the robot out of the Kinect's sight
NO_EFFECT, LOST_RAD = 0.03, 0.5  # ratios this near to 1 count as equal; a heading error this large as lost


def vision_radius(mass, k_p, k_d, latency_ticks=0):
    """Spectral radius over 95 ms of one axis under vision feedback, the fix `latency_ticks` late.

    State: place and speed now, places seen before. The force is that of the last fix that has arrived.
    """
    whole, rest = divmod(latency_ticks, VISION_TICKS)
    n = 4 + whole
    seen = np.delete(np.eye(n), 1, axis=0)  # row i: the place seen i fixes ago
    a, b = np.array([[0.0, 1.0], [0.0, 0.0]]), np.array([[0.0], [1.0 / mass]])
    place_and_speed = np.eye(2, n)
    for ticks, age in ((rest, whole + 1), (VISION_TICKS - rest, whole)):
        force = -k_p * seen[age] - k_d * (seen[age] - seen[age + 1]) / VISION_S
        a_d, b_d = zero_order_hold(a, b, ticks * TICK_S)
        place_and_speed = a_d @ place_and_speed + b_d @ force[None]
    return float(np.abs(np.linalg.eigvals(np.vstack([place_and_speed, seen[: n - 2]]))).max())


def multirate_radius(mass, k_p, k_d):
    """Spectral radius over 5 ms of one axis with its velocity measured."""
    a, b = np.array([[0.0, 1.0], [0.0, 0.0]]), np.array([[0.0], [1.0 / mass]])
    return spectral_radius(a, b, np.array([[k_p, k_d]]), TICK_S)


def radii():
    """Design -> gains and spectral radii per loop and axis."""
    found = {}
    for design, overrides in DESIGNS.items():
        robot = di.load_scenario("omni_multirate", overrides).omni
        mass = np.diag(mass_matrix(robot.plant))
        for loop, period_s, radius in (
            ("multi-rate", TICK_S, multirate_radius), ("vision", VISION_S, vision_radius)
        ):
            k_p, k_d = (np.diag(k) for k in omni_gains(robot.plant, robot.control, period_s))
            found[f"{design}, {loop}"] = {
                "k_p_xy": k_p[0], "k_d_xy": k_d[0], "radius_xy": radius(mass[0], k_p[0], k_d[0]),
                "k_p_yaw": k_p[2], "k_d_yaw": k_d[2], "radius_yaw": radius(mass[2], k_p[2], k_d[2]),
            }
    return found


def given(k_p, k_d):
    return values(omni__control__gains="given", omni__control__k_p=list(k_p), omni__control__k_d=list(k_d))


def vision_gains():
    """k_p, k_d (3,) of DLQR at 95 ms, default weights and printed ones."""
    designs = [di.load_scenario("omni_multirate", overrides).omni for overrides in ((), PRINTED_WEIGHTS)]
    return [[np.diag(k) for k in omni_gains(robot.plant, robot.control, VISION_S)] for robot in designs]


def outcome(run):
    """Metrics; a robot that turns away from its fixed heading has lost its yaw loop."""
    result = summary(run)
    yaw = np.abs(run.signals["omni_pose"][:, 2])
    result["largest_yaw_rad"] = float(yaw.max())
    result["lost_at_s"] = float(run.time_s[np.argmax(yaw > LOST_RAD)]) if yaw.max() > LOST_RAD else run.diverged_s
    return result


def traces(run):
    pose = run.signals["omni_pose"]
    return {"t": run.time_s, "x": pose[:, 0], "yaw": pose[:, 2]}


def table_jobs(seed, quick):
    (_, _), (k_p, k_d) = vision_gains()
    designs = DESIGNS | {CALM_YAW: given([2.45, 2.45, k_p[2]], [10.0, 10.0, k_d[2]])}
    common = values(seed=seed, seconds=25.0)
    jobs = []
    for name, loop in LOOPS.items():
        jobs += [Job((f"step, {d}", name), loop, common + STEP + NO_FEED_FORWARD + o) for d, o in designs.items()]
        if quick:
            continue
        jobs += [Job((f"square, {d}", name), loop, common + NO_FEED_FORWARD + o) for d, o in designs.items()]
        jobs += [Job((f"square, {d}, feed-forward", name), loop, common + o) for d, o in DESIGNS.items()]
    return jobs


def map_bases():
    """Name -> k_p, k_d (3,) that the map scales."""
    default, _ = vision_gains()
    return {"printed gains": ([2.45, 2.45, 1.23], [10.0, 10.0, 4.0]), "gains designed for 95 ms": default}


def map_jobs(seed, scales, latencies):
    return [
        Job((base, scale, latency, name), loop, STEP + ROOMY + NO_FEED_FORWARD + values(
            seed=seed, seconds=15.0, space__localizer__latency_ticks=latency,
        ) + given(scale * np.array(k_p), scale * np.array(k_d)))
        for base, (k_p, k_d) in map_bases().items() for scale in scales for latency in latencies
        for name, loop in LOOPS.items()
    ]


def ratio_map(results, base, gains, scales, latencies):
    """For each gain and latency: the ratio (None where a loop was lost), who was lost, and the computed radius."""
    rows, mass = [], np.diag(mass_matrix(di.load_scenario("omni_multirate").omni.plant))
    for scale in scales:
        row = []
        for latency in latencies:
            pair = {name: results[base, scale, latency, name] for name in LOOPS}
            lost = [name for name in LOOPS if pair[name]["lost_at_s"] is not None]
            ratio = None if lost else pair["multi-rate"]["iae_m_s"] / pair["vision"]["iae_m_s"]
            radius = max(
                vision_radius(mass[i], scale * gains[0][i], scale * gains[1][i], latency) for i in range(3)
            )
            row.append({
                "gain_scale": scale, "latency_ticks": latency, "ratio": ratio, "lost": lost, "vision_radius": radius,
            })
        rows.append(row)
    return rows


def verdicts(runs):
    """Case -> who has the smaller IAE, and by how much."""
    found = {}
    for case in dict.fromkeys(case for case, _ in runs):
        pair = {name: runs[case, name] for name in LOOPS}
        lost = [name for name in LOOPS if pair[name]["lost_at_s"] is not None]
        ratio = None if lost else pair["multi-rate"]["iae_m_s"] / pair["vision"]["iae_m_s"]
        if lost:
            winner = "multi-rate" if lost == ["vision"] else "none"
        else:
            winner = "equal" if abs(ratio - 1.0) <= NO_EFFECT else ("multi-rate" if ratio < 1.0 else "vision")
        found[case] = {"winner": winner, "iae_ratio": ratio, "lost": lost}
    return found


def main():
    asked = options(__doc__)
    scales, latencies = (0.1, 0.25, 0.5, 1.0, 2.0, 4.0), (0, 5, 9, 14, 19, 28, 38, 57)
    if asked.quick:
        scales, latencies = (0.5, 1.0), (0, 38)
    if asked.tiny:
        scales = scales[:1]
    computed = radii()
    runs = run_all(table_jobs(asked.seed, asked.quick), outcome, asked.at_most_s)
    mapped = run_all(map_jobs(asked.seed, scales, latencies), outcome, asked.at_most_s)
    maps = {base: ratio_map(mapped, base, gains, scales, latencies) for base, gains in map_bases().items()}
    who = verdicts(runs)
    if asked.figures:
        draw_step(asked, asked.figures / "multirate_vs_vision_step.png")
        draw_map(maps, asked.figures / "multirate_vs_vision_map.png")
    if asked.json:
        print_json({
            "seed": asked.seed, "loops": computed, "verdicts": who, "maps": maps,
            "runs": {case: {name: runs[case, name] for name in LOOPS} for case, _ in runs},
        })
        return
    print_table(
        "Loops as discrete matrices", ["design", "K_p x", "K_d x", "radius x", "K_p yaw", "K_d yaw", "radius yaw"],
        [[name, *(f"{v:.3f}" for v in row.values())] for name, row in computed.items()],
    )
    print_table(
        "Runs", ["case", "loop", "IAE [m s]", "overshoot", "settles", "at the end", "largest yaw", "", "better"],
        [[
            case if name == "multi-rate" else "", name, lost_or(m, f"{m['iae_m_s']:.3f}"),
            lost_or(m, shown(m["overshoot_percent"], "%")), lost_or(m, shown(m["settling_time_s"], " s")),
            lost_or(m, shown(m["time_to_end_s"], " s")), f"{m['largest_yaw_rad']:.3f} rad",
            "" if m["lost_at_s"] is None else f"yaw lost at {m['lost_at_s']:.2f} s",
            who[case]["winner"] if name == "vision" else "",
        ] for (case, name), m in sorted(runs.items(), key=lambda item: list(who).index(item[0][0]))],
    )
    for base, rows in maps.items():
        print_table(
            f"IAE(multi-rate) / IAE(vision) on the step, {base}", ["gain \\ latency", *map(str, latencies)],
            [[row[0]["gain_scale"], *(cell_text(cell) for cell in row)] for row in rows],
        )


def lost_or(metrics, text):
    return None if metrics["lost_at_s"] is not None else text


def shown(value, unit):
    return None if value is None else f"{value:.2f}{unit}"


def cell_text(cell):
    if cell["lost"]:
        return "both lost" if len(cell["lost"]) == 2 else f"{cell['lost'][0]} lost"
    return f"{cell['ratio']:.2f}"


def draw_step(asked, out):
    from drake_ispace.report.pictures.plots import plt, save

    cases = ("step, printed gains", f"step, {CALM_YAW}")
    jobs = [job for job in table_jobs(asked.seed, quick=True) if job.label[0] in cases]
    curves = run_all(jobs, traces, asked.at_most_s)
    names = {
        ("step, printed gains", "multi-rate"): ("multi-rate, printed gains", "#c0392b", "-"),
        ("step, printed gains", "vision"): ("vision, printed gains", "#2980b9", "-"),
        (f"step, {CALM_YAW}", "vision"): ("vision, printed gains, yaw by DLQR at 95 ms", "#27ae60", "--"),
    }
    figure, axes = plt.subplots(1, 2, figsize=(10.0, 3.6), layout="constrained")
    axes[0].axhline(1.0, color="0.2", ls="--", lw=1.0)
    for key, (label, colour, style) in names.items():
        curve = curves[key]
        axes[0].plot(curve["t"], curve["x"], style, color=colour, label=label, lw=1.4)
        axes[1].plot(curve["t"], curve["yaw"], style, color=colour, lw=1.4)
    axes[0].set(title="x: 1 m step", xlabel="time [s]", ylabel="x [m]", xlim=(0, 20), ylim=(-0.05, 1.1))
    axes[1].set(title="yaw, to be held at 0", xlabel="time [s]", ylabel="yaw [rad]", xlim=(0, 2.0), ylim=(-3, 3))
    lost = curves["step, printed gains", "vision"]
    axes[1].plot(lost["t"][-1], lost["yaw"][-1], "x", color="#2980b9", ms=8)
    axes[1].annotate("spins, lost", (lost["t"][-1], lost["yaw"][-1]), xytext=(8, 4), textcoords="offset points",
                     fontsize=8, color="#2980b9")
    axes[0].legend(fontsize=8, loc="lower right")
    for axis in axes:
        axis.grid(alpha=0.3)
    save(figure, out)


def draw_map(maps, out):
    from matplotlib.colors import TwoSlopeNorm

    from drake_ispace.report.pictures.plots import plt, save

    figure, axes = plt.subplots(1, 2, figsize=(11.0, 4.2), layout="constrained")
    for axis, (base, rows) in zip(axes, maps.items(), strict=True):
        ratio = np.array([[np.nan if cell["ratio"] is None else cell["ratio"] for cell in row] for row in rows])
        image = axis.imshow(ratio, origin="lower", cmap="RdBu_r", norm=TwoSlopeNorm(1.0, 0.5, 1.5), aspect="auto")
        for i, row in enumerate(rows):
            for j, cell in enumerate(row):
                text = cell_text(cell).replace(" ", "\n") if cell["lost"] else f"{cell['ratio']:.2f}"
                dark = cell["ratio"] is not None and abs(cell["ratio"] - 1.0) > 0.3
                colour = "0.35" if cell["lost"] else "white" if dark else "black"
                axis.text(j, i, text, ha="center", va="center", fontsize=7, color=colour)
        axis.set_facecolor("0.88")
        axis.set_xticks(range(len(rows[0])), [f"{5 * cell['latency_ticks']}" for cell in rows[0]])
        axis.set_yticks(range(len(rows)), [f"{row[0]['gain_scale']:g}" for row in rows])
        axis.set(title=base, xlabel="latency of the Kinect [ms]", ylabel="K_p and K_d times")
    figure.colorbar(image, ax=axes, label="IAE multi-rate / IAE vision (below 1: multi-rate is better)", extend="both")
    save(figure, out)


if __name__ == "__main__":
    main()
