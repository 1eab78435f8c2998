"""The workflow on other people's robots: scripts in diagrams/ on the measurements in ../shared/data."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
DATA = ROOT / ".." / "shared" / "data"

pytestmark = pytest.mark.skipif(not DATA.is_dir(), reason="the real measurements, ../shared/data, are not here")


def answer(script, *options):
    command = [sys.executable, ROOT / "diagrams" / f"{script}.py", "--data", DATA, "--json", *options]
    done = subprocess.run(command, capture_output=True, text=True, timeout=900)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def smaller(error):
    return 1.0 - error["after"] / error["before"]


def test_emps_names_all_three_terms_and_replays_within_3_percent():
    found = answer("emps_drive")
    assert {"viscous_friction", "coulomb_friction", "force_offset"} == set(found["named"])
    errors = [step["relative_error"] for step in found["steps"]]
    assert len(errors) == 4 and errors[1] > 0.3 and errors[-1] < 0.03
    assert found["held_out"]["second half"]["after"] < 0.05


def check_omni3(found):
    assert found["verdict"] in ("named", "set")
    assert any(name.startswith("wheel_radius_errors") for name in found["named"])
    assert smaller(found["held_out"]["square"]) > 0.25
    assert smaller(found["held_out"]["joystick"]) > 0.15


@pytest.mark.slow
def test_omni3_odometry_from_four_circles():
    check_omni3(answer("optiodom_omni3", "--runs", "4"))


@pytest.mark.slow
def test_omni3_odometry_from_all_circles():
    check_omni3(answer("optiodom_omni3"))


@pytest.mark.slow
def test_diff_odometry_from_all_circles():
    found = answer("optiodom_diff")
    assert found["verdict"] in ("named", "set")
    assert any(name in text for text in found["named"] for name in ("track_error", "wheel_radius_error"))
    assert smaller(found["held_out"]["free"]) > 0.2


def test_regbot_motors_rub_without_a_stribeck_bump():
    found = answer("regbot_motor", "--runs", "4")
    assert "coulomb_friction" in found["named"] and "stribeck_friction" not in found["named"]
    assert smaller(found["held_out"]["same steps"]) > 0.4
    assert smaller(found["held_out"]["other steps"]) > 0.2
