"""The rate of a clock that drifts is found more finely than the rates that are looked at first."""

from dataclasses import replace

import numpy as np
import pytest

from drake_ispace.explain.check.check import check
from drake_ispace.scenario import load_scenario
from hidden import two_wheels
from hidden.generator import generate


@pytest.fixture(scope="module")
def sound():
    exact = {"left_share": 0.0, "late_s": 0.0, "lag_s": 0.0, "in_step": True}
    return [two_wheels.drive(670 + i, 50.0, **exact) for i in range(2)]


def found(runs, share, drifting):
    """Run -> rate of the repair, where the camera's clock is fast by this share in so many of the runs."""
    cameras = [run.channels["kinect"] for run in runs]
    runs = [
        replace(run, channels=run.channels | {"kinect": replace(camera, t=camera.t * (1.0 + share))})
        for run, camera in zip(runs[:drifting], cameras, strict=False)
    ] + runs[drifting:]
    findings = check(two_wheels.model(), runs).findings
    assert {(finding.fault, finding.channel) for finding in findings} <= {("clock_drift", "kinect")}
    return {finding.runs: finding.repairs[0].rate for finding in findings}


@pytest.mark.first_case
@pytest.mark.parametrize("drifting", [1, 2])
def test_a_rate_between_those_that_are_tried_is_found(sound, drifting):
    """Rates are tried in steps of 0.4 % first, by which the ends of 50 s are 0.2 s apart."""
    rates = found(sound, -0.0105, drifting)
    assert set(rates) == {(0,), (1,)} if drifting == 2 else {(0,)}
    assert list(rates.values()) == [pytest.approx(1.0 / 0.9895, abs=5e-4)] * drifting


@pytest.mark.slow
@pytest.mark.parametrize("drifting", [1, 2])
@pytest.mark.parametrize("share", [-0.007, 0.007])
def test_a_drift_by_less_than_latencies_differ_between_cameras_is_found_as_such(sound, share, drifting):
    """A camera has one latency. In 50 s its clock comes to be 0.35 s off; as a jump, it would be by half of that."""
    rates = found(sound, share, drifting)
    assert set(rates) == {(0,), (1,)} if drifting == 2 else {(0,)}
    assert list(rates.values()) == [pytest.approx(1.0 / (1.0 + share), abs=3e-4)] * drifting


@pytest.mark.slow
@pytest.mark.parametrize("drifting", [1, 2])
def test_a_drift_by_less_than_its_motion_tells_is_none(sound, drifting):
    """In 50 s the camera's clock comes to be 0.09 s late."""
    assert found(sound, -0.0018, drifting) == {}


@pytest.mark.slow
@pytest.mark.parametrize("share", [0.01, 0.02])
def test_a_clock_that_drifts_alike_in_short_runs_is_one_mistake_of_all(share):
    """By itself hardly one of them shows it: in 18 s the clock comes to be 0.18 or 0.36 s late."""
    exact = {"left_share": 0.0, "late_s": 0.0, "lag_s": 0.0, "in_step": True}
    rates = found([two_wheels.drive(680 + i, 18.0, **exact) for i in range(4)], share, 4)
    assert rates == {(i,): pytest.approx(1.0 / (1.0 + share), abs=5e-4) for i in range(4)}


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 300])
def test_a_window_more_that_lies_in_the_run_is_no_evidence_of_a_drift(seed):
    """Runs of 16.0 s end so that a faster clock has one or two windows of the camera more."""
    motions = ("square", "circle", "back_and_forth", "eight")
    runs = [generate("pendulum", motion, {}, 16.0, seed=seed + i) for i, motion in enumerate(motions)]
    assert check(load_scenario("pendulum_multirate"), runs).findings == []


def test_a_single_short_motion_of_a_run_tells_no_rate(monkeypatch):
    """The drive lags by 0.06 s, which a clock that is slow would make at just that time."""
    def once(random, t, low, high, step_s):
        return np.where(low >= 0.0, 0.3 * ((t > 8.0) & (t < 9.5)), 0.5 * ((t > 8.5) & (t < 9.5)))

    monkeypatch.setattr(two_wheels, "wandering", once)
    exact = {"left_share": 0.0, "late_s": 0.0, "lag_s": 0.06, "in_step": True}
    assert check(two_wheels.model(), [two_wheels.drive(seed, 20.0, **exact) for seed in (1, 2, 3)]).findings == []
