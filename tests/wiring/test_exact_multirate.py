"""The multi-rate loop with ideal sensors is the sampled linear system of the text, to the last digits."""

import numpy as np
import pytest

from drake_ispace.blocks.block import Block, Output, Spec
from drake_ispace.blocks.rates import TICK_S
from drake_ispace.control.feedback import balance_gains, omni_gains
from drake_ispace.control.feedback.dlqr import zero_order_hold
from drake_ispace.scenario import load_scenario
from drake_ispace.simulation import make_simulator, simulate, simulate_diagram
from drake_ispace.wiring.bench import Bench
from drake_ispace.wiring.catalog import CATALOG, build_diagram

IDEAL_ROOM = ["space.localizer.whole_pixels=false", "space.localizer.noise_std_pixels=0"]
REGULATE = ["trajectory.kind=step", "trajectory.start_s=0", "trajectory.goal_m=[0,0]", "encoder.counts_per_turn=0",
            "encoder.velocity=exact"]


def powers(closed_loop, state, ticks):
    """(ticks + 1, n): x_0, M x_0, M^2 x_0, ..."""
    rows = [np.asarray(state, dtype=float)]
    for _ in range(ticks):
        rows.append(closed_loop @ rows[-1])
    return np.array(rows)


def regulated_omni(pose):
    """Run and scenario of the omni robot sent from `pose` to the origin, and its loop A_d - B_d K, gain K."""
    scenario = load_scenario("omni_multirate", [
        *IDEAL_ROOM, *[f"omni.{rule}" for rule in REGULATE], f"omni.initial_pose={pose}", "seconds=20",
    ])
    gain = np.hstack(omni_gains.omni_gains(scenario.omni.plant, scenario.omni.control, TICK_S))
    a_d, b_d = zero_order_hold(*omni_gains.linearised(scenario.omni.plant), TICK_S)
    return simulate(scenario), scenario, a_d - b_d @ gain, gain


@pytest.mark.parametrize("pose", [
    [0.5, -0.3, 0.0], pytest.param([0.0, 0.0, 0.4], marks=pytest.mark.slow),
], ids=["translation", "yaw"])
def test_the_omni_loop_is_the_power_of_its_matrix_at_every_tick_of_20_s(pose):
    run, _, closed_loop, _ = regulated_omni(pose)
    state = np.hstack([run.signals["omni_pose"], run.signals["omni_velocity"]])
    expected = powers(closed_loop, [*pose, 0.0, 0.0, 0.0], 4000)
    assert state.shape == (4001, 6)
    assert np.abs(state - expected).max() < 1e-13


def test_the_torque_of_a_tick_comes_from_the_sample_of_that_tick():
    run, scenario, _, gain = regulated_omni([0.5, -0.3, 0.0])
    state = np.hstack([run.signals["omni_pose"], run.signals["omni_velocity"]])
    force = -state[:-1] @ gain.T  # from the state at t_k; heading stays zero
    held = run.signals["omni_torque"][1:]  # row k + 1 shows what is held on [t_k, t_k+1)
    assert np.abs(held - force @ scenario.omni.plant.geometry.forward).max() < 1e-13
    assert not run.signals["omni_torque"][0].any()


@pytest.mark.parametrize("name", CATALOG)
def test_there_is_exactly_one_integrator_step_a_tick(name):
    simulator, _ = make_simulator(build_diagram(load_scenario(name)))
    integrator = simulator.get_integrator()
    simulator.AdvanceTo(TICK_S)
    assert integrator.get_num_steps_taken() == 1
    simulator.AdvanceTo(400 * TICK_S)
    assert integrator.get_num_steps_taken() == 400
    assert simulator.get_num_steps_taken() == 400
    assert integrator.get_largest_step_size_taken() == TICK_S


def test_times_of_the_integrator_are_whole_ticks():
    simulator, _ = make_simulator(build_diagram(load_scenario("omni_multirate", ["space.localizer.latency_ticks=7"])))
    times = []
    simulator.set_monitor(lambda context: times.append(context.get_time()))
    simulator.AdvanceTo(400 * TICK_S)
    assert times == [tick * TICK_S for tick in range(1, 401)]


class TrueTilt(Block):
    """In place of the tilt filter: the plant's own tilt and rate."""

    def __init__(self):
        super().__init__(Spec(inputs={"balance": 4, "imu": 7}, outputs={"tilt": Output(4, true_tilt)}))


def true_tilt(balance, imu, out):
    out[0], out[1], out[2], out[3] = imu[0], balance[0], balance[3], 0.0


class TrueTiltBench(Bench):
    def add(self, name, block):
        return super().add(name, TrueTilt() if name == "pendulum_tilt_filter" else block)

    def build(self, name):
        self.wire(("pendulum_plant.balance", "pendulum_tilt_filter.balance"))
        return super().build(name)


def test_the_pendulum_loop_is_the_power_of_its_matrix_for_small_tilts():
    tilt = 1e-4
    scenario = load_scenario("pendulum_multirate", [
        *IDEAL_ROOM, *[f"pendulum.{rule}" for rule in REGULATE], f"pendulum.initial_tilt_rad={tilt}", "seconds=5",
        "pendulum.plant.friction={coulomb_n_m: 0, viscous_n_m_s: 0}",
        "pendulum.control.friction_compensation.enabled=false",
    ])
    bench = TrueTiltBench()
    run = simulate_diagram(CATALOG[scenario.diagram].build(scenario, bench), scenario)
    pose, balance = run.signals["pendulum_pose"], run.signals["pendulum_balance"]
    state = np.column_stack([pose[:, 0], pose[:, 2], balance])
    a_d, b_d = zero_order_hold(*balance_gains.linearised(scenario.pendulum.plant), TICK_S)
    closed_loop = a_d - b_d @ balance_gains.balance_gain(scenario.pendulum.plant, scenario.pendulum.control)
    expected = powers(closed_loop, [0.0, 0.0, tilt, 0.0, 0.0, 0.0], 1000)
    # what is left is the Runge-Kutta step's own error at 26 rad/s
    assert np.abs(state - expected).max() < 3e-5 * tilt
    assert np.abs(expected).max() > 4.0 * tilt
