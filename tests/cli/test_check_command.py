"""`drake-ispace check`: what it prints, writes, repairs and refuses."""

import json
from dataclasses import replace

import pytest

from drake_ispace.files.recording import load
from drake_ispace.hiding import hide


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    """Folders of two sound runs of the omni robot, and of the same with a camera in millimetres."""
    place = tmp_path_factory.mktemp("runs")
    for name, run in hide("omni_multirate", "omni", {}, ["square", "figure_eight"], 4, 10.0).items():
        run.save(place / "sound" / name)
        kinect = run.channels["kinect"]
        metres = kinect.values.copy()
        metres[:, :2] *= 1e3
        run = replace(run, channels=run.channels | {"kinect": replace(kinect, values=metres)})
        run.save(place / "mm" / name)
    return place


def runs_in(folder):
    return [str(path) for path in sorted(folder.iterdir())]


def test_sound_runs_agree(folders, said):
    assert said("check", *runs_in(folders / "sound")) == "The recordings agree with each other\n"


def test_a_finding_is_a_sentence_with_its_repair(folders, said):
    out = said("check", *runs_in(folders / "mm"), "--model", "omni_multirate")
    assert "places in mm" in out and "kinect: x = 0.001 x, y = 0.001 y" in out


def test_without_a_model_the_one_that_told_is_named(folders, said):
    out = said("check", *runs_in(folders / "mm"))
    assert out.splitlines()[-1].startswith("compared with the model omni_multirate, which the run names")


@pytest.mark.slow
def test_json_is_one_document_of_rows(folders, said):
    (row,) = json.loads(said("check", *runs_in(folders / "mm"), "--json"))["data"]
    assert row["fault"] == "wrong_unit" and row["run"] == "all" and row["channel"] == "kinect"
    assert row["from_s"] is None and row["drop_in_deviance"] > 12.0 and row["repair"] and "rivals" in row


@pytest.mark.slow
def test_repaired_copies_agree_and_the_runs_stay_as_they_are(folders, here, said):
    before = [path.read_bytes() for path in sorted((folders / "mm").rglob("*.csv"))]
    said("check", *runs_in(folders / "mm"), "--repair", "repaired")
    assert before == [path.read_bytes() for path in sorted((folders / "mm").rglob("*.csv"))]
    assert said("check", *runs_in(here / "repaired")) == "The recordings agree with each other\n"
    assert "wrong_unit" in load(here / "repaired" / "square").notes


@pytest.mark.slow
def test_a_page_shows_each_finding(folders, here, said):
    said("check", *runs_in(folders / "mm"), "--out", "page")
    page = (here / "page" / "index.html").read_text(encoding="utf-8")
    assert "wrong_unit" in page and page.count("<img") == 1
    assert (here / "page" / "finding_1.png").stat().st_size > 10_000
    assert len(json.loads((here / "page" / "findings.json").read_text(encoding="utf-8"))) == 1


@pytest.mark.slow
def test_copies_never_replace_the_runs(folders, refused):
    runs = runs_in(folders / "mm")
    for place in (folders / "mm", runs[0]):
        assert "is one of the runs or in one" in refused("check", *runs, "--repair", str(place))


def test_explain_blames_the_data_first(folders, here, said):
    asked = ["--model", "omni_multirate", "--json", "--out", "page"]
    answer = json.loads(said("explain", *runs_in(folders / "mm"), *asked))
    assert answer["verdict"] == "data" and answer["effects"] == [] and answer["data"][0]["fault"] == "wrong_unit"
    assert "places in mm" in (here / "page" / "index.html").read_text(encoding="utf-8")
