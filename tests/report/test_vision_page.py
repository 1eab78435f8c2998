"""The page of what the room sees."""

import json

import cv2
import numpy as np
import pytest

from drake_ispace.blocks.errors import InputError
from drake_ispace.cli.vision import vision

PICTURES = ("views", "thresholds", "depth", "configuration", "tracking")


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    folder = tmp_path_factory.mktemp("vision")
    vision(out=folder, seconds=1.0)
    return folder / "index.html", json.loads((folder / "vision.json").read_text())


@pytest.mark.parametrize("name", PICTURES)
def test_every_picture_shows_something(page, name):
    assert cv2.imread(str(page[0].with_name(f"{name}.png"))).std() > 10.0


def test_the_page_shows_every_picture_and_nothing_else(page):
    text = page[0].read_text()
    assert all(f'src="{name}.png"' in text for name in PICTURES) and text.count("<img") == len(PICTURES)


def test_poses_on_the_page_are_right(page):
    for name, pose in page[1]["true_poses"].items():
        assert page[1]["poses"][name] == pytest.approx(pose, abs=6e-3)


def test_obstacles_on_the_page_are_right(page):
    heights = sorted(obstacle[5] for obstacle in page[1]["obstacles"])
    assert heights == pytest.approx([0.15, 0.25, 0.35], abs=5e-3) and 0.7 < page[1]["free_share"] < 0.95


@pytest.mark.parametrize("seconds, seed", [(0.0, 0), (1e9, 0), (np.nan, 0), (2.0, -1)])
def test_bad_options_are_refused(seconds, seed):
    with pytest.raises(InputError, match="--seconds, --seed: expected"):
        vision(seconds=seconds, seed=seed)
