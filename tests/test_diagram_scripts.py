"""The scripts in diagrams/ run, and the pictures beside them show the Diagrams of today."""

import html
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from drake_ispace.wiring.catalog import CATALOG

FOLDER = Path(__file__).parents[1] / "diagrams"
#: Scripts on real measurements, tested in discrepancy/test_real_data.py.
REAL = ("optiodom_omni3", "optiodom_diff", "regbot_motor", "emps_drive")


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """Every script run for 0.5 s in a copy of the folder, all at once: name -> (what it printed, its picture)."""
    copy = tmp_path_factory.mktemp("diagrams")
    for script in FOLDER.glob("*.py"):
        shutil.copy(script, copy)
    started = {
        name: subprocess.Popen(
            [sys.executable, copy / f"{name}.py", "--seconds", "0.5"], stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT, text=True,
        ) for name in CATALOG
    }
    printed = {name: process.communicate(timeout=300)[0] for name, process in started.items()}
    return {name: (text, copy / f"{name}.svg") for name, text in printed.items()}


def content(picture):
    """What an SVG shows, wherever it is placed: fonts, and so all coordinates, differ from machine to machine."""
    found = re.findall(r"<(?:title|text)\b[^>]*>([^<]*)<", picture.read_text(encoding="utf-8"))
    return sorted(html.unescape(text) for text in found)


@pytest.mark.parametrize("name", CATALOG)
def test_the_script_prints_pose_and_speed(runs, name):
    printed, _ = runs[name]
    assert "pose " in printed and "0.5 s simulated" in printed and "Traceback" not in printed


@pytest.mark.parametrize("name", CATALOG)
def test_the_committed_picture_is_up_to_date(runs, name):
    _, drawn = runs[name]
    assert content(drawn) == content(FOLDER / f"{name}.svg")


def test_there_is_a_script_for_every_diagram():
    others = {"shared", "real_data", "regbot_motors", "emps_carriage", *REAL}
    assert {script.stem for script in FOLDER.glob("*.py")} == {*CATALOG, *others}
