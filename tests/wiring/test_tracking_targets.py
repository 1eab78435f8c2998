"""What the loops are for: tracking, and wheel slip made harmless."""

import numpy as np
import pytest

from drake_ispace.metrics import measure
from drake_ispace.rollout.engine import simulate_compiled
from drake_ispace.scenario import load_scenario

ALL_AXES = "[{0},{0},{0}]"


def slipping(robot, share=0.1, frame="body"):
    return [f"{robot}.plant.slip.ratio={ALL_AXES.format(share)}", f"{robot}.plant.slip.frame={frame}"]


@pytest.mark.parametrize("robot, limit_m", [("omni", 0.015), ("pendulum", 0.020)])
@pytest.mark.parametrize("kind", ["square", "circle"])
def test_cross_track_error_under_10_percent_slip(robot, limit_m, kind):
    overrides = [f"{robot}.trajectory.kind={kind}", *slipping(robot), "seconds=30"]
    run = simulate_compiled(load_scenario(f"{robot}_multirate", overrides))
    assert run.diverged_s is None
    assert measure(run, robot).rms_cross_track_m <= limit_m


@pytest.mark.parametrize("kind, start", [("square", "[-0.6, -0.6, 3.14]"), ("circle", "[0.6, 0.0, -1.57]")])
def test_a_pendulum_that_faces_backwards_follows_in_reverse(kind, start):
    overrides = [f"pendulum.trajectory.kind={kind}", f"pendulum.initial_pose={start}", "seconds=25"]
    run = simulate_compiled(load_scenario("pendulum_multirate", overrides))
    found = measure(run, "pendulum")
    assert found.rms_cross_track_m <= 0.020 and found.mean_lag_m == pytest.approx(0.22, abs=0.05)


def final_place(diagram, *overrides):
    """x [m] after a step of 1 m, averaged over the last second."""
    run = simulate_compiled(load_scenario(diagram, ["omni.trajectory.kind=step", "seconds=12", *overrides]))
    assert run.diverged_s is None
    return run.signals["omni_pose"][-200:, 0].mean()


def test_with_estimator_a_step_arrives_under_slip():
    assert final_place("omni_multirate", *slipping("omni")) == pytest.approx(1.0, abs=0.005)


def test_without_estimator_it_does_not():
    # odometry between fixes believes 1.0 m where the robot is 10 % short
    assert final_place("omni_conventional_multirate", *slipping("omni")) == pytest.approx(0.9, abs=0.02)


def test_without_slip_both_arrive():
    assert final_place("omni_multirate") == pytest.approx(1.0, abs=0.005)
    assert final_place("omni_conventional_multirate") == pytest.approx(1.0, abs=0.005)


def test_slip_of_1_3_read_as_an_error_that_adds():
    # Fig. 6.11: the robot moves 2.3 times as far as its wheels say
    overrides = ["space.width_m=6", *slipping("omni", 1.3, "additive")]
    assert final_place("omni_multirate", *overrides) == pytest.approx(1.0, abs=0.005)
    assert final_place("omni_conventional_multirate", *overrides) > 2.0


def test_drop_outs_cost_millimetres_only():
    run = simulate_compiled(load_scenario("pendulum_multirate", ["space.localizer.dropout=0.5", "seconds=21"]))
    metrics = measure(run, "pendulum")
    assert metrics.rms_cross_track_m < 0.02
    assert np.isfinite(metrics.final_error_m)
