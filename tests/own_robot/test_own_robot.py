"""A robot of one's own is one file and one scenario, and every command knows it: nothing in the package names it."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

HERE = Path(__file__).parent
SCENARIO, SIZE = HERE / "cart.yaml", 0.02
#: The folder holds the robot's file and what an installed package would say of its entry points.
ENVIRONMENT = os.environ | {"PYTHONPATH": os.pathsep.join([str(HERE.parents[1] / "src"), str(HERE)])}


def command(*arguments):
    """What `drake-ispace ... --json` prints."""
    done = subprocess.run(
        [sys.executable, "-m", "drake_ispace", *map(str, arguments), "--json"], capture_output=True, text=True,
        env=ENVIRONMENT,
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@pytest.fixture(scope="module")
def hidden(tmp_path_factory):
    """Two runs of a cart whose wheels have friction that its model knows nothing of."""
    folder = tmp_path_factory.mktemp("cart") / "hidden"
    command(
        "hide", SCENARIO, "--effect", f"coulomb_friction:torque_n_m={SIZE}", "--seconds", "8", "--runs", "2", "--out",
        folder,
    )
    return folder


def test_it_is_one_short_file_and_one_scenario():
    assert len((HERE / "cart.py").read_text(encoding="utf-8").splitlines()) <= 150
    assert {path.suffix for path in HERE.iterdir() if path.stem == "cart"} == {".py", ".yaml"}


def test_it_is_simulated_as_it_is_compiled():
    assert command("parity", SCENARIO, "--seconds", "1")["max_abs_difference"] == 0.0


@pytest.mark.slow
def test_it_follows_its_path():
    run = command("simulate", SCENARIO, "--seconds", "20")
    assert not run["diverged"]
    assert run["final"]["x"] == pytest.approx(-0.6, abs=0.03) and run["final"]["y"] == pytest.approx(-0.6, abs=0.03)


def test_it_is_drawn(tmp_path):
    assert "cart_plant" in command("draw", SCENARIO, "--out", tmp_path / "cart.svg")["dot"]


@pytest.mark.slow
def test_an_effect_hidden_in_it_is_found(hidden):
    found = command("explain", hidden / "square", hidden / "circle", "--model", SCENARIO)
    assert [effect["name"] for effect in found["effects"]] == ["coulomb_friction"]
    size = found["effects"][0]["parameters"]["torque_n_m"]
    assert size["ci90"][0] <= SIZE <= size["ci90"][1]


@pytest.mark.slow
def test_runs_of_another_robot_are_refused(hidden, tmp_path):
    done = subprocess.run(
        [sys.executable, "-m", "drake_ispace", "explain", hidden / "square", "--model", "omni_multirate"],
        capture_output=True, text=True, env=ENVIRONMENT,
    )
    assert done.returncode == 2 and "the run is of robot 'cart', expected omni" in done.stderr
