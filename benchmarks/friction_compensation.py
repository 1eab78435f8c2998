"""Figs. 4.4 and 4.5: a push on both wheels from 1.2 to 1.6 s under each friction compensation.

    python benchmarks/friction_compensation.py [--json] [--quick] [--figures FOLDER]

Integrals of |position| and |tilt| from 1.2 to 10 s, their ratios to no compensation, what is left at rest, and whether
a run tells that its compensation is too large.
"""

import numpy as np
from _runs import options, print_json

import drake_ispace as di
from drake_ispace.blocks.rates import TICK_S, ticks_in
from drake_ispace.control.feedback.balance_gains import balance_gain, linearised
from drake_ispace.control.feedback.dlqr import zero_order_hold
from drake_ispace.thesis.friction_coefficients import friction_coefficients, over_compensated
from drake_ispace.thesis.friction_data import friction_rollout, run_recording, silence
from drake_ispace.thesis.methods.arx import arx
from drake_ispace.thesis.structures import friction_problem

TRUTH = (0.0061, 0.0106)
CASES = {
    "none": (0.0, 0.0), "ARX (Table 4.2)": (0.0067, 0.0187), "ARMAXD (Table 4.2) = true": TRUTH,
    "half of true": (0.5 * TRUTH[0], 0.5 * TRUTH[1]), "1.5 x true": (1.5 * TRUTH[0], 1.5 * TRUTH[1]),
}
START_S, END_S = 1.2, 1.6


def parameters(rollout, coulomb, viscous, seed=None):
    values = rollout.parameters if seed is None else rollout.with_seed(seed)
    values = values.copy()
    values[rollout.index("pendulum_compensator.coulomb_n_m")] = coulomb
    values[rollout.index("pendulum_compensator.viscous_n_m_s")] = viscous
    return values


def integrals(logs):
    """(integral of |x| [m s], integral of |tilt| [rad s], largest |x| [m]) from the impulse on."""
    rows = slice(ticks_in(START_S), None)
    x, tilt = logs["pendulum_pose"][rows, 0], logs["pendulum_balance"][rows, 0]
    return np.abs(x).sum() * TICK_S, np.abs(tilt).sum() * TICK_S, np.abs(x).max()


def responses(seeds):
    """case -> medians over seeds of the integrals and their ratios to no compensation."""
    scenario = di.load_scenario("pendulum_friction_compensation")
    rollout, adaptive = friction_rollout(scenario), di.load_scenario(
        "pendulum_friction_compensation", ["pendulum.adaptation.enabled=true"])
    adapting, ticks = friction_rollout(adaptive), ticks_in(scenario.seconds)
    rows, curves = {}, {}
    for name, (coulomb, viscous) in CASES.items():
        logs = [rollout.run(ticks, parameters(rollout, coulomb, viscous, seed)) for seed in range(seeds)]
        rows[name], curves[name] = np.array([integrals(log) for log in logs]), logs[0]
    logs = [adapting.run(ticks, adapting.with_seed(seed)) for seed in range(seeds)]
    rows["adaptive, from zero"], curves["adaptive, from zero"] = np.array([integrals(log) for log in logs]), logs[0]
    base = np.median(rows["none"], axis=0)
    table = {}
    for name, values in rows.items():
        x, tilt, peak = np.median(values, axis=0)
        table[name] = {"iae_position_m_s": x, "iae_tilt_rad_s": tilt, "peak_position_m": peak,
                       "position_ratio": x / base[0], "tilt_ratio": tilt / base[1]}
    return table, curves


def at_rest(seconds=40.0):
    """case -> peak to peak of position and tilt in the last 10 s without a push, with encoder counts: without noise
    (quiet), IMU as assumed (noisy), without noise and with a dead band of 0.1 rad/s, the sign faded over 0.2 (wide). A
    tilt of 5 mrad starts it."""
    table = {}
    scenario = di.load_scenario(
        "pendulum_friction_compensation", ["pendulum.impulse.torque_n_m=0", "pendulum.initial_tilt_rad=0.005"])
    rollout, ticks = friction_rollout(scenario), ticks_in(seconds)
    for name, (coulomb, viscous) in CASES.items():
        row, wide = {}, silence(rollout, parameters(rollout, coulomb, viscous))
        wide[rollout.index("pendulum_compensator.dead_band_rad_s")] = 0.1
        wide[rollout.index("pendulum_compensator.speed_scale_rad_s")] = 0.2
        for label, values in (("quiet", silence(rollout, parameters(rollout, coulomb, viscous))),
                              ("noisy", parameters(rollout, coulomb, viscous, 0)), ("wide", wide)):
            logs = rollout.run(ticks, values)
            late = slice(ticks - ticks_in(10.0), None)
            row[f"{label}_position_mm"] = 1e3 * np.ptp(logs["pendulum_pose"][late, 0])
            row[f"{label}_tilt_mrad"] = 1e3 * np.ptp(logs["pendulum_balance"][late, 0])
        table[name] = row
    return table


def detection(seeds):
    """multiple of the truth that is compensated -> share of runs that say so, from a run that drives back and forth."""
    scenario = di.load_scenario("pendulum_friction_excitation", ["pendulum.control.friction_compensation.enabled=true"])
    rollout, ticks = friction_rollout(scenario), ticks_in(scenario.seconds)
    table = {}
    for multiple in (0.5, 1.0, 1.5, 2.0):
        coulomb, viscous = multiple * TRUTH[0], multiple * TRUTH[1]
        verdicts = []
        for seed in range(seeds):
            recording = run_recording(rollout, scenario, ticks, parameters(rollout, coulomb, viscous, seed))
            found = friction_coefficients(arx(friction_problem(recording)))
            verdicts.append(over_compensated(found, coulomb, viscous))
        table[f"{multiple:g}"] = {
            "said_over": float(np.mean([v["over"] for v in verdicts])),
            "coulomb_ratio": float(np.median([v["coulomb_ratio"] for v in verdicts])),
            "viscous_ratio": float(np.median([v["viscous_ratio"] for v in verdicts])),
        }
    return table


def linear_limit():
    """The multiple of true *viscous* friction beyond which its compensation makes the linear loop unstable."""
    scenario = di.load_scenario("pendulum_friction_compensation")
    a, b = linearised(scenario.pendulum.plant)
    gain, plant = balance_gain(scenario.pendulum.plant, scenario.pendulum.control), scenario.pendulum.plant
    r, h = plant.wheel_radius_m, plant.half_track_m
    wheels = np.array([[0, 0, 0, 1 / r, h / r, -1.0], [0, 0, 0, 1 / r, -h / r, -1.0]])
    for multiple in np.arange(1.0, 30.0, 0.05):
        a_d, b_d = zero_order_hold(a - b @ (TRUTH[1] * wheels), b, TICK_S)
        if np.abs(np.linalg.eigvals(a_d - b_d @ (gain - multiple * TRUTH[1] * wheels))).max() > 1.0:
            return round(float(multiple), 2)
    return None


def picture(curves, folder):
    from drake_ispace.report.pictures.identification_plots import plot_signals

    folder.mkdir(parents=True, exist_ok=True)
    shown = {name: curves[name] for name in ("none", "ARX (Table 4.2)", "ARMAXD (Table 4.2) = true", "1.5 x true",
                                             "adaptive, from zero")}
    t = np.arange(len(curves["none"]["pendulum_pose"])) * TICK_S
    plot_signals(t, {
        "torque, right [N m]": {n: c["pendulum_torque"][:, 0] for n, c in shown.items()},
        "x [m]": {n: c["pendulum_pose"][:, 0] for n, c in shown.items()},
        "tilt [rad]": {n: c["pendulum_balance"][:, 0] for n, c in shown.items()},
    }, folder / "friction_compensation.png", (START_S, END_S))


def main():
    asked = options(__doc__)
    table, curves = responses(1 if asked.tiny else 5 if asked.quick else 200)
    data = {
        "response": table, "rest": at_rest(), "viscous_limit": linear_limit(),
        "over_compensation": detection(1 if asked.tiny else 2 if asked.quick else 20),
    }
    if asked.figures:
        picture(curves, asked.figures)
    if asked.json:
        print_json(data)
        return
    print("push of 0.05 N m on both wheels, 1.2 to 1.6 s; medians")
    for name, row in table.items():
        print(f"  {name:28} IAE x {row['iae_position_m_s']:.4f} m s ({row['position_ratio']:.2f})  IAE tilt "
              f"{row['iae_tilt_rad_s']:.4f} rad s ({row['tilt_ratio']:.2f}) peak {1e3 * row['peak_position_m']:.0f} mm")
    print("at rest, last 10 of 40 s, peak to peak: without noise (counts on) | IMU as assumed | dead band 0.1 rad/s")
    for name, row in data["rest"].items():
        print(f"  {name:26} {row['quiet_position_mm']:.2f} mm {row['quiet_tilt_mrad']:.2f} mrad | "
              f"{row['noisy_position_mm']:.2f} mm {row['noisy_tilt_mrad']:.2f} mrad | "
              f"{row['wide_position_mm']:.2f} mm {row['wide_tilt_mrad']:.2f} mrad")
    print("over-compensation found from a run that drives")
    for multiple, row in data["over_compensation"].items():
        print(f"  {multiple:>4} x true: said too large in {100 * row['said_over']:.0f} % of runs, used / found "
              f"{row['coulomb_ratio']:.2f} Coulomb, {row['viscous_ratio']:.2f} viscous")
    print(f"viscous compensation makes the linear loop unstable beyond {data['viscous_limit']} x true")


if __name__ == "__main__":
    main()
