"""The campaigns of docs/identification.md, small."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

FOLDER = Path(__file__).parents[2] / "benchmarks"
pytestmark = pytest.mark.slow


def quick(script):
    done = subprocess.run(
        [sys.executable, FOLDER / f"{script}.py", "--quick", "--json"], capture_output=True, text=True, timeout=900,
        env=os.environ | {"PYTHONPATH": str(FOLDER.parent / "src")},
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_identification_table():
    data = quick("identification_table")
    error = data["E_er"]
    assert error["iv"] < 5.0 and error["pem"] < 5.0 and error["armaxd"] < 0.3 * error["arx"]
    for row in data["friction"].values():
        assert row["coulomb"] == pytest.approx(0.0061, rel=0.05) and row["viscous"] == pytest.approx(0.0106, rel=0.05)
    assert data["online"]["idle_finite"]


def test_friction_compensation():
    data = quick("friction_compensation")
    assert data["response"]["ARMAXD (Table 4.2) = true"]["tilt_ratio"] < 0.75
    assert data["over_compensation"]["1.5"]["said_over"] == 1.0 and data["over_compensation"]["1"]["said_over"] == 0.0
