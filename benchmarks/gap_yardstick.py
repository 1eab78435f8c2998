"""Is the gap that `explain` prints the gap that a user would measure? Each answer beside plain arithmetic on its runs.

The yardstick shares no code with `explain`: wheels are turned into a path in a few lines of NumPy, and the omni
robot's recorded torque is integrated by Newton's law at 1 ms. It knows the sizes of an answer and nothing else of it.
Runs come from the independent generator of the tests, from a two-wheeled robot with three things hidden at once, and
(--data) from the public OptiOdom, EMPS and REGBOT runs. Closed is 1 - (after^2 - least^2) / (before^2 - least^2); least
is the error of the true model by the same arithmetic, zero where nobody knows it.

    python benchmarks/gap_yardstick.py [--json] [--quick] [--tiny] [--seed SEED] [--data ../shared/data]
"""

import sys
from pathlib import Path

import _drives
import numpy as np
from _runs import options, print_json, print_table

import drake_ispace as di

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from hidden import two_wheels
from hidden.generator import generate

MOTIONS = ("square", "circle", "eight", "back_and_forth")
HIDDEN = {
    "wheel_radius_error": {"share": 0.04}, "track_error": {"share": 0.06}, "camera_scale": {"share": 0.04},
    "camera_latency": {"latency_s": 0.08}, "constant_slip": {"ratio_x": 0.08, "ratio_y": 0.05},
    "encoder_scale": {"share": -0.05}, "viscous_friction": {"coefficient_n_m_s": 0.0015},
    "coulomb_friction": {"torque_n_m": 0.01}, "mass_error": {"share": 0.4}, "inertia_error": {"share": 0.8},
    "torque_gain_error": {"share": -0.3}, "weak_motor": {"wheel": 2, "loss": 0.4}, "soft_floor": {"force_n": 1.0},
    "floor_tilt": {"slope_x_rad": 0.015, "slope_y_rad": -0.01},
    "single_wheel_friction": {"wheel": 1, "torque_n_m": 0.012}, "motor_offset": {"wheel": 2, "offset_n_m": 0.008},
}
GRAVITY = 9.81


def ring(count, radius_m, arm_m, first_rad, toe_rad):
    """(count, 3) turning rates of omni wheels, turned by toe_rad (count,), per velocity of the body."""
    along = first_rad + 2.0 * np.pi * np.arange(count) / count + toe_rad
    return np.column_stack([-np.sin(along), np.cos(along), arm_m * np.cos(toe_rad)]) / radius_m


def two(radius_m, half_track_m):
    """(2, 3) turning rates of two wheels, right then left."""
    return np.array([[1.0, 0.0, half_track_m], [1.0, 0.0, -half_track_m]]) / radius_m


def rates_of(robot: dict, effects: dict):
    """(n, 3) wheel rates per body velocity of the robot that the answer describes."""
    track = 1.0 + effects.get("track_error", {}).get("share", 0.0)
    toe_rad = np.zeros(robot["wheels"])
    if "wheel_toe" in effects:
        toe_rad[int(effects["wheel_toe"]["wheel"]) - 1] = effects["wheel_toe"]["angle_rad"]
    rows = two(robot["radius_m"], track * robot["arm_m"]) if robot["wheels"] == 2 else ring(
        robot["wheels"], robot["radius_m"], track * robot["arm_m"], robot["first_rad"], toe_rad
    )
    larger = np.full(robot["wheels"], 1.0 + effects.get("wheel_radius_error", {}).get("share", 0.0))
    if "single_wheel_radius_error" in effects:
        one = effects["single_wheel_radius_error"]
        larger[int(one["wheel"]) - 1] *= 1.0 + one["share"]
    for name, share in effects.get("wheel_radius_errors", {}).items():
        larger[int(name.removeprefix("share_")) - 1] *= 1.0 + share
    return rows / larger[:, None]


def walk(steps, start):
    """(1 + k, 3) poses after motions in the body's frame, each along the middle of its turn."""
    phi = start[2] + np.concatenate([[0.0], np.cumsum(steps[:, 2])])
    middle = 0.5 * (phi[1:] + phi[:-1])
    x = start[0] + np.concatenate([[0.0], np.cumsum(np.cos(middle) * steps[:, 0] - np.sin(middle) * steps[:, 1])])
    y = start[1] + np.concatenate([[0.0], np.cumsum(np.sin(middle) * steps[:, 0] + np.cos(middle) * steps[:, 1])])
    return np.column_stack([x, y, phi])


def as_seen(t, poses, times, effects):
    """(k, 3) what the camera reports at `times` of a path."""
    late = effects.get("camera_latency", {}).get("latency_s", 0.0)
    late += effects.get("clock_offset", {}).get("offset_s", 0.0)
    at = np.column_stack([np.interp(times - late, t, column) for column in poses.T])
    marker = effects.get("marker_offset", {})
    c, s = np.cos(at[:, 2]), np.sin(at[:, 2])
    at[:, 0] += c * marker.get("x_m", 0.0) - s * marker.get("y_m", 0.0)
    at[:, 1] += s * marker.get("x_m", 0.0) + c * marker.get("y_m", 0.0)
    at[:, 2] += marker.get("yaw_rad", 0.0)
    at[:, :2] *= 1.0 + effects.get("camera_scale", {}).get("share", 0.0)
    return at


def reckoned(run, robot, effects):
    """(k, 3) the dead-reckoned path as the camera would report it at its fixes."""
    encoder = run.channels["encoder"]
    scale = 1.0 + effects.get("encoder_scale", {}).get("share", 0.0)
    kept = np.full(robot["wheels"], scale)
    if "encoder_lost_counts" in effects:
        kept[int(effects["encoder_lost_counts"]["wheel"]) - 1] *= 1.0 - effects["encoder_lost_counts"]["share"]
    steps = np.diff(encoder.values / kept, axis=0) @ np.linalg.pinv(rates_of(robot, effects)).T
    slip = effects.get("constant_slip", {})
    steps[:, 0] *= 1.0 - slip.get("ratio_x", slip.get("ratio", 0.0))
    steps[:, 1] *= 1.0 - slip.get("ratio_y", 0.0)
    outwards = effects.get("cornering_slip", {}).get("time_s", 0.0) * steps[:, 2] / np.diff(encoder.t)
    steps[:, :2] += np.column_stack([outwards * steps[:, 1], -outwards * steps[:, 0]])
    return as_seen(encoder.t, walk(steps, np.zeros(3)), run.channels["kinect"].t, effects)


def seen_from(frames, poses):
    """(k, 3) poses in the frames of others."""
    d, c, s = poses - frames, np.cos(frames[:, 2]), np.sin(frames[:, 2])
    return np.column_stack([c * d[:, 0] + s * d[:, 1], -s * d[:, 0] + c * d[:, 1], d[:, 2]])


def laid_on(path, seen, t):
    """(k, 3) the path, moved and turned so that it begins where the first second of fixes was."""
    first = t <= t[0] + 1.0
    turn = np.angle(np.mean(np.exp(1j * (seen[first, 2] - path[first, 2]))))
    c, s = np.cos(turn), np.sin(turn)
    turned = np.column_stack([c * path[:, 0] - s * path[:, 1], s * path[:, 0] + c * path[:, 1], path[:, 2] + turn])
    return turned + np.append(np.mean(seen[first, :2] - turned[first, :2], axis=0), 0.0)


def squares(run, robot, effects, row):
    """Squared position errors of a run for a row of the gap; None where plain arithmetic does not reach."""
    kinect = run.channels["kinect"]
    t, seen = kinect.t, kinect.values[:, :3]
    seconds = np.inf if row.horizon == "run" else float(row.horizon.removesuffix("s"))
    if row.driven_by == "wheels":
        path = reckoned(run, robot, effects)
        if row.metric == "ATE":
            return np.sum((laid_on(path, seen, t) - seen)[:, :2] ** 2, axis=1)
        pairs = windows(t, seconds)
        moved, truth = (seen_from(p[pairs[:, 0]], p[pairs[:, 1]]) for p in (path, seen))
        return np.sum((moved - truth)[:, :2] ** 2, axis=1)
    if row.driven_by != "torque" or row.metric != "RPE" or robot["name"] != "omni":
        return None
    return np.concatenate([[window(run, robot, effects, i, j)] for i, j in windows(t, seconds) if t[i] >= 1.0])


def windows(t, seconds):
    """(k, 2) fixes that are so far apart, one a second."""
    chosen, free = [], 0.0
    for i in range(len(t)):
        j = int(np.argmin(np.abs(t - t[i] - seconds)))
        if t[i] >= free and abs(t[j] - t[i] - seconds) < 0.05:
            chosen.append((i, j))
            free = t[i] + 1.0
    return np.array(chosen, int).reshape(-1, 2)


def window(run, robot, effects, i, j):
    """Squared position error [m^2] at the fix j of Newton's law from the fix i on the recorded torque."""
    encoder, torque, kinect = (run.channels[name] for name in ("encoder", "torque", "kinect"))
    t, seen = kinect.t, kinect.values
    rates = rates_of(robot, effects)
    near = np.abs(encoder.t - t[i]) < 0.1
    slopes = np.polyfit(encoder.t[near] - t[i], encoder.values[near], 2)[1]
    v = np.linalg.pinv(rates) @ slopes / (1.0 + effects.get("encoder_scale", {}).get("share", 0.0))
    mass = robot["mass_kg"] * (1.0 + effects.get("mass_error", {}).get("share", 0.0))
    inertia = robot["inertia_kg_m2"] * (1.0 + effects.get("inertia_error", {}).get("share", 0.0))
    gains = np.full(4, 1.0 + effects.get("torque_gain_error", {}).get("share", 0.0))
    if "weak_motor" in effects:
        gains[int(effects["weak_motor"]["wheel"]) - 1] *= 1.0 - effects["weak_motor"]["loss"]
    rubbing, offset = np.zeros(4), np.zeros(4)  # of single wheels
    if "single_wheel_friction" in effects:
        one = effects["single_wheel_friction"]
        rubbing[int(one["wheel"]) - 1] = one["torque_n_m"]
    if "motor_offset" in effects:
        one = effects["motor_offset"]
        offset[int(one["wheel"]) - 1] = one["offset_n_m"]
    tilt, pose, h = effects.get("floor_tilt", {}), seen[i, :3].copy(), 1e-3
    slip = effects.get("constant_slip", {})
    for time in np.arange(t[i], t[j], h):
        tau = gains * torque.values[np.searchsorted(torque.t, time + 1e-9) - 1]
        spin = rates @ v
        tau = tau - effects.get("viscous_friction", {}).get("coefficient_n_m_s", 0.0) * spin
        tau = tau - effects.get("coulomb_friction", {}).get("torque_n_m", 0.0) * np.tanh(spin / 0.1)
        tau = tau - rubbing * np.tanh(spin / 0.1) + offset
        force = rates.T @ tau
        c, s = np.cos(pose[2]), np.sin(pose[2])
        fall = -mass * GRAVITY * np.array([tilt.get("slope_x_rad", 0.0), tilt.get("slope_y_rad", 0.0)])
        speed = np.hypot(*v[:2])
        drag = effects.get("soft_floor", {}).get("force_n", 0.0) * v[:2] / np.hypot(speed, 0.01)
        force[:2] += [c * fall[0] + s * fall[1], -s * fall[0] + c * fall[1]] - drag
        a = force / [mass, mass, inertia] + [v[2] * v[1], -v[2] * v[0], 0.0]
        moved = v * [1.0 - slip.get("ratio_x", 0.0), 1.0 - slip.get("ratio_y", 0.0), 1.0]
        pose += h * np.array([c * moved[0] - s * moved[1], s * moved[0] + c * moved[1], v[2]])
        v = v + h * a
    scale = 1.0 + effects.get("camera_scale", {}).get("share", 0.0)
    return float(np.sum(((pose - seen[i, :3])[:2] * scale - (seen[j] - seen[i])[:2]) ** 2))


def judged(name, model, robot, runs, held_out, truth, library=None):
    """What explain prints for a case, and what the yardstick says of the same row."""
    answer = di.explain(model, runs, held_out, library)
    effects = {e.name: {p: value.estimate for p, value in e.parameters.items()} for e in answer.effects}
    row = answer.headline if answer.effects else None
    told = {"case": name, "verdict": answer.verdict, "effects": sorted(effects), "printed": answer.closed}
    if row is None:
        return told
    every = [run for some in (held_out.values() if isinstance(held_out, dict) else [held_out]) for run in some]
    if isinstance(held_out, dict):
        every = held_out[row.kind]
    sums = [[squares(run, robot, sizes, row) for run in every] for sizes in ({}, effects, truth or {})]
    if any(part is None for part in sums[0]):
        return told | {"row": f"{row.metric} {row.horizon} {row.driven_by}"}
    before, after, least = (float(np.mean(np.concatenate(part))) for part in sums)
    least = least if truth else 0.0
    closed = 1.0 - max(after - least, 0.0) / max(before - least, 1e-12)
    return told | {
        "row": f"{row.metric} {row.horizon} {row.driven_by}", "before": row.before, "after": row.after,
        "before_here": before**0.5, "after_here": after**0.5, "closed_here": closed,
        "points": 100.0 * abs(closed - row.closed),
    }


def omni_cases(seed, count):
    scenario = di.load_scenario("omni_multirate")
    plant = scenario.omni.plant
    robot = {"name": "omni", "wheels": 4, "radius_m": plant.wheel_radius_m, "arm_m": plant.wheel_distance_m / 2.0,
             "first_rad": 0.0, "mass_kg": plant.mass_kg, "inertia_kg_m2": plant.inertia_kg_m2}
    for name, values in list(HIDDEN.items())[:count]:
        runs = [generate("omni", motion, {name: values}, 20.0, 10 * seed + i) for i, motion in enumerate(MOTIONS)]
        yield judged(name, scenario, robot, runs[:3], runs[3:], {name: values})


#: Name of a case -> what is other than in the robot with all three.
TWO_WHEELED = {
    "radius, latency and lag": {}, "radius alone": {"late_s": 0.0, "lag_s": 0.0},
    "latency alone": {"left_share": 0.0, "lag_s": 0.0}, "lag alone": {"left_share": 0.0, "late_s": 0.0},
}


def two_wheeled_cases(seed, seconds, names=TWO_WHEELED, library=None, training=3, unseen=2):
    robot = {"name": "two", "wheels": 2, "radius_m": two_wheels.RADIUS_M, "arm_m": two_wheels.HALF_TRACK_M}
    truth = {"single_wheel_radius_error": {"wheel": 2, "share": 0.04}, "camera_latency": {"latency_s": 0.08}}
    for name in names:
        hidden = TWO_WHEELED[name]
        runs = [two_wheels.drive(10 * seed + i, seconds, **hidden) for i in range(training + unseen)]
        own = {key: value for key, value in truth.items()
               if hidden.get({"single_wheel_radius_error": "left_share", "camera_latency": "late_s"}[key], 1.0)}
        yield judged(name, two_wheels.model(), robot, runs[:training], runs[training:], own, library)


def real_cases(data):
    from drake_ispace.files.importers import optiodom

    for name, kinds, robot in (
        ("diff", ("square", "free"), {"name": "diff", "wheels": 2, "radius_m": 0.042, "arm_m": 0.1}),
        ("omni3", ("square", "joystick"), {"name": "omni3", "wheels": 3, "radius_m": 0.051, "arm_m": 0.195,
                                           "first_rad": -np.pi / 3.0}),
    ):
        def runs(kind, name=name):
            return optiodom.load_folder(data / "optiodom" / name / kind)

        yield judged(f"OptiOdom {name}", f"optiodom_{name}", robot, runs("circular")[:4], {k: runs(k) for k in kinds},
                     None)


def drives(data):
    """The same for drives of one's own. Nobody knows their true model: noise is what `explain` says it is."""
    for name, model, runs, held_out, effects, by_hand in _drives.cases(data):
        answer = di.explain(model, runs, held_out, effects)
        sizes = {e.name: {p: value.estimate for p, value in e.parameters.items()} for e in answer.effects}
        row, plant = answer.headline, {p.name: (p.before, p.after) for p in answer.plant}
        told = {"case": name, "verdict": answer.verdict, "effects": sorted(sizes), "printed": answer.closed}
        if row is not None:
            before, after = (
                np.mean(np.concatenate([by_hand(run, own, {p: pair[k] for p, pair in plant.items()}).ravel()
                                        for run in held_out[row.kind]]) ** 2) for k, own in enumerate(({}, sizes))
            )
            least = row.sensors**2 + row.chance**2
            closed = 1.0 - max(after - least, 0.0) / max(before - least, 1e-12)
            told |= {
                "row": f"{row.metric} {row.horizon} {row.driven_by}", "before": row.before, "after": row.after,
                "before_here": before**0.5, "after_here": after**0.5, "closed_here": closed,
                "points": 100.0 * abs(closed - row.closed),
            }
        yield told


def main():
    asked = options(__doc__, data={"type": Path, "help": "folder of the public measurements; left out: not used"})
    if asked.tiny:
        library = [di.effects()["single_wheel_radius_error"]]
        cases = list(two_wheeled_cases(asked.seed, 6.0, ["radius alone"], library, 2, 1))
    else:
        cases = [*omni_cases(asked.seed, 3 if asked.quick else None), *two_wheeled_cases(asked.seed, 30.0)]
    if asked.data is not None:
        cases += [*real_cases(asked.data), *drives(asked.data)]
    compared = [case for case in cases if "points" in case]
    near = sum(bool(case["points"] <= 10.0) for case in compared)
    summary = {"answers": len(cases), "printed": sum(case["printed"] is not None for case in cases),
               "compared": len(compared), "within_10_points": near}
    if asked.json:
        print_json({"cases": cases, **summary})
        return
    print_table("The printed gap beside plain arithmetic", [
        "case", "verdict", "effects", "row", "before [m]", "after [m]", "before, by hand", "after, by hand", "closed",
        "by hand", "points apart"], [[
            case["case"], case["verdict"], ", ".join(case["effects"]), case.get("row"),
            *(f"{case[key]:.4f}" if key in case else None for key in ("before", "after", "before_here", "after_here")),
            None if case["printed"] is None else f"{case['printed']:.3f}",
            f"{case['closed_here']:.3f}" if "closed_here" in case else None,
            f"{case['points']:.1f}" if "points" in case else None,
        ] for case in cases])
    print(", ".join(f"{key.replace('_', ' ')}: {value}" for key, value in summary.items()))


if __name__ == "__main__":
    main()
