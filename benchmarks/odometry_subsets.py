"""Does `explain` choose effects and sizes of odometry as well as trying every subset by plain least squares?

Subsets of {common radius or the radius of each wheel, track, marker, latency, slip} are fitted to the training runs:
dead reckoning in a few lines of NumPy (gap_yardstick.py), errors over 1 s, 5 s and whole runs. `chosen` is the subset
that predicts each training run best from the others; `oracle` the one that is best on the unseen runs, which nobody
could choose. Errors are ATE of unseen runs; ratios with 90 % intervals by drawing these runs anew. Without --data a
two-wheeled robot is simulated; with it the robots are OptiOdom's.

    python benchmarks/odometry_subsets.py [--json] [--quick] [--tiny] [--seed SEED] [--data ../shared/data]
"""

import functools
import itertools
import sys
from pathlib import Path

import numpy as np
from _runs import options, print_json, print_table
from gap_yardstick import laid_on, reckoned, seen_from, windows
from scipy.optimize import least_squares

import drake_ispace as di

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from hidden import two_wheels

_OMNI3 = {"name": "omni3", "wheels": 3, "radius_m": 0.051, "arm_m": 0.195, "first_rad": -np.pi / 3.0}
_DIFF = {"name": "diff", "wheels": 2, "radius_m": 0.042, "arm_m": 0.1}
_TWO = {"name": "two", "wheels": 2, "radius_m": two_wheels.RADIUS_M, "arm_m": two_wheels.HALF_TRACK_M}


def groups_of(robot):
    """Every choice of parameters, as tuples of (effect, parameter)."""
    n = robot["wheels"]
    each = tuple(("wheel_radius_errors", f"share_{i + 1}") for i in range(n))
    slip = (("constant_slip", "ratio_x"), ("constant_slip", "ratio_y")) if n > 2 else (("constant_slip", "ratio"),)
    return [
        ((), (("wheel_radius_error", "share"),), each), ((), (("track_error", "share"),)),
        ((), tuple(("marker_offset", key) for key in ("x_m", "y_m", "yaw_rad"))),
        ((), (("camera_latency", "latency_s"),)), ((), slip),
    ]


def effects_at(names, z):
    """Effect -> parameter -> value."""
    found = {}
    for (effect, parameter), value in zip(names, z, strict=True):
        found.setdefault(effect, {})[parameter] = float(value)
    return found


@functools.cache
def pairs_of(stamps):
    """Fixes that are 1 s and 5 s apart, by their stamps."""
    return [windows(np.array(stamps), seconds) for seconds in (1.0, 5.0)]


def errors_of(run, robot, effects):
    """Errors (k, 2) [m] of the whole run, and over 1 s and 5 s from measured poses."""
    kinect = run.channels["kinect"]
    t, seen, path = kinect.t, kinect.values[:, :3], reckoned(run, robot, effects)
    found = [(laid_on(path, seen, t) - seen)[:, :2]]
    for pairs in pairs_of(tuple(t.tolist())):
        moved, truth = (seen_from(p[pairs[:, 0]], p[pairs[:, 1]]) for p in (path, seen))
        found.append((moved - truth)[:, :2])
    return found


def fit(runs, robot, names, weights):
    """Coordinates fitted to all runs, and the mean squared weighted error of each run when fitted to the others."""
    def by_run(z):
        return [np.concatenate([w * e.ravel() / np.sqrt(e.size) for w, e in zip(
            weights, errors_of(run, robot, effects_at(names, z)), strict=True)]) for run in runs]

    if not names:
        return np.empty(0), float(np.mean([np.sum(part**2) for part in by_run([])]))
    best = least_squares(lambda z: np.concatenate(by_run(z)), np.zeros(len(names)), x_scale=0.01, max_nfev=20)
    ends = np.cumsum([len(part) for part in by_run(best.x)])[:-1]
    normal, gradient, left = best.jac.T @ best.jac, best.jac.T @ best.fun, []
    for i, (jac, fun) in enumerate(zip(np.split(best.jac, ends), np.split(best.fun, ends), strict=True)):
        z = best.x - np.linalg.lstsq(normal - jac.T @ jac, gradient - jac.T @ fun, rcond=None)[0]
        left.append(np.sum(by_run(z)[i] ** 2))
    return best.x, float(np.mean(left))


def squares_of(runs, robot, effects):
    """(runs, 2) sum and number of squared errors of whole runs."""
    parts = [np.sum(errors_of(run, robot, effects)[0] ** 2, axis=1) for run in runs]
    return np.array([[part.sum(), len(part)] for part in parts])


def rms(squares):
    return float(np.sqrt(squares[..., 0].sum(axis=-1) / squares[..., 1].sum(axis=-1)))


def ratio(ours, theirs, generator):
    """[ratio, lower end, upper end] of errors, over draws of the runs."""
    draws = [generator.integers(0, len(ours), len(ours)) for _ in range(1000)]
    ratios = [rms(ours[rows]) / rms(theirs[rows]) for rows in draws]
    return [rms(ours) / rms(theirs), *map(float, np.quantile(ratios, [0.05, 0.95]))]


def compared(model, robot, training, held_out, seed, groups, library=None):
    """A row for every kind of unseen runs; groups: as `groups_of`; library: effects to choose from, default all."""
    answer = di.explain(model, training, held_out, library)
    effects = {e.name: {p: value.estimate for p, value in e.parameters.items()} for e in answer.effects}
    nominal = [errors_of(run, robot, {}) for run in training]
    weights = [1.0 / np.sqrt(np.mean(np.concatenate([e[k] for e in nominal]) ** 2)) for k in range(3)]
    subsets = {}
    for choice in itertools.product(*groups):
        names = tuple(itertools.chain(*choice))
        subsets[names] = fit(training, robot, names, weights)
    chosen = min(subsets, key=lambda names: subsets[names][1])
    rows, generator = [], np.random.default_rng(seed)
    for kind, runs in held_out.items():
        tried = {names: squares_of(runs, robot, effects_at(names, z)) for names, (z, _) in subsets.items()}
        oracle, ours = min(tried, key=lambda names: rms(tried[names])), squares_of(runs, robot, effects)
        rows.append({
            "robot": robot["name"], "runs": kind, "verdict": answer.verdict, "effects": sorted(effects),
            "nominal_m": rms(squares_of(runs, robot, {})), "explain_m": rms(ours), "chosen_m": rms(tried[chosen]),
            "oracle_m": rms(tried[oracle]), "chosen": sorted({e for e, _ in chosen}),
            "oracle": sorted({e for e, _ in oracle}), "to_chosen": ratio(ours, tried[chosen], generator),
            "to_oracle": ratio(ours, tried[oracle], generator), "seconds": answer.seconds,
        })
    return rows


def main():
    asked = options(__doc__, data={"type": Path, "help": "folder of the public measurements; left out: simulated"})
    if asked.data is None:
        model = di.load_scenario("velocity_base", [
            "rover.plant.wheels=differential", f"rover.plant.radius_m={two_wheels.RADIUS_M}",
            f"rover.plant.half_track_m={two_wheels.HALF_TRACK_M}",
        ])
        seconds, hidden, last = (6.0, {"late_s": 0.0}, 3) if asked.tiny else (30.0, {}, 5)
        runs = [two_wheels.drive(10 * asked.seed + i, seconds, lag_s=0.0, **hidden) for i in range(last)]
        groups, library, training = groups_of(_TWO), None, 3
        if asked.tiny:
            groups, training = groups[:2], 2
            library = [di.effects()["single_wheel_radius_error"]]
        rows = compared(model, _TWO, runs[:training], {"unseen": runs[training:]}, asked.seed, groups, library)
    else:
        from drake_ispace.files.importers import optiodom

        rows = []
        for robot, kinds in ((_DIFF, ("square", "free")), (_OMNI3, ("square", "joystick"))):
            folder = asked.data / "optiodom" / robot["name"]
            training = optiodom.load_folder(folder / "circular")[:: 3 if asked.quick else 1]
            held_out = {kind: optiodom.load_folder(folder / kind) for kind in kinds}
            rows += compared(f"optiodom_{robot['name']}", robot, training, held_out, asked.seed, groups_of(robot))
    if asked.json:
        print_json({"rows": rows})
        return
    print_table("ATE of unseen runs in metres, explain beside subsets by plain least squares", [
        "robot", "runs", "verdict", "effects", "nominal", "explain", "chosen", "oracle", "to chosen", "to oracle"], [[
            row["robot"], row["runs"], row["verdict"], ", ".join(row["effects"]),
            *(f"{row[f'{key}_m']:.4f}" for key in ("nominal", "explain", "chosen", "oracle")),
            *("{:.2f} [{:.2f}, {:.2f}]".format(*row[key]) for key in ("to_chosen", "to_oracle")),
        ] for row in rows])


if __name__ == "__main__":
    main()
