"""Position estimator (6.6) in the omni loop: a wrong idea of the start, and fixes that come late."""

import numpy as np
import pytest

from drake_ispace.blocks.block import Block, Output, Spec
from drake_ispace.control.estimate.odometry import OmniOdometry
from drake_ispace.scenario import load_scenario
from drake_ispace.simulation import simulate_diagram
from drake_ispace.wiring.bench import Bench
from drake_ispace.wiring.catalog import CATALOG

STEP = ["omni.trajectory.kind=step", "omni.control.gains=given", "seconds=8"]


class ChangedBench(Bench):
    """The omni loop with other blocks, or with a block spliced into a wire."""

    def __init__(self, blocks=None, spliced=None):
        super().__init__()
        self.blocks, self.spliced = blocks or {}, spliced or {}

    def add(self, name, block):
        return super().add(name, self.blocks.get(name, block))

    def wire(self, *pairs):
        for source, target in pairs:
            if target in self.spliced:
                self.add("spliced", self.spliced[target])
                super().wire((source, "spliced.fix"))
                source = "spliced.fix"
            super().wire((source, target))


def omni_run(overrides, **changes):
    scenario = load_scenario("omni_multirate", overrides)
    bench = ChangedBench(**changes)
    return simulate_diagram(CATALOG[scenario.diagram].build(scenario, bench), scenario)


def told(heading_rad):
    """Odometry that believes to start at this heading, although the robot starts at zero."""
    geometry = load_scenario("omni_multirate").omni.plant.geometry
    return {"omni_odometry": OmniOdometry(geometry, [0.0, 0.0, heading_rad])}


def estimate_error_m(run, first_tick):
    """Distance between estimate and truth, (ticks,), each at the same tick."""
    estimate, truth = run.signals["omni_estimate"][first_tick + 1 :, 1:3], run.signals["omni_pose"][first_tick:-1, :2]
    return np.linalg.norm(estimate - truth, axis=1)


def test_a_wrong_heading_of_odometry_does_not_matter():
    right = omni_run(STEP)
    assert np.linalg.norm(right.signals["omni_pose"][-1, :2]) > 0.5
    for heading_rad in (1.5, 2.0):
        wrong = omni_run(STEP, blocks=told(heading_rad))
        assert np.abs(wrong.signals["omni_pose"] - right.signals["omni_pose"]).max() < 1e-10
        assert estimate_error_m(wrong, 0).max() < 0.01


PRINTED = [*STEP, "omni.control.estimator_as_printed=true"]


def test_as_printed_the_estimate_leaves_the_robot_between_fixes():
    overrides = [*PRINTED, "omni.control.gains=dlqr"]
    assert estimate_error_m(omni_run(overrides), 200).max() < 0.01
    assert estimate_error_m(omni_run(overrides, blocks=told(1.5)), 200).max() > 0.1


@pytest.mark.parametrize("heading_rad", [1.5, 2.0])
def test_as_printed_it_leaves_the_room(heading_rad):
    assert omni_run([*PRINTED, "seconds=20"], blocks=told(heading_rad)).diverged_s < 20.0


class Restamp(Block):
    """Makes a fix look as if it were captured when it arrives."""

    def __init__(self, latency_ticks):
        super().__init__(Spec(
            inputs={"fix": 5}, outputs={"fix": Output(5, restamped)}, parameters={"latency_ticks": latency_ticks},
        ))


def restamped(fix, latency_ticks, out):
    out[:] = fix
    if fix[0] >= 0.0:
        out[0] = fix[0] + latency_ticks


def test_stamps_make_latency_harmless():
    late = ["space.localizer.latency_ticks=18", "omni.plant.slip.ratio=[0.1,0.1,0.1]", "seconds=10"]
    stamped = estimate_error_m(omni_run(late), 400)
    unstamped = estimate_error_m(omni_run(late, spliced={"omni_estimator.fix": Restamp(18.0)}), 400)
    # 18 ticks at 0.25 m/s are 22.5 mm; what is left with stamps is slip since the capture
    assert np.sqrt(np.mean(stamped**2)) < 0.006
    assert np.sqrt(np.mean(unstamped**2)) == pytest.approx(0.0225, abs=0.003)
