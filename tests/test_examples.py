"""The committed examples show what they are said to show, and the script beside them makes them."""

import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

import drake_ispace as di
from drake_ispace.room.room import Camera
from drake_ispace.vision.footage.frames import frames

FOLDER = Path(__file__).parents[1] / "examples"
CORNERS = ("81,69", "523,42", "601,424", "44,458")


def test_friction_is_identified_within_a_fifth(document):
    friction = document("identify", FOLDER / "friction_run", "--structure", "armaxd")["friction"]
    assert friction["coulomb_n_m"] == pytest.approx(0.0061, rel=0.2)
    assert friction["viscous_n_m_s"] == pytest.approx(0.0106, rel=0.2)


def test_both_robots_are_seen_in_every_frame(document):
    seen = [{robot["name"] for robot in frame["robots"]} for frame in document("locate", FOLDER / "room.mp4")["frames"]]
    assert seen == [{"omni", "pendulum"}] * 20


@pytest.mark.parametrize("words", [
    ["room.mp4", *(word for corner in CORNERS for word in ("--points", corner))],
    ["board.jpg", "--board", "7,6,0.15,-0.45,0.45,0"],
], ids=["tape", "chessboard"])
def test_the_camera_is_found_where_it_was_put(document, words):
    camera = document("calibrate", FOLDER / words[0], *words[1:])["space"]["camera"]
    assert camera["height_m"] == pytest.approx(Camera().height_m, abs=0.01)
    assert camera["foot_m"] == pytest.approx(Camera().foot_m, abs=0.01)


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """What the script writes today."""
    folder = tmp_path_factory.mktemp("examples")
    subprocess.run([sys.executable, FOLDER / "make.py", "--out", folder], check=True)
    return folder


@pytest.mark.slow
def test_the_script_makes_the_recording(made):
    committed, today = di.load(FOLDER / "friction_run"), di.load(made / "friction_run")
    assert today.settings == committed.settings and today.channels.keys() == committed.channels.keys()
    for name, channel in committed.channels.items():
        assert today.channels[name].values == pytest.approx(channel.values, abs=1e-6)


def pictures(folder):
    """The frames of the video, then the chessboard."""
    return [*(image for _, image in frames(folder / "room.mp4")), cv2.imread(str(folder / "board.jpg"))]


@pytest.mark.slow
def test_the_script_makes_the_pictures(made):
    for committed, today in zip(pictures(FOLDER), pictures(made), strict=True):
        assert np.abs(committed.astype(float) - today).mean() < 2.0
