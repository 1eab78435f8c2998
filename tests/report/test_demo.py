"""The demonstration: a page that is whole, whose pictures are there, and whose numbers were computed."""

import json
import os
import re
from html.parser import HTMLParser
from unittest import mock

import pytest

from drake_ispace.blocks.errors import InputError
from drake_ispace.files.places import CONTENTS
from drake_ispace.report import demo as demo_module
from drake_ispace.report.demo import write_demo

PIXEL = b"\x89PNG"
LINES = ["hidden: a slope", "found: a slope", "gap: 33 mm before, 3 mm after: 99 % closed"]
EMPTY = {"meta", "img", "br", "hr", "link", "input"}


class Page(HTMLParser):
    """Pictures, table cells and text of a page; refuses tags that are not closed in order."""

    def __init__(self, text):
        super().__init__()
        self.open, self.pictures, self.rows, self.text = [], [], [], ""
        self.feed(text)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag, attributes):
        if tag not in EMPTY:
            self.open.append(tag)
        if tag == "img":
            assert dict(attributes)["alt"]
            self.pictures.append(dict(attributes)["src"])
        if tag == "tr":
            self.rows.append([])
        if tag == "td":
            self.rows[-1].append("")

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.text += data
        if self.open[-1:] == ["td"]:
            self.rows[-1][-1] += data


def write_quickly(folder, seed, tell):
    """In the place of `write_hidden_effect`, which takes a minute and has tests of its own."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "explained_path.png").write_bytes(PIXEL)
    (folder / "explained.html").write_text("<p>the answer</p>")
    shown = {
        "hidden": ["floor_tilt: slope_x_rad = 0.03"], "found": ["floor_tilt: slope_x_rad = 0.0301 (0.029 to 0.031)"],
        "gap": "33 mm before, 3 mm after: 99 % closed",
        "path": {"run": "square", "before_m": 0.0331, "after_m": 0.0033},
        "pictures": ["explained_path.png"], "seconds": 61.0,
    }
    return shown, {"hidden": {}, "explanation": {}, "path": None, "seed": seed, "lines": LINES}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """The folder of a demonstration of two simulated seconds, and the folder around it."""
    around = tmp_path_factory.mktemp("around")
    with mock.patch.object(demo_module, "write_hidden_effect", write_quickly):
        write_demo(around / "demo", 2.0, 3, lambda title: None)
    return around / "demo"


@pytest.fixture(scope="module")
def page(folder):
    return Page((folder / "index.html").read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def data(folder):
    return json.loads((folder / "demo.json").read_text(), parse_constant=pytest.fail)


def test_every_picture_is_there_and_no_other_file(folder, page):
    assert len(page.pictures) >= 6 and len(set(page.pictures)) == len(page.pictures)
    assert sorted(os.listdir(folder)) == sorted([*page.pictures, "explained.html", "index.html", "demo.json", CONTENTS])


def test_every_picture_is_what_its_name_says(folder, page):
    for name in page.pictures:
        start = {".png": b"\x89PNG", ".svg": b"<?xml"}[os.path.splitext(name)[1]]
        assert (folder / name).read_bytes().startswith(start)


def test_nothing_is_left_beside(folder):
    assert os.listdir(folder.parent) == ["demo"]


def test_the_page_needs_nothing_from_elsewhere(folder):
    assert not re.search(r"(src|href)=\"?(https?:)?//", (folder / "index.html").read_text(encoding="utf-8"))


def test_every_run_has_a_row_with_its_numbers(page, data):
    shown = [row for row in page.rows if len(row) > 1]
    names = [key.partition("/")[2] for key in data["runs"]]
    assert {row[0] for row in shown} == set(names)
    for (_, metrics), row in zip(data["runs"].items(), shown, strict=True):
        for key, cell in zip(
            ("rms_position_error_m", "rms_cross_track_m", "mean_lag_m", "final_error_m"), row[1:5], strict=True
        ):
            value = metrics[key]
            assert cell == ("–" if value is None else f"{1e3 * value:.1f} mm")


def test_the_totals_are_those_of_the_runs(page, data):
    assert data["seed"] == 3 and "seed 3" in page.text
    assert data["simulated_s"] == pytest.approx(2.0 * 9, abs=0.1)  # 3 + 3 + 2 runs and the one that two robots share
    assert f"Simulated {data['simulated_s']:g} s" in page.text


def test_the_first_thing_shown_is_the_hidden_effect_and_what_was_found(page, data):
    assert page.pictures[0] == "explained_path.png" and page.text.index("disagree") < page.text.index("omni robot on a")
    said = [row[0] for row in page.rows if len(row) == 1]
    assert said == [
        "floor_tilt: slope_x_rad = 0.03",
        "floor_tilt: slope_x_rad = 0.0301 (0.029 to 0.031)",
        "33 mm before, 3 mm after: 99 % closed",
        "33.1 mm before, 3.3 mm after",
    ]
    assert data["explained"]["seed"] == 3


@pytest.mark.slow
def test_a_second_demonstration_replaces_the_first(folder, tmp_path, monkeypatch, document):
    monkeypatch.setattr(demo_module, "_COMPARISONS", demo_module._COMPARISONS[:1])
    monkeypatch.setattr(demo_module, "write_hidden_effect", write_quickly)
    (tmp_path / "demo").mkdir()
    for name in ("index.html", "demo.json"):
        (tmp_path / "demo" / name).write_text("old")
    (tmp_path / "demo" / CONTENTS).write_text("demo.json\nindex.html\n")
    printed = document("demo", "--seconds", "0.2", "--out", tmp_path / "demo")
    assert printed.pop("page") == str(tmp_path / "demo" / "index.html")
    assert json.loads((tmp_path / "demo" / "demo.json").read_text()) == printed
    assert os.listdir(tmp_path) == ["demo"] and "old" not in (tmp_path / "demo" / "index.html").read_text("utf-8")[:3]


def test_the_terminal_ends_with_what_was_hidden_what_was_found_and_the_gap(tmp_path, monkeypatch, said):
    monkeypatch.setattr(demo_module, "_COMPARISONS", demo_module._COMPARISONS[:1])
    monkeypatch.setattr(demo_module, "write_hidden_effect", write_quickly)
    assert said("demo", "--seconds", "0.2", "--out", tmp_path / "demo").splitlines()[-3:] == LINES


def test_a_demonstration_that_fails_leaves_the_former_one(tmp_path, monkeypatch):
    def fail(*arguments):
        raise InputError("no Graphviz")

    monkeypatch.setattr(demo_module, "_COMPARISONS", demo_module._COMPARISONS[:1])
    monkeypatch.setattr(demo_module, "write_hidden_effect", write_quickly)
    monkeypatch.setattr(demo_module, "draw", fail)
    (tmp_path / "demo").mkdir()
    (tmp_path / "demo" / CONTENTS).write_text("")
    with pytest.raises(InputError, match="no Graphviz"):
        write_demo(tmp_path / "demo", 0.2, None, lambda title: None)
    assert os.listdir(tmp_path) == ["demo"] and os.listdir(tmp_path / "demo") == [CONTENTS]
