"""Chapters 3 and 4: error index of ARX, ARMAX, ARMAXD, IV and PEM, friction coefficients, identification on line.

    python benchmarks/identification_table.py [--json] [--quick] [--figures FOLDER]

The servo experiment of section 3.4: printed plant and gains, 20 s, a pulse of 1 m, 2 kHz log, 800 Hz noise of 1 mm and
0.05 rad at phases drawn per seed. E_er is (3.74) with n = 6: [s, theta, u] -> [s'', theta''].
"""

import os
import time
from concurrent.futures import ThreadPoolExecutor

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # BLAS threads slow small products down tenfold

import numba
import numpy as np
from _runs import options, print_json

import drake_ispace as di
from drake_ispace.blocks.messages import WAY_POINT, WHEEL_PAIR
from drake_ispace.blocks.rates import TICK_S, ticks_in
from drake_ispace.control.adaptive import online_identifier
from drake_ispace.sensing.sinusoid_noise import SinusoidNoise
from drake_ispace.thesis import servo_data
from drake_ispace.thesis.friction_coefficients import friction_coefficients
from drake_ispace.thesis.friction_data import (
    following_rollout,
    friction_estimates,
    friction_instruments,
    friction_prediction_error,
    friction_rollout,
    run_recording,
)
from drake_ispace.thesis.methods.armax import armax
from drake_ispace.thesis.methods.armaxd import armaxd
from drake_ispace.thesis.methods.arx import arx, recursive_arx
from drake_ispace.thesis.methods.instrumental import instrumental
from drake_ispace.thesis.servo_data import ACTUAL
from drake_ispace.thesis.structures import error_index, friction_problem

SECONDS, TINY_S, RATE_HZ = 20.0, 3.0, 2000.0
FREQUENCIES = (100.0, 300.0, 500.0, 700.0, 800.0, 900.0, 970.0)
AMPLITUDES = (0.2, 1.0, 5.0)
PRINTED = {"arx": 31.02, "armaxd": 26.5}
TABLE_4_2 = {"arx": (0.0067, 0.0187), "armaxd": (0.0061, 0.0106)}
TRUTH = (0.0061, 0.0106)


def noise(frequency=800.0, share=1.0, white=0.0):
    return SinusoidNoise(frequency, 0.001 * share, 0.05 * share, white)


def index_of(theta):
    return error_index(theta[:3], ACTUAL)


def each(function, seeds):
    with ThreadPoolExecutor(2) as pool:
        return np.array(list(pool.map(function, range(seeds))))


def fewer(seeds):
    """A quarter of them, but two where there are as many."""
    return max(seeds // 4, min(seeds, 2))


def spread(values):
    return {"median": float(np.median(values)), "p05": float(np.quantile(values, 0.05)),
            "p95": float(np.quantile(values, 0.95))}


def servo_table(seeds, seconds):
    """Every method at the thesis's noise: method -> spread of E_er."""
    rollout, plant = servo_data.servo_rollout(), servo_data.plant_rollout()

    def one(seed, filtered, white):
        data = servo_data.servo_data(rollout, seconds, seed, noise(white=white), RATE_HZ)
        problem = data.problem(filtered)
        first = arx(problem)

        def simulate(theta):
            return servo_data.noise_free_regressors(rollout, seconds, RATE_HZ, theta)

        row = [index_of(first.theta), index_of(armax(problem, every=1000).theta),
               index_of(armaxd(problem, every=1000).theta)]
        row.append(index_of(instrumental(problem, simulate=None if filtered else simulate, spread=False).theta))
        pem = servo_data.servo_prediction_error(plant, data, first.theta)
        row += [index_of(servo_data.with_zero_row(pem.theta)), index_of(armaxd(problem, order=1, every=1000).theta),
                index_of(armaxd(problem, order=4, every=1000).theta)]
        small = problem.without("s")
        row += [error_index(np.vstack([np.zeros(2), method(small).theta[:2]]), ACTUAL)
                for method in (arx, lambda p: armaxd(p, every=1000))]
        return row

    names = ("arx", "armax", "armaxd", "iv", "pem", "armaxd, order 1", "armaxd, order 4", "arx, optimised",
             "armaxd, optimised")
    tables = {}
    for label, filtered, white, count in (
        ("as printed", False, 0.0, seeds), ("and white noise of half the amplitude", False, 0.5, fewer(seeds)),
        ("the same, Y filtered from the noisy data", True, 0.5, fewer(seeds)),
    ):
        rows = each(lambda seed, f=filtered, w=white: one(seed, f, w), count)
        tables[label] = {name: spread(rows[:, i]) | {"seeds": count} for i, name in enumerate(names)}
    return tables


def servo_map(seeds, seconds):
    """Median E_er of ARX and of ARMAXD, and how often ARMAXD wins: three arrays (amplitudes, frequencies)."""
    rollout = servo_data.servo_rollout()
    arx_map, armaxd_map, wins = (np.empty((len(AMPLITUDES), len(FREQUENCIES))) for _ in range(3))
    for i, share in enumerate(AMPLITUDES):
        for j, frequency in enumerate(FREQUENCIES):
            def one(seed, frequency=frequency, share=share):
                problem = servo_data.servo_data(rollout, seconds, seed, noise(frequency, share), RATE_HZ).problem()
                return index_of(arx(problem).theta), index_of(armaxd(problem, every=1000).theta)

            rows = each(one, seeds)
            arx_map[i, j], armaxd_map[i, j] = np.median(rows, axis=0)
            wins[i, j] = np.mean(rows[:, 1] < rows[:, 0])
    return arx_map, armaxd_map, wins


def friction_table(seeds):
    """Method -> spread of both coefficients, at the IMU's own noise and at ten times it."""
    tables = {}
    count = max(seeds // 4, min(seeds, 3))
    for label, factor in (("IMU as assumed", 1.0), ("ten times its noise", 10.0)):
        scenario = di.load_scenario("pendulum_friction_excitation", [
            f"pendulum.imu.accelerometer_noise_density={3e-3 * factor}",
            f"pendulum.imu.gyro_noise_density={1.5e-4 * factor}",
        ])
        rollout, follower = friction_rollout(scenario), following_rollout(scenario)
        ticks = ticks_in(scenario.seconds)

        def one(seed, scenario=scenario, rollout=rollout, follower=follower, ticks=ticks):
            recording = run_recording(rollout, scenario, ticks, rollout.with_seed(seed))
            problem = friction_problem(recording)
            simulate = friction_instruments(rollout, scenario, len(problem.target))
            found = friction_estimates(problem, simulate, every=1000)
            rows = {name: friction_coefficients(estimate) for name, estimate in found.items()}
            pem = friction_prediction_error(follower, scenario, recording).theta[:, 0]
            return [*((f.coulomb_n_m, f.viscous_n_m_s) for f in rows.values()), pem]

        rows = each(one, count)
        names = ("arx", "armax", "armaxd", "iv", "pem")
        tables[label] = {
            name: {"coulomb": spread(rows[:, i, 0]), "viscous": spread(rows[:, i, 1]), "seeds": count}
            for i, name in enumerate(names)
        }
    return tables


@numba.njit
def _rest(step, xd, encoder, imu, tilt, torque, memory, forgetting, trace_limit, dead_band, sizes, out, first, ticks):
    for tick in range(first, first + ticks):
        encoder[WHEEL_PAIR.tick] = tick
        step(xd, encoder, imu, tilt, torque, memory, forgetting, trace_limit, dead_band, sizes, out)
        xd[:] = out


def online(idle, rest):
    """The identifier in the loop: convergence from zero, cost of a tick, `idle` ticks without excitation.

    rest: `_rest`, or the function that it is compiled from.
    """
    scenario = di.load_scenario("pendulum_friction_excitation")
    rollout = friction_rollout(scenario)
    ticks = ticks_in(scenario.seconds)
    logs = rollout.run(ticks, rollout.with_seed(0))
    friction = logs["pendulum_friction"]
    within = np.all(np.abs(friction / np.array(TRUTH) - 1.0) < 0.25, axis=1)
    late = np.append(np.flatnonzero(~within), -1).max() + 1  # the first row after the last one outside
    robot = scenario.pendulum
    block = online_identifier.OnlineIdentifier(robot.identifier, robot.encoder.filter_time_constant_s)
    p = block.spec.parameters
    values = [p["memory"], p["forgetting"], p["trace_limit"], p["dead_band_rad_s"], p["sizes"]]
    quiet = np.zeros(7)
    quiet[3] = 9.81
    sources = [np.zeros(5), quiet, np.zeros(4), np.zeros(2)]
    xd = block.spec.discrete_state.copy()
    out = xd.copy()
    rest(online_identifier.step, xd, *sources, *values, out, 0, 10)
    started = time.perf_counter()
    rest(online_identifier.step, xd, *sources, *values, out, 10, idle)
    cost = (time.perf_counter() - started) / idle
    root = xd[online_identifier.ROOT : online_identifier.SCRATCH]
    return {
        "final_coulomb": float(friction[-1, 0]), "final_viscous": float(friction[-1, 1]),
        "within_25_percent_from_s": float(late * TICK_S) if late < len(within) else None,
        "cost_per_tick_us": 1e6 * cost, "idle_ticks": idle, "idle_finite": bool(np.isfinite(xd).all()),
        "idle_trace_of_p": float(root @ root),
    }


def pictures(folder, maps, seconds):
    from drake_ispace.report.pictures.identification_plots import plot_convergence, plot_gain_map, plot_signals

    folder.mkdir(parents=True, exist_ok=True)
    rollout = servo_data.servo_rollout()
    data = servo_data.servo_data(rollout, seconds, 0, noise(), RATE_HZ)
    problem, time_s = data.problem(), np.arange(len(data.torque)) / data.rate_hz
    plot_signals(time_s[::7], {
        "s [m]": {"measured": data.measured[::7, 0], "exact": data.exact[::7, 0], "reference": data.reference[::7]},
        "tilt [rad]": {"measured": data.measured[::7, 1], "exact": data.exact[::7, 1]},
        "u [N m]": {"torque of both wheels": data.torque[::7]},
    }, folder / "servo_data.png")
    plot_convergence({"ARX": recursive_arx(problem, every=40), "ARMAXD": armaxd(problem, every=40)}, seconds,
                     folder / "servo_convergence.png", ACTUAL, rows=3)
    plot_gain_map([f"{f:g}" for f in FREQUENCIES], list(AMPLITUDES), maps[1] / maps[0], folder / "armaxd_gain.png")
    scenario = di.load_scenario("pendulum_friction_excitation")
    rollout = friction_rollout(scenario)
    logs = rollout.run(ticks_in(scenario.seconds), rollout.with_seed(0))
    logs = {name: rows[20:] for name, rows in logs.items()}  # from the first way point on
    t = (20 + np.arange(len(logs["pendulum_pose"]))) * TICK_S
    plot_signals(t, {
        "x [m]": {"position": logs["pendulum_pose"][:, 0], "way point": logs["pendulum_way_point"][:, WAY_POINT.x]},
        "tilt [rad]": {"tilt": logs["pendulum_balance"][:, 0]},
        "torque [N m]": {"right wheel": logs["pendulum_torque"][:, 0]},
        "C_cu [N m]": {"on line": logs["pendulum_friction"][:, 0], "actual": np.full(len(t), TRUTH[0])},
        "C_v [N m s]": {"on line": logs["pendulum_friction"][:, 1], "actual": np.full(len(t), TRUTH[1])},
    }, folder / "friction_identification.png")


def report(servo, maps, friction, live):
    for label, table in servo.items():
        print(f"\nE_er [%], noise {label}")
        for name, row in table.items():
            printed = f"   printed {PRINTED[name]}" if name in PRINTED else ""
            span = f"[{row['p05']:.4f}, {row['p95']:.4f}] over {row['seeds']} seeds"
            print(f"  {name:20} {row['median']:9.4f}  {span}{printed}")
    print("\nmedian E_er [%] of ARX / of ARMAXD / share of seeds ARMAXD wins, by amplitude and frequency [Hz]")
    print("  amplitude" + "".join(f"{f:>20g}" for f in FREQUENCIES))
    for i, share in enumerate(AMPLITUDES):
        cells = (f"{maps[0][i, j]:8.2f}/{maps[1][i, j]:6.2f}/{maps[2][i, j]:4.2f}" for j in range(len(FREQUENCIES)))
        print(f"  {share:9g}" + "".join(cells))
    for label, table in friction.items():
        print(f"\nfriction, {label}: truth {TRUTH[0]} N m, {TRUTH[1]} N m s")
        for name, row in table.items():
            c, v = row["coulomb"], row["viscous"]
            printed = f"   Table 4.2: {TABLE_4_2[name]}" if name in TABLE_4_2 else ""
            print(f"  {name:8} {c['median']:.5f} ({100 * (c['median'] / TRUTH[0] - 1):+.1f} %)  {v['median']:.5f} "
                  f"({100 * (v['median'] / TRUTH[1] - 1):+.1f} %) over {row['seeds']} seeds{printed}")
    print("\nidentifier on line, from zero while the robot balances")
    for key, value in live.items():
        print(f"  {key:26} {value}")


def main():
    asked = options(__doc__)
    seeds, of_map = (1, 1) if asked.tiny else (6, 4) if asked.quick else (200, 200)
    seconds = TINY_S if asked.tiny else SECONDS
    idle, rest = (1000, _rest.py_func) if asked.tiny else (100_000 if asked.quick else 1_000_000, _rest)
    servo, maps = servo_table(seeds, seconds), servo_map(of_map, seconds)
    friction, live = friction_table(seeds), online(idle, rest)
    if asked.figures:
        pictures(asked.figures, maps, seconds)
    if not asked.json:
        report(servo, maps, friction, live)
        return
    print_json({
        "E_er": {name: servo["as printed"][name]["median"] for name in ("arx", "armax", "armaxd", "iv", "pem")},
        "friction": {name: {key: row[key]["median"] for key in ("coulomb", "viscous")}
                     for name, row in friction["IMU as assumed"].items()},
        "servo": servo, "friction_spread": friction,
        "map": {"amplitudes": AMPLITUDES, "frequencies_hz": FREQUENCIES, "arx": maps[0].tolist(),
                "armaxd": maps[1].tolist(), "armaxd_wins": maps[2].tolist()},
        "online": live,
    })


if __name__ == "__main__":
    main()
