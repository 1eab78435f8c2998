"""A camera's clock that drifts in a run, or is another one than in other runs, is told by the fixes and set."""

from dataclasses import replace

import numpy as np
import pytest

import drake_ispace as di
from drake_ispace.explain.decide.clocks.camera_clocks import camera_clocks
from drake_ispace.explain.predict.case import prepare
from drake_ispace.faults.repair import Clock, with_channel
from hidden import two_wheels
from hidden.generator import generate

SOUND = {"left_share": 0.0, "late_s": 0.0, "lag_s": 0.0}
LACKING = {"left_share": 0.04, "late_s": 0.08, "lag_s": 0.06}
SECONDS = 15.0
LIBRARY = [di.effects()[name] for name in (
    "single_wheel_radius_error", "track_error", "marker_offset", "camera_latency", "clock_offset", "camera_scale",
)]


def runs_of(robot, since_s=0.0, **clocks):
    """Three runs on clocks that begin at since_s; clock_1=(rate, late_s): of the camera of run 1, counted from 0."""
    runs = [two_wheels.drive(40 + i, SECONDS, **robot) for i in range(3)]
    for name, (rate, late_s) in clocks.items():
        i = int(name[-1])
        runs[i] = Clock("kinect", 1.0 + rate, late_s - 0.5 * rate * SECONDS).apply(runs[i])
    for channel in ("command", "encoder", "kinect"):
        runs = [Clock(channel, 1.0, since_s).apply(run) for run in runs]
    return runs


def found_in(runs, model=None):
    return camera_clocks(prepare(model or two_wheels.model(), runs, (), LIBRARY), runs)


@pytest.mark.first_case
@pytest.mark.parametrize("robot", [SOUND, LACKING], ids=["sound", "lacking"])
@pytest.mark.parametrize("late_s", [0.03, -0.06])
def test_a_run_whose_camera_is_later_than_in_others_is_told(robot, late_s):
    (i, finding), = found_in(runs_of(robot, clock_1=(0.0, late_s))).items()
    assert (i, finding.fault, finding.run, finding.is_bearable) == (1, "clock_offset", "run 2", True)
    assert finding.repairs == (Clock("kinect", 1.0, pytest.approx(-late_s, abs=0.003)),)


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "seconds", "late_s"), [
    (110, (60.0, 12.0, 12.0), 0.05), (110, (60.0, 12.0, 12.0), -0.08), (216, (20.0, 20.0), 0.05),
    (56, (15.0, 15.0), 0.1),
])
def test_the_run_that_is_off_is_told_however_long_it_is(seed, seconds, late_s):
    """Of two runs that one is off whose clock is not what the model says."""
    runs = [two_wheels.drive(seed + i, lasts_s, **SOUND) for i, lasts_s in enumerate(seconds)]
    runs[0] = Clock("kinect", 1.0, late_s).apply(runs[0])
    (i, finding), = found_in(runs).items()
    assert i == 0 and finding.repairs[0].offset_s == pytest.approx(-late_s, abs=0.003)


@pytest.mark.filterwarnings("error")
def test_a_run_with_a_single_fix_tells_nothing():
    runs = runs_of(SOUND)
    seen = runs[1].channels["kinect"]
    runs[1] = with_channel(runs[1], "kinect", replace(seen, t=seen.t[40:42], values=seen.values[40:42]))
    assert found_in(runs) == {}


@pytest.mark.first_case
@pytest.mark.parametrize("robot", [SOUND, LACKING], ids=["sound", "lacking"])
def test_a_clock_that_drifts_is_told_with_its_rate(robot):
    (i, finding), = found_in(runs_of(robot, clock_2=(0.004, 0.0))).items()
    assert (i, finding.fault) == (2, "clock_drift") and "fast" in finding.what
    assert finding.repairs[0].rate == pytest.approx(1.0 - 0.004, abs=4e-4)


@pytest.mark.slow
def test_clocks_that_begin_late_are_repaired_alike():
    at_zero, later = (
        [finding.repairs[0] for finding in found_in(runs_of(SOUND, since_s, clock_0=(0.004, 0.05))).values()]
        for since_s in (0.0, 1e6)
    )
    t = np.array([0.0, SECONDS])
    assert len(at_zero) == len(later) == 1
    assert np.allclose(later[0].moved(t + 1e6) - 1e6, at_zero[0].moved(t), atol=1e-4)


@pytest.mark.first_case
@pytest.mark.parametrize("others", [
    {}, {"slip_share": 0.05}, {"deflating_share": 0.03}, {"patch_share": 0.05}, {"fast_slip_s2_m2": 0.1},
    {"warped_rad_m": 0.05}, {"ripple_rad": 0.03}, {"skid_s": 0.05},
], ids=lambda others: next(iter(others), "sound"))
def test_whatever_the_model_lacks_no_clock_is_off(others):
    assert found_in(runs_of(SOUND | {"others": others})) == {}


def test_a_marker_that_was_moved_before_one_run_is_no_clock():
    runs = runs_of(SOUND)
    seen = runs[1].channels["kinect"]
    phi = seen.values[:, 2]
    moved = seen.values + 0.03 * np.column_stack([np.cos(phi), np.sin(phi), 0.0 * phi])
    runs[1] = with_channel(runs[1], "kinect", replace(seen, values=moved))
    assert found_in(runs) == {}


def test_in_coarse_counts_no_clock_is_told(monkeypatch):
    monkeypatch.setattr(two_wheels, "COUNTS", 400)
    assert found_in(runs_of(SOUND, clock_0=(0.004, 0.05))) == {}


@pytest.mark.slow
def test_parts_that_stand_for_runs_are_left_as_they_are():
    runs = runs_of(SOUND, clock_0=(0.004, 0.05))
    case = prepare(two_wheels.model(), runs, (), LIBRARY)
    assert camera_clocks(case, runs) and camera_clocks(case, runs[:2]) == {}


@pytest.mark.slow
def test_what_the_model_lacks_is_named_with_right_sizes_once_the_clocks_are_set():
    runs = runs_of(LACKING | {"lag_s": 0.0}, clock_0=(0.004, 0.05))
    answer = di.explain(two_wheels.model(), runs[:2], runs[2:], LIBRARY[:4])
    of_camera = [finding for finding in answer.data if finding.channel == "kinect"]
    assert [(finding.fault, finding.run) for finding in of_camera] == [("clock_drift", "run 1")]
    sizes = {effect.name: effect.parameters for effect in answer.effects}
    assert sizes["single_wheel_radius_error"]["share"].estimate == pytest.approx(0.04, abs=0.002)
    assert sizes["camera_latency"]["latency_s"].estimate == pytest.approx(0.08, abs=0.005)


@pytest.mark.slow
def test_data_that_are_trusted_keep_their_clocks():
    runs = runs_of(SOUND, clock_0=(0.004, 0.05))
    answer = di.explain(two_wheels.model(), runs, (), LIBRARY[:1], trust_data=True)
    assert "kinect" not in [finding.channel for finding in answer.data]


@pytest.mark.slow
def test_runs_that_no_camera_saw_have_no_clock_of_one():
    runs = [generate("pendulum", motion, {}, 6.0, seed=90 + i) for i, motion in enumerate(("square", "eight"))]
    runs = [replace(run, channels={n: c for n, c in run.channels.items() if n != "kinect"}) for run in runs]
    assert found_in(runs, di.load_scenario("pendulum_multirate")) == {}
    library = [di.effects()[name] for name in ("coulomb_friction", "mass_error")]
    assert di.explain("pendulum_multirate", runs, (), library).verdict == "none"
