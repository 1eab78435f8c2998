"""Runs in SIMD lanes equal single runs bit for bit, and become vector instructions."""

import re

import numpy as np
import pytest
from pydrake.systems.primitives import ZeroOrderHold

from drake_ispace.blocks.block import Block, Output, Phase, Spec, Update
from drake_ispace.blocks.errors import InputError
from drake_ispace.blocks.kernels import copy, kernel
from drake_ispace.blocks.rates import TICK_S
from drake_ispace.rollout.lanes import compile_lanes
from drake_ispace.scenario import load_scenario
from drake_ispace.wiring.bench import Bench
from drake_ispace.wiring.catalog import CATALOG, build_diagram


@kernel
def derivatives(xc, force, mass, stiffness, out):
    out[0] = xc[1]
    out[1] = (force[0] - stiffness[0] * xc[0] - stiffness[1] * xc[0] * xc[0] * xc[0]) / mass


@kernel
def state(xc, out):
    copy(xc, out)


@kernel
def sample(tick, xd, state, step, out):
    out[0] = step * np.floor(state[0] / step + 0.5)
    out[1] = out[0] - xd[0]
    out[2] = tick


@kernel
def force(sampled, gain, out):
    out[0] = min(max(-gain * sampled[0] - 2.0 * sampled[1] if sampled[2] >= 0.0 else 0.0, -3.0), 3.0)


@kernel
def hold(command, out):
    copy(command, out)


@kernel
def show(xd, out):
    copy(xd, out)


#: Always the same, so that the loop is compiled once.
LOG = {"state": 1, "force": 5}


def spring_loop(drakes_hold=False):
    """A hardening spring under sampled feedback, the sensor at a third of the rate."""
    bench = Bench()
    bench.add("spring", Block(Spec(
        inputs={"force": 1}, outputs={"state": Output(2, state)}, continuous_state=np.array([0.4, 0.0]),
        parameters={"mass": 0.7, "stiffness": np.array([3.0, 5.0])}, derivatives=derivatives,
    )))
    bench.add("sensor", Block(Spec(
        inputs={"state": 2}, outputs={"sampled": Output(3, show)}, parameters={"step": 0.01},
        discrete_state=np.array([0.0, 0.0, -1.0]), updates=(Update(sample, Phase.SENSE, 3),),
    )))
    bench.add("law", Block(Spec(inputs={"sampled": 3}, outputs={"force": Output(1, force)}, parameters={"gain": 2.0})))
    bench.add("hold", ZeroOrderHold(TICK_S, 1) if drakes_hold else Block(Spec(
        inputs={"command": 1}, outputs={"force": Output(1, show)}, discrete_state=np.zeros(1),
        updates=(Update(hold, Phase.COMPUTE),),
    )))
    command, held = ("hold.u", "hold.y") if drakes_hold else ("hold.command", "hold.force")
    bench.wire(
        ("spring.state", "sensor.state"), ("sensor.sampled", "law.sampled"), ("law.force", command),
        (held, "spring.force"),
    )
    bench.show(state="spring.state", force=held)
    return bench.build("spring_loop")


@pytest.mark.parametrize("drakes_hold", [False, True])
def test_every_lane_equals_a_single_run_bit_for_bit(drakes_hold):
    rollout = compile_lanes(spring_loop(drakes_hold), log=LOG, lanes=8)
    names, values = rollout.single.parameter_names, rollout.single.parameters
    parameters = values * np.random.default_rng(0).uniform(0.8, 1.2, (11, len(names)))  # a full group and three runs
    logs = rollout.run(500, parameters)
    assert logs["state"].shape == (11, 501, 2) and logs["force"].shape == (11, 101, 1)
    assert np.ptp(logs["state"][:, -1, 0]) > 0.0
    for run, row in enumerate(parameters):
        for name, alone in rollout.single.run(500, row).items():
            np.testing.assert_array_equal(logs[name][run], alone)


_NOISY = ["slip.ratio=[0.1,0.1,0.1]", "slip.noise_std=[0.1,0.1,0.1]"]


def assert_same_as_alone(name, overrides=(), ticks=200, runs=3):
    diagram = build_diagram(load_scenario(name, list(overrides)))
    rollout = compile_lanes(diagram, lanes=8, varied=())
    parameters = np.array([rollout.single.with_seed(seed) for seed in range(runs)])
    logs = rollout.run(ticks, parameters)
    for run, row in enumerate(parameters):
        for signal, alone in rollout.single.run(ticks, row).items():
            np.testing.assert_array_equal(logs[signal][run], alone, err_msg=signal)
    return rollout


@pytest.mark.slow
def test_the_omni_robot_with_camera_slip_and_noise_runs_in_lanes(monkeypatch):
    monkeypatch.setattr("drake_ispace.rollout.compile.cache_folder", lambda part: None)  # to look at the code
    rollout = assert_same_as_alone("omni_multirate", [f"omni.plant.{one}" for one in _NOISY], ticks=60)
    (text,) = rollout._function.inspect_llvm().values()
    single, vector = (len(re.findall(rf"fmul {kind}", text)) for kind in ("double", r"<\d+ x double>"))
    assert vector > 4 * single  # what is left: the search in the path's table, and the wrapper for Python


@pytest.mark.slow
@pytest.mark.parametrize("name", CATALOG)
def test_every_diagram_runs_in_lanes(name):
    robots = [robot for robot in CATALOG[name].robots if robot in ("omni", "pendulum")]
    assert_same_as_alone(name, [f"{robot}.plant.{one}" for robot in robots for one in _NOISY])


def test_a_lane_that_leaves_the_numbers_ends_as_a_single_run_does():
    rollout = compile_lanes(spring_loop(), log=LOG, lanes=8)
    parameters = np.repeat(rollout.single.parameters[None], 3, axis=0)
    parameters[1, rollout.single.index("spring.mass")] = 1e-9
    logs = rollout.run(600, parameters)
    for run, row in enumerate(parameters):
        for signal, alone in rollout.single.run(600, row).items():
            np.testing.assert_array_equal(logs[signal][run], alone)
    assert np.isnan(logs["state"][1, -1]).all() and np.isfinite(logs["state"][2]).all()


def test_every_lane_may_begin_in_a_state_of_its_own():
    rollout = compile_lanes(spring_loop(), log=LOG, lanes=8)
    single, parameters = rollout.single, np.repeat(rollout.single.parameters[None], 2, axis=0)
    states = np.array([[0.1, 0.0], [0.2, -0.3]])
    logs = rollout.run(50, parameters, continuous_state=states)
    for run in range(2):
        alone = single.run(50, parameters[run], continuous_state=states[run])
        np.testing.assert_array_equal(logs["state"][run], alone["state"])


@kernel
def pushed(push, gain, out):
    out[0] = gain * push[0]


def test_inputs_are_those_of_all_lanes_or_of_each():
    bench = Bench()
    bench.add("amplifier", Block(Spec(
        inputs={"push": 1}, outputs={"pushed": Output(1, pushed)}, parameters={"gain": 2.0},
    )))
    bench.let_in(push="amplifier.push")
    bench.show(pushed="amplifier.pushed")
    rollout = compile_lanes(bench.build("amplifier"), lanes=8)
    push, gains = np.arange(6.0).reshape(2, 3, 1), np.array([[2.0], [3.0]])
    each = rollout.run(3, gains, inputs={"push": push})["pushed"]
    alike = rollout.run(3, gains, inputs={"push": push[0]})["pushed"]
    np.testing.assert_array_equal(each[:, :3], gains[:, None] * push)
    np.testing.assert_array_equal(alike[:, :3], gains[:, None] * push[[0, 0]])
    with pytest.raises(InputError, match="is of 2 runs, expected 3"):
        rollout.run(3, np.ones((3, 1)), inputs={"push": push})


def test_what_is_not_varied_is_a_constant():
    rollout = compile_lanes(spring_loop(), log=LOG, lanes=8, varied=["law.gain"])
    parameters = np.repeat(rollout.single.parameters[None], 2, axis=0)
    parameters[1, rollout.single.index("law.gain")] = 3.0
    alone = rollout.single.run(50, parameters[1])["state"]
    np.testing.assert_array_equal(rollout.run(50, parameters)["state"][1], alone)
    parameters[0, rollout.single.index("spring.mass")] = 3.0
    with pytest.raises(InputError, match=r"spring\.mass has another value than it was compiled with"):
        rollout.run(5, parameters)
    with pytest.raises(InputError, match="there is no parameter"):
        compile_lanes(spring_loop(), varied=["law.gian"])


def test_rows_of_another_length_are_refused():
    rollout = compile_lanes(spring_loop(), log=LOG, lanes=8)
    with pytest.raises(InputError, match=r"expected \(runs, \d+\)"):
        rollout.run(5, rollout.single.parameters[:-1])
