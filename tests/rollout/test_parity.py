"""Drake's Simulator and the compiled rollout agree to the bit, every output, every tick."""

import hypothesis
import hypothesis.strategies as st
import numpy as np
import pytest

from drake_ispace.rollout.engine import parity, simulate_compiled
from drake_ispace.scenario import load_scenario
from drake_ispace.simulation import simulate
from drake_ispace.wiring.catalog import CATALOG
from noisy import NOISE_AND_SLIP


@pytest.mark.parametrize("name", CATALOG)
@pytest.mark.parametrize("seconds", [2, *(pytest.param(seconds, marks=pytest.mark.slow) for seconds in (5, 20))])
def test_every_diagram_agrees_over(seconds, name):
    result = parity(load_scenario(name, [*NOISE_AND_SLIP, f"seconds={seconds}"]))
    assert result["ticks"] == 200 * seconds
    assert result["max_abs_difference"] == 0.0


def number(largest):
    return st.integers(0, 10**6).map(lambda share: share * largest / 10**6)


@st.composite
def scenarios(draw):
    """A Diagram with drawn parameters; of the structures that are compiled above, because another costs seconds."""
    robot = draw(st.sampled_from(["omni", "pendulum"]))
    ratio = [draw(number(0.3)) for _ in range(3)]
    overrides = [
        "seconds=3", f"seed={draw(st.integers(0, 2**31))}",
        f"space.localizer.dropout={draw(number(0.5))}", f"space.localizer.noise_std_pixels={draw(number(3.0))}",
        f"{robot}.plant.slip.ratio={ratio}", f"{robot}.plant.slip.noise_std=[0.05, 0.05, 0.05]",
        f"{robot}.actuator.resolution_n_m={draw(st.sampled_from([0.0, 0.004]))}",
        f"{robot}.actuator.time_constant_s={draw(number(0.02))}",
    ]
    if robot == "omni":
        overrides.append(f"omni.plant.mass_kg={3.0 + draw(number(9.0))}")
    return load_scenario(f"{robot}_multirate", overrides)


@hypothesis.settings(max_examples=6)
@hypothesis.given(scenarios())
def test_drawn_parameters_and_seeds_agree(scenario):
    assert parity(scenario)["max_abs_difference"] == 0.0


@pytest.mark.parametrize("latency", [19, *(pytest.param(ticks, marks=pytest.mark.slow) for ticks in (0, 1, 18, 40))])
def test_latencies_and_a_lossy_link_agree(latency):
    overrides = ["seconds=3", f"space.localizer.latency_ticks={latency}", "space.link.delay_ticks=2",
                 "space.link.loss=0.2", "space.link.baud_rate=57600"]
    assert parity(load_scenario("omni_multirate", overrides))["max_abs_difference"] == 0.0


@pytest.mark.parametrize("model", ["smooth", "elastoplastic"])
def test_both_friction_models_agree(model):
    overrides = ["seconds=4", f"pendulum.plant.friction.model={model}"]
    assert parity(load_scenario("pendulum_multirate", overrides))["max_abs_difference"] == 0.0


def test_a_run_that_is_lost_is_lost_at_the_same_time():
    scenario = load_scenario("omni_inertia_as_printed")
    drake, compiled = simulate(scenario), simulate_compiled(scenario)
    assert drake.diverged_s is not None
    assert compiled.diverged_s == drake.diverged_s
    assert np.array_equal(drake.signals["omni_pose"], compiled.signals["omni_pose"])
