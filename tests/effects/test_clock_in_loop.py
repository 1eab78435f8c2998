"""A room whose clock is ahead or behind: what the stamps do to the robots' estimates and to recordings."""

import numpy as np
import pytest

from drake_ispace.alignment import to_recording
from drake_ispace.blocks.rates import TICK_S
from drake_ispace.control.estimate.error_estimator import ErrorEstimator
from drake_ispace.control.estimate.position_estimator import PositionEstimator
from drake_ispace.rollout.compile import compile_diagram
from drake_ispace.rollout.engine import parity, simulate_compiled
from drake_ispace.scenario import load_scenario
from drake_ispace.simulation import make_run
from drake_ispace.wiring.catalog import build_diagram

BEHIND, AHEAD = -0.1, 0.1
SETTINGS = ["seconds=4", "omni.trajectory.heading=fixed"]
CLOCK = "omni.effects.clock_offset.offset_s"


def with_clock(offset_s):
    return load_scenario("omni_multirate", [*SETTINGS, f"{CLOCK}={offset_s}"])


@pytest.fixture(scope="module")
def runs():
    """Offset -> run; None: without the effect. One compilation serves all offsets."""
    rollout = compile_diagram(build_diagram(with_clock(0.0)))
    found = {None: simulate_compiled(load_scenario("omni_multirate", SETTINGS))}
    for offset_s in (0.0, BEHIND, AHEAD):
        p = rollout.with_parameters({"omni_clock_offset.offset_ticks": round(offset_s / TICK_S)})
        found[offset_s] = make_run(with_clock(offset_s), rollout.run(800, p), None, 0.0)
    return found


def test_at_neutral_every_signal_is_that_of_the_base_model(runs):
    base, neutral = runs[None].signals, runs[0.0].signals
    assert [name for name in base if not np.array_equal(base[name], neutral[name])] == []


def test_both_engines_agree():
    assert parity(with_clock(BEHIND))["max_abs_difference"] == 0.0


def test_a_clock_that_is_behind_puts_the_estimate_ahead_along_the_way(runs):
    signals = runs[BEHIND].signals
    rows = slice(400, 800)  # after row k, the estimate is that of tick k - 1
    error = signals["omni_estimate"][rows, 1:3] - signals["omni_pose"][399:799, :2]
    velocity = signals["omni_velocity"][399:799, :2]
    speed = np.linalg.norm(velocity, axis=1)
    along = np.sum(error * velocity, axis=1) / speed
    assert np.mean(along / speed) == pytest.approx(-BEHIND, rel=0.15)


def test_a_stamp_that_is_yet_to_come_is_taken_as_that_of_now(runs):
    base, ahead = runs[None].signals, runs[AHEAD].signals
    assert np.array_equal(base["omni_pose"], ahead["omni_pose"])  # without latency every fix is as new as can be
    assert np.array_equal(base["omni_estimate"], ahead["omni_estimate"])
    seen = ahead["omni_fix"][:, 1] > 0.0
    assert ahead["omni_fix"][seen, 0] == pytest.approx(base["omni_fix"][seen, 0] + 20)


@pytest.mark.parametrize("offset_s", [BEHIND, AHEAD])
def test_a_recording_keeps_the_stamps_and_can_be_read_again(runs, offset_s):
    kinect = to_recording(runs[offset_s], "omni").channels["kinect"]
    base = to_recording(runs[None], "omni").channels["kinect"]
    assert np.all(np.diff(kinect.t) > 0.0) and np.all(kinect.column("t_received") >= kinect.t)
    assert kinect.t[2:] == pytest.approx(base.t[len(base.t) - len(kinect.t) + 2 :] + offset_s, abs=1e-6)


def test_the_estimator_takes_a_fix_of_the_future_once(drive):
    fixes = [[9, 1, 1.0, 0.0, 0.0]] * 20
    odometry = [[k, 0.1 * k, 0.0, 0.0] for k in range(20)]
    ticks = [{"odometry": o, "fix": f} for o, f in zip(odometry, fixes, strict=True)]
    rows = drive(PositionEstimator(5), "pose", ticks)
    assert rows[:, 1] == pytest.approx(1.0 + 0.1 * np.arange(20))


def test_an_error_of_the_future_counts_from_now_and_stays_while_the_robot_is_not_seen(drive):
    # The way point moves on at tick 2, the fix stays.
    errors = [[9, 0, 1.0, 0.0, 0.0]] * 2 + [[9, 2, 1.5, 0.0, 0.0]] * 2
    path = [[k, 0.1 * k, 0.0] for k in range(4)]
    rows = drive(ErrorEstimator(5), "error", [{"path": p, "error": e} for p, e in zip(path, errors, strict=True)])
    assert rows[:, 0] == pytest.approx([1.0, 0.9, 1.3, 1.2])
