"""Files to begin with, and the notebook: they work as they are."""

import contextlib
import io
import json
import runpy
from pathlib import Path

import pytest

from drake_ispace.robots.robot_file import robot_of

ROOT = Path(__file__).parents[2]


def test_a_new_robot_file_is_a_robot(said, tmp_path):
    said("new", "robot", "cart", "--out", tmp_path / "cart.yaml")
    robot = robot_of(tmp_path / "cart.yaml")
    assert robot.name == "cart" and robot.doubts() == [] and len(robot.wheels) == 2


@pytest.mark.slow
def test_a_new_effect_is_found_in_its_own_simulation(said, tmp_path):
    said("new", "effect", "torque_fade", "--out", tmp_path / "torque_fade.py")
    with contextlib.redirect_stdout(io.StringIO()) as printed:
        runpy.run_path(str(tmp_path / "torque_fade.py"))["main"]()
    assert "torque_fade" in printed.getvalue().splitlines()[1]


@pytest.mark.parametrize("words, message", [
    (["robot", "my robot"], "letters, digits and _"), (["effect", "1st"], "letters, digits and _"),
    (["plant", "cart"], "plant"),
])
def test_a_name_that_is_none_is_refused(refused, words, message):
    assert message in refused("new", *words)


def test_a_file_that_is_there_is_kept(refused, tmp_path):
    (tmp_path / "cart.yaml").write_text("mine")
    assert "is there already" in refused("new", "robot", "cart", "--out", tmp_path / "cart.yaml")
    assert (tmp_path / "cart.yaml").read_text() == "mine"


@pytest.mark.slow
def test_the_notebook_runs_from_its_first_cell_to_its_last(monkeypatch):
    monkeypatch.chdir(ROOT)
    cells = json.loads((ROOT / "examples" / "three_csv_files.ipynb").read_text())["cells"]
    names = {}
    with contextlib.redirect_stdout(io.StringIO()) as printed:
        for cell in cells:
            if cell["cell_type"] == "code":
                exec(compile("".join(cell["source"]), "cell", "exec"), names)
    assert "radius" in names["effect"].name and "clock camera" in printed.getvalue()
    assert names["effect"].parameters["share"].estimate == pytest.approx(0.04, abs=0.004)
