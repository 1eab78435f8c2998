"""The scripts in diagrams/ run, and the pictures beside them show the Diagrams of today."""

import html
import json
import re
import runpy
import shutil
import sys
from pathlib import Path

import pytest

from drake_ispace.wiring.catalog import CATALOG
from measurements import ABSENT, DATA

FOLDER = Path(__file__).parents[1] / "diagrams"
#: Scripts on real measurements -> their least form; none where discrepancy/test_real_data.py runs it as it is.
REAL = {
    "optiodom_omni3": ["--runs", "1", "--effects", "wheel_toe", "marker_offset"],
    "optiodom_diff": ["--runs", "1", "--effects", "track_error"],
    "regbot_motor": None, "emps_drive": None,
}


@pytest.fixture
def started(monkeypatch, capsys, tmp_path):
    """`started(name, *arguments)` runs a script in a folder of its own: what it prints."""

    def started(name, *arguments):
        monkeypatch.syspath_prepend(FOLDER)
        monkeypatch.setattr(sys, "argv", [name, *arguments])
        runpy.run_path(shutil.copy(FOLDER / f"{name}.py", tmp_path), run_name="__main__")
        return capsys.readouterr().out

    return started


def content(picture):
    """What an SVG shows, wherever it is placed: fonts, and so all coordinates, differ from machine to machine."""
    found = re.findall(r"<(?:title|text)\b[^>]*>([^<]*)<", picture.read_text(encoding="utf-8"))
    return sorted(html.unescape(text) for text in found)


@pytest.mark.parametrize("name", CATALOG)
def test_the_script_prints_pose_and_speed_and_its_picture_is_up_to_date(started, tmp_path, name):
    printed = started(name, "--seconds", "0.5")
    assert "pose " in printed and "0.5 s simulated" in printed
    assert content(tmp_path / f"{name}.svg") == content(FOLDER / f"{name}.svg")


@pytest.mark.skipif(not DATA.is_dir(), reason=ABSENT)
@pytest.mark.parametrize("name", [pytest.param("optiodom_omni3", marks=pytest.mark.slow), "optiodom_diff"])
def test_the_script_on_real_measurements_answers(started, name):
    answer = json.loads(started(name, "--data", str(DATA), "--json", *REAL[name]))
    assert answer["verdict"] in ("named", "set", "incomplete", "none", "unknown") and answer["held_out"]


def test_there_is_a_script_for_every_diagram():
    others = {"shared", "real_data", "regbot_motors", "emps_carriage", *REAL}
    assert {script.stem for script in FOLDER.glob("*.py")} == {*CATALOG, *others}
