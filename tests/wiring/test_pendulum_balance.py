"""The pendulum keeps its balance, with its own gains and both printed sets."""

import numpy as np
import pytest

from drake_ispace.blocks.block import Block, Output, Spec
from drake_ispace.blocks.rates import TICK_S
from drake_ispace.control.feedback.balance_gains import balance_gain, linearised
from drake_ispace.control.feedback.dlqr import spectral_radius
from drake_ispace.rollout.engine import simulate_compiled
from drake_ispace.scenario import load_scenario
from drake_ispace.simulation import simulate, simulate_diagram
from drake_ispace.wiring.bench import Bench
from drake_ispace.wiring.catalog import CATALOG

# (4.11), u = -F x: F = [-0.3, 0.05, -1.0, -0.49, 0.03, -0.2] for s, phi, theta and their rates
OF_4_11 = ["pendulum.control.gains=given", "pendulum.control.k_right=[0.3,-0.05]",
           "pendulum.control.f1_right=[1.0,0.49,-0.03,0.2]"]
OF_6_42 = ["pendulum.control.gains=given"]
GAINS = pytest.mark.parametrize("gains", [[], OF_6_42, OF_4_11], ids=["dlqr", "(6.42)-(6.43)", "(4.11)"])
PUSHED = pytest.mark.parametrize("gains", [
    [], pytest.param(OF_6_42, marks=pytest.mark.slow), pytest.param(OF_4_11, marks=pytest.mark.slow),
], ids=["dlqr", "(6.42)-(6.43)", "(4.11)"])
STAY = ["pendulum.trajectory.kind=step", "pendulum.trajectory.goal_m=[0,0]", "seconds=10"]


@pytest.mark.parametrize("gains, radius", [([], None), (OF_6_42, 0.9934), (OF_4_11, 0.9962)])
def test_every_set_of_gains_is_stable_on_the_linear_model(gains, radius):
    robot = load_scenario("pendulum_multirate", gains).pendulum
    found = spectral_radius(*linearised(robot.plant), balance_gain(robot.plant, robot.control), TICK_S)
    assert found < 1.0
    if radius:
        assert found == pytest.approx(radius, abs=5e-5)


@GAINS
def test_it_comes_upright_from_5_degrees(gains):
    run = simulate_compiled(load_scenario("pendulum_multirate", [*STAY, *gains, "pendulum.initial_tilt_rad=0.0873"]))
    assert run.diverged_s is None
    tilt = np.degrees(np.abs(run.signals["pendulum_balance"][:, 0]))
    assert tilt.max() < 12.0
    assert tilt[1000:].max() < 1.5
    assert np.abs(run.signals["pendulum_pose"][-1, :2]).max() < 0.03


class Push(Block):
    """Torque on both wheels on top of the motors' for 0.1 s from t = 3 s on, as from a hand at the wheels."""

    def __init__(self, torque_n_m):
        super().__init__(Spec(
            inputs={"motors": 2}, outputs={"torque": Output(2, pushed)}, parameters={"torque_n_m": torque_n_m},
        ))


def pushed(tick, motors, torque_n_m, out):
    push = torque_n_m if 600 <= tick < 620 else 0.0
    out[0], out[1] = motors[0] + push, motors[1] + push


class PushedBench(Bench):
    def wire(self, *pairs):
        for source, target in pairs:
            if target == "pendulum_plant.torque":
                self.add("push", Push(0.2))
                super().wire((source, "push.motors"))
                source = "push.torque"
            super().wire((source, target))


@PUSHED
def test_it_recovers_from_a_push(gains):
    scenario = load_scenario("pendulum_multirate", [*STAY, *gains, "seconds=15"])
    bench = PushedBench()
    run = simulate_diagram(CATALOG[scenario.diagram].build(scenario, bench), scenario)
    assert run.diverged_s is None
    tilt = np.degrees(np.abs(run.signals["pendulum_balance"][:, 0]))
    assert tilt[200:600].max() < 1.5
    assert tilt[600:800].max() > 4.0
    assert tilt[1600:].max() < 1.5
    assert np.abs(run.signals["pendulum_pose"][-1, :2]).max() < 0.05


def test_without_torque_it_falls():
    run = simulate(load_scenario("pendulum_multirate", [
        *STAY, "pendulum.actuator.limit_n_m=1e-9", "pendulum.initial_tilt_rad=0.0873", "seconds=3",
    ]))
    assert run.diverged_s < 1.0
