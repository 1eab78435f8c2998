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
#: What a run without it would not show: name -> parameters of the plant away from where they do nothing.
AWAY = {
    "noise alone": {},
    "centre of gravity": {"centre_of_gravity_m[0]": 0.02, "centre_of_gravity_m[1]": -0.03},
    "a push": {"ground_force[0]": 0.2, "ground_force[1]": 0.1, "ground_force[2]": 0.01},
    "wheels": {"wheels[0]": 1.0, "wheels[4]": -2.0, "wheels[8]": 9.0},
    "smooth friction": {"friction.coulomb": 0.005, "friction.speed_scale": 1.0, "friction.viscous": 1e-4},
    "bristles": {"friction.bristle": 1.0, "friction.coulomb": 0.005},
    "slip in bends": {"slip.cornering_s": 0.1},
    "traction": {f"slip.traction_gain_{axis}": 0.2 for axis in ("x", "y", "yaw")},
    "lagged traction": {f"slip.traction_gain_{axis}": 0.2 for axis in ("x", "y", "yaw")}
    | {"slip.relaxation_length_m": 0.1},
}


@pytest.fixture(scope="module")
def omni():
    noisy = ["omni.plant.slip.ratio=[0.1,0.1,0.1]", "omni.plant.slip.noise_std=[0.1,0.1,0.1]"]
    diagram = build_diagram(load_scenario("omni_multirate", noisy))
    return compile_diagram(diagram, log={diagram.get_output_port(0).get_name(): MAX_TICK})


@pytest.fixture(scope="module")
def by_hand(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(FOLDER)
        from rollout_speed.hand_written import OPTIONS, HandWritten
    try:
        return [HandWritten("omni_multirate", of, tmp_path_factory.mktemp("c")) for of in OPTIONS.values()]
    except FileNotFoundError as error:
        pytest.skip(str(error))


@pytest.mark.parametrize("case", AWAY)
def test_the_omni_robot_in_c_ends_where_the_compiled_diagram_does(omni, by_hand, case):
    parameters = omni.with_parameters({f"omni_plant.{name}": value for name, value in AWAY[case].items()})
    x, d = omni.continuous_state.copy(), omni.discrete_state.copy()
    logs = [np.zeros((TICKS // divisor + 1, size)) for size, divisor in omni.logged.values()]
    omni._function(0, TICKS, x, d, parameters, np.empty((0, 0)), *logs)
    for build in by_hand:
        final = build.run(TICKS, omni.continuous_state, omni.discrete_state, parameters)[1]
        assert final == pytest.approx(np.concatenate([x, d]), rel=0.0, abs=1e-12)


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
