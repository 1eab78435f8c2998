"""Runs in SIMD lanes equal single runs bit for bit, and kernels that gain nothing from lanes are named."""

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
from drake_ispace.wiring.catalog import build_diagram


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
    rollout = compile_lanes(spring_loop(drakes_hold), log={"state": 1, "force": 5}, lanes=8)
    names, values = rollout.single.parameter_names, rollout.single.parameters
    parameters = values * np.random.default_rng(0).uniform(0.8, 1.2, (11, len(names)))  # a full group and three runs
    logs = rollout.run(500, parameters)
    assert logs["state"].shape == (11, 501, 2) and logs["force"].shape == (11, 101, 1)
    assert np.ptp(logs["state"][:, -1, 0]) > 0.0
    for run, row in enumerate(parameters):
        for name, alone in rollout.single.run(500, row).items():
            np.testing.assert_array_equal(logs[name][run], alone)


def test_a_diagram_with_trigonometry_is_refused_with_the_kernels_name():
    with pytest.raises(InputError, match=r"lanes: kernel \w+ (calls|branches)"):
        compile_lanes(build_diagram(load_scenario("omni_multirate")))


def test_rows_of_another_length_are_refused():
    rollout = compile_lanes(spring_loop(), log={"state": 1}, lanes=8)
    with pytest.raises(InputError, match=r"expected \(runs, \d+\)"):
        rollout.run(5, rollout.single.parameters[:-1])
