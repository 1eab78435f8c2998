"""The campaign of planted mistakes in its smallest form; `python -m planted.campaign` runs all of it."""

import copy

import numpy as np
import pytest

from planted.bases import bases, simulated
from planted.campaign import looked_for, planted, planted_together, sound, totals
from planted.corruptions import CORRUPTIONS
from planted.files import Folder

NO_DATA = "needs the measurements of other people in ../shared/data"
FEW = ("encoder in degrees", "wheels 1 and 2 swapped", "camera in millimetres", "torque of the other sense",
       "angles wrapped to 0 to 2 pi", "clock of kinect off by -2.0 s", "camera outliers", "encoder of another run",
       "a robot with wheels elsewhere", "headings of a compass, in degrees")


@pytest.fixture(scope="module")
def originals(tmp_path_factory):
    place = tmp_path_factory.mktemp("sound")
    for i, run in enumerate(simulated("omni", 12.0, 30, runs=2)):
        run.save(place / str(i))
    return [place / "0", place / "1"]


def test_there_are_seventy_mistakes_and_each_has_names():
    assert len(CORRUPTIONS) >= 70 and all(mistake.expected for mistake in CORRUPTIONS.values())


@pytest.mark.first_case
@pytest.mark.parametrize("name", FEW)
def test_a_planted_mistake_is_found_under_its_own_name(originals, tmp_path, name):
    result = planted("omni", "omni_multirate", originals, name, tmp_path)
    assert result.shown and result.first and not result.error, result.found


@pytest.mark.slow
def test_wheels_elsewhere_are_told_where_swapped_ones_may_be_a_mirrored_room(tmp_path):
    if not (chosen := bases(["diff"], 20.0, 100)):
        pytest.skip(NO_DATA)
    model, runs = chosen["diff"]
    for i, run in enumerate(runs):
        run.save(tmp_path / str(i))
    paths = [tmp_path / str(i) for i in range(len(runs))]
    assert planted("diff", model, paths, "a robot with wheels elsewhere", tmp_path / "planted").first


def test_every_mistake_changes_the_files_that_it_fits(originals, tmp_path):
    before, beside = Folder(originals[0]), Folder(originals[1])
    for name, mistake in CORRUPTIONS.items():
        folder, other = copy.deepcopy((before, beside))
        if mistake.channel in folder.tables and (not mistake.robots or "omni" in mistake.robots):
            mistake.change(folder, other)
            same = all(
                np.array_equal(before.tables[channel][1], folder.tables[channel][1]) for channel in before.tables
            )
            assert not same, name


def test_the_totals_count_what_can_be_seen(originals):
    seen = looked_for("omni", "omni_multirate", originals, "none", {"wrong_unit"}, True)
    assert totals([seen])["nothing found"] == 1 and totals([seen])["first"] == 0.0


@pytest.mark.slow
def test_two_planted_mistakes_are_both_found(originals, tmp_path):
    names = ["camera in inches", "headings off by 90 degrees"]
    found = planted_together("omni_multirate", originals, names, tmp_path)
    assert sorted(found) == ["heading_offset", "wrong_unit"]


@pytest.mark.slow
def test_sound_sets_have_no_finding():
    assert sound(2, 40) == 0


@pytest.mark.hidden
@pytest.mark.parametrize("base", ["omni", "pendulum", "omni3", "diff"])
def test_planted_mistakes_are_found(base, tmp_path):
    chosen = bases([base], 20.0, 100)
    if not chosen:
        pytest.skip(NO_DATA)
    model, runs = chosen[base]
    for i, run in enumerate(runs):
        run.save(tmp_path / "sound" / str(i))
    paths = [tmp_path / "sound" / str(i) for i in range(len(runs))]
    results = [planted(base, model, paths, name, tmp_path / "planted") for name in CORRUPTIONS]
    shares = totals([result for result in results if result is not None])
    assert shares["first"] >= 0.95 and shares["among two"] >= 0.95 and shares["tracebacks"] == 0
