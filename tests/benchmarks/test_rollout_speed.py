"""The C written by hand does what its Diagram does; benchmarks/rollout_speed.py gives finite ratios."""

import json
import math
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from drake_ispace.blocks.rates import MAX_TICK
from drake_ispace.rollout.compile import compile_diagram
from drake_ispace.scenario import load_scenario
from drake_ispace.wiring.catalog import build_diagram

FOLDER = Path(__file__).parents[2] / "benchmarks"
TICKS = 2000
RELATIVE = {"omni": 0.0, "pendulum": 1e-12}  # the pendulum's wheels turn by 30 rad, of which a double knows 4e-15
_COMMON = {
    "noise alone": {},
    "a push": {"plant.ground_force[0]": 0.2, "plant.ground_force[1]": 0.1, "plant.ground_force[2]": 0.01},
    "smooth friction": {
        "plant.friction.coulomb": 0.005, "plant.friction.speed_scale": 1.0, "plant.friction.viscous": 1e-4,
    },
    "bristles": {"plant.friction.bristle": 1.0, "plant.friction.coulomb": 0.005},
    "slip in bends": {"plant.slip.cornering_s": 0.1},
    "traction": {f"plant.slip.traction_gain_{axis}": 0.2 for axis in ("x", "y", "yaw")},
    "lagged traction": {f"plant.slip.traction_gain_{axis}": 0.2 for axis in ("x", "y", "yaw")}
    | {"plant.slip.relaxation_length_m": 0.1},
    "a driver that lags": {"actuator.memory": 0.5, "actuator.noise_std_n_m": 0.001},
    "a link that loses": {"link.loss": 0.3},
}
#: What a run without it would not show: robot -> name -> parameters away from where they do nothing.
AWAY = {
    "omni": _COMMON | {
        "centre of gravity": {"plant.centre_of_gravity_m[0]": 0.02, "plant.centre_of_gravity_m[1]": -0.03},
        "wheels": {"plant.wheels[0]": 1.0, "plant.wheels[4]": -2.0, "plant.wheels[8]": 9.0},
    },
    "pendulum": _COMMON | {
        "wheels of two radii": {"plant.radius_m[0]": 0.081, "plant.body.m12": 1e-3, "plant.body.m23": -1e-3},
        "wheels that turn with a part of the body": {"plant.body.kappa": 0.9, "odometry.body_share": 0.9},
        "a slope, and the IMU above the axle": {
            "plant.slope_rad[0]": 0.02, "plant.slope_rad[1]": -0.01, "plant.imu_height_m": 0.1,
        },
        "slip on the axes of the room": {"plant.slip.frame": 1.0},
        "a gyro with a bias": {"imu.bias[4]": 0.01},
        "no look-ahead": {"tracker.mode": 2.0},
        "the tracker as printed": {"tracker.mode": 1.0},
    },
}


@pytest.fixture(scope="module")
def robots():
    return {robot: compiled(robot) for robot in AWAY}


def compiled(robot):
    noisy = [f"{robot}.plant.slip.{key}=[0.1,0.1,0.1]" for key in ("ratio", "noise_std")]
    diagram = build_diagram(load_scenario(f"{robot}_multirate", noisy))
    return compile_diagram(diagram, log={diagram.get_output_port(0).get_name(): MAX_TICK})


@pytest.fixture(scope="module")
def builds(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(FOLDER)
        from rollout_speed.hand_written import OPTIONS, HandWritten
    folder = tmp_path_factory.mktemp("c")
    try:
        return {
            robot: [HandWritten(f"{robot}_multirate", words, folder) for words in OPTIONS.values()] for robot in AWAY
        }
    except FileNotFoundError as error:
        pytest.skip(str(error))


@pytest.mark.parametrize(("robot", "case"), [(robot, case) for robot, cases in AWAY.items() for case in cases])
def test_a_robot_in_c_ends_where_the_compiled_diagram_does(robots, builds, robot, case):
    rollout = robots[robot]
    parameters = rollout.with_parameters({f"{robot}_{name}": value for name, value in AWAY[robot][case].items()})
    x, d = rollout.continuous_state.copy(), rollout.discrete_state.copy()
    logs = [np.zeros((TICKS // divisor + 1, size)) for size, divisor in rollout.logged.values()]
    rollout._function(0, TICKS, x, d, parameters, np.empty((0, 0)), *logs)
    for build in builds[robot]:
        final = build.run(TICKS, rollout.continuous_state, rollout.discrete_state, parameters)[1]
        assert final == pytest.approx(np.concatenate([x, d]), rel=RELATIVE[robot], abs=1e-12)


@pytest.mark.slow
def test_the_quick_benchmark_gives_finite_ratios():
    words = [sys.executable, FOLDER / "rollout_speed.py", "--quick", "--json"]
    results = json.loads(subprocess.run(words, capture_output=True, text=True, check=True).stdout)
    assert set(results) == {
        "compiled_vs_drake", "compiled_vs_c", "horizon", "robots", "threads_2_vs_1", "lanes_vs_single", "lanes_vs_c",
        "peers", "compile_s", "second_process_s",
    }
    ratios = [results[name]["ratio"] for name in ("horizon", "robots", "threads_2_vs_1")]
    for name in ("compiled_vs_drake", "compiled_vs_c", "lanes_vs_single", "lanes_vs_c"):
        ratios += [entry["ratio"] for entry in results[name].values()]
    ratios += [entry["ratio"] for entry in results["peers"].values() if "skipped" not in entry]
    assert all(math.isfinite(ratio) and ratio > 0.0 for ratio in ratios)
    for entry in results["compiled_vs_c"].values():  # the C does what the Diagram does
        assert max(entry["largest_difference"].values()) <= 1e-12
