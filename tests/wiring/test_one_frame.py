"""The room sends one frame every 95 ms, whatever the camera's latency: the fix, and what follows from it."""

import numpy as np
import pytest

from drake_ispace.rollout.engine import simulate_compiled
from drake_ispace.scenario import load_scenario
from drake_ispace.simulation import simulate


def changes(diagram, latency_ticks, signals, run=simulate):
    """Ticks at which any of the signals changes."""
    overrides = [f"space.localizer.latency_ticks={latency_ticks}", "seconds=0.6"]
    found = run(load_scenario(diagram, overrides)).signals
    rows = np.hstack([found[name] for name in signals])
    return np.flatnonzero((np.diff(rows, axis=0) != 0.0).any(axis=1)).tolist()


@pytest.mark.parametrize("latency_ticks", range(41))
def test_fix_and_way_point_change_together_every_19_ticks(latency_ticks):
    frames = changes("omni_multirate", latency_ticks, ["omni_fix", "omni_way_point"])
    assert frames == list(range(latency_ticks, 120, 19))


@pytest.mark.parametrize("latency_ticks", [0, 7, 19, 30])
def test_the_tracker_computes_when_the_fix_is_there(latency_ticks):
    frames = changes("pendulum_vision_feedback", latency_ticks, ["pendulum_fix", "pendulum_error"])
    assert frames == list(range(latency_ticks, 120, 19))


def test_the_way_point_is_that_of_the_instant_at_which_the_fix_is_there():
    run = simulate(load_scenario("pendulum_multirate", ["space.localizer.latency_ticks=7", "seconds=0.5"]))
    assert run.signals["pendulum_way_point"][-1, 0] - run.signals["pendulum_fix"][-1, 0] == 7.0


def test_compiled_frames_are_those_of_drake():
    signals = ["omni_fix", "omni_way_point"]
    assert changes("omni_multirate", 7, signals, simulate_compiled) == changes("omni_multirate", 7, signals)
