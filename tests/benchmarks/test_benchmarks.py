"""The scripts in benchmarks/ run, and what docs/results.md says of them holds in a short run as well."""

import functools
import json
import os
import runpy
import subprocess
import sys
from pathlib import Path

import pytest

FOLDER = Path(__file__).parents[2] / "benchmarks"
#: same_answers compares two revisions; test_same_answers.py runs it.
SCRIPTS = sorted(path.stem for path in FOLDER.glob("[!_]*.py") if path.stem != "same_answers")
UNDRAWN = {  # have no picture
    "camera_rates", "diagnosis", "gap_yardstick", "long_runs", "odometry_subsets", "rollout_speed",
}


@pytest.mark.parametrize("script", SCRIPTS)
def test_the_script_runs_in_its_tiniest_form(script, monkeypatch, capsys, tmp_path):
    monkeypatch.syspath_prepend(FOLDER)
    monkeypatch.setattr(sys, "argv", [script, "--tiny", "--figures", str(tmp_path / "new")])
    runpy.run_path(str(FOLDER / f"{script}.py"), run_name="__main__")
    assert len(capsys.readouterr().out.splitlines()) > 5
    assert script in UNDRAWN or list(tmp_path.glob("new/*.png"))


@functools.cache
def quick(script, *arguments):
    """What `script --quick --json` prints."""
    done = subprocess.run(
        [sys.executable, FOLDER / f"{script}.py", "--quick", "--json", *arguments], capture_output=True, text=True,
        timeout=900, env=os.environ | {"PYTHONPATH": str(FOLDER.parent / "src")},
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@pytest.mark.slow
def test_the_yaw_loop_is_lost_on_vision_and_calm_at_5_ms():
    data = quick("multirate_vs_vision")
    runs = data["runs"]
    printed = runs["step, printed gains"]
    assert printed["vision"]["lost_at_s"] < 1.5 and printed["multi-rate"]["lost_at_s"] is None
    assert printed["multi-rate"]["largest_yaw_rad"] < 0.05
    # where the yaw loop is designed for 95 ms, translation is the same on both
    assert data["verdicts"]["step, printed gains, yaw by DLQR at 95 ms"]["winner"] == "equal"
    calm = runs["step, printed gains, yaw by DLQR at 95 ms"]
    assert all(12.0 < calm[loop]["settling_time_s"] < 15.0 for loop in calm)


@pytest.mark.slow
def test_latency_costs_vision_feedback_its_stability_and_multirate_nothing():
    maps = quick("multirate_vs_vision")["maps"]
    cells = [cell for rows in maps.values() for row in rows for cell in row]
    assert all("multi-rate" not in cell["lost"] for cell in cells)
    assert all(cell["lost"] == ["vision"] for cell in cells if cell["vision_radius"] > 1.05)
    assert all(cell["lost"] == [] for cell in cells if cell["vision_radius"] < 0.95)


def test_printed_yaw_gains_are_unstable_at_95_ms_by_computation(monkeypatch):
    monkeypatch.syspath_prepend(FOLDER)
    import multirate_vs_vision

    loops = multirate_vs_vision.radii()
    assert loops["printed gains, vision"]["radius_yaw"] == pytest.approx(1.635, abs=2e-3)
    assert loops["printed gains, multi-rate"]["radius_yaw"] < 1.0
    assert loops["printed gains, vision"]["radius_xy"] < 1.0


@pytest.mark.slow
def test_a_larger_wheel_that_only_the_path_shows_is_named_beside_a_late_camera(monkeypatch):
    monkeypatch.syspath_prepend(FOLDER)
    import camera_rates

    answer = camera_rates.answered(0, 20.0, 10.0, has_command=False)
    assert len(answer["effects"]) == 2 and answer["before_m"] > 0.5 and answer["after_m"] < 0.02


@pytest.mark.slow
def test_only_the_estimator_reaches_the_reference_under_slip():
    runs = {(run["slip"], run["s"]): run for run in quick("estimator_vs_slip")["runs"]}
    assert all(run["estimator"]["reached"] for run in runs.values())
    assert runs["constant", 0.0]["conventional"]["reached"]
    assert not runs["constant", 0.3]["conventional"]["reached"]
    assert runs["additive", 1.3]["conventional"]["final_x_m"] == pytest.approx(2.15, abs=0.01)
    assert runs["additive", 1.3]["estimator"]["final_x_m"] == pytest.approx(1.0, abs=0.002)


@pytest.mark.slow
def test_default_control_tracks_within_its_targets_and_as_printed_does_not():
    data = quick("tracking_table")
    rows = {(row["path"], row["law"]): row for row in data["tracking"]}
    for path in ("square", "circle"):
        assert rows[path, "omni, default"]["rms_cross_track_m"]["worst"] < 0.015
        assert rows[path, "pendulum, default"]["rms_cross_track_m"]["worst"] < 0.020
        assert rows[path, "omni, as printed"]["rms_cross_track_m"]["median"] > 0.1
        assert rows[path, "omni, as printed"]["mean_lag_m"]["median"] > 0.5
    rest = {(row["friction"], row["compensation"]): row["position_swing_m"]["median"] for row in data["resting"]}
    assert all(rest[friction, "default"] < rest[friction, "none"] for friction in ("smooth", "elastoplastic"))


@pytest.mark.slow
def test_the_tracker_keeps_to_the_straight_line_and_the_printed_form_does_not_arrive():
    data = quick("static_way_point")
    for row in data["still"]:
        assert row["tracker"]["max_off_line_m"] < row["Jacobian"]["max_off_line_m"]
        assert row["tracker"]["heading_range_after_arrival_deg"] < 15.0
    printed = {(row["start"], row["mode"], row["robot"]): row for row in data["printed"]}
    assert printed["facing y", "as_printed", "ideal"]["final_gap_m"] == pytest.approx(0.6, abs=0.001)
    assert printed["facing x", "as_printed", "ideal"]["final_gap_m"] > 0.15
    for start in ("facing y", "facing x"):
        assert printed[start, "corrected", "ideal"]["final_gap_m"] < 0.005
        assert printed[start, "corrected", "ideal"]["turned_after_arrival_deg"] < 15.0
        assert printed[start, "corrected", "default"]["arrived_s"] < 3.0


@pytest.mark.slow
def test_a_diagnosis_says_where_its_time_went():
    data = quick("diagnosis")
    for robot, hidden in (("omni", "coulomb_friction"), ("pendulum", "viscous_friction")):
        found = data["robots"][robot]
        assert hidden in found["named"]
        stages = [stage["stage"] for stage in found["stages"]]
        stages = stages[stages.index("preparing the predictions") :]  # after the checks of the recordings
        assert stages[:3] == ["preparing the predictions", "looking at every effect", "fitting the leaders"]
        assert found["dominates"] in found["parts"]
        assert all(part["calls"] > 0 for part in found["parts"].values())


@pytest.mark.slow
def test_every_method_finds_what_it_should():
    data = quick("identification_table")
    error = data["E_er"]
    assert error["iv"] < 5.0 and error["pem"] < 5.0 and error["armaxd"] < 0.3 * error["arx"]
    for row in data["friction"].values():
        assert row["coulomb"] == pytest.approx(0.0061, rel=0.05) and row["viscous"] == pytest.approx(0.0106, rel=0.05)
    assert data["online"]["idle_finite"]


@pytest.mark.slow
def test_the_right_compensation_calms_and_too_much_is_told():
    data = quick("friction_compensation")
    assert data["response"]["ARMAXD (Table 4.2) = true"]["tilt_ratio"] < 0.75
    assert data["over_compensation"]["1.5"]["said_over"] == 1.0 and data["over_compensation"]["1"]["said_over"] == 0.0
