"""The folder that `explain --out` writes: every verdict has a whole page, and the pictures show something."""

import os
import re
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

import answers
from drake_ispace.alignment import to_recording
from drake_ispace.explain.answer.explanation import ControllerCheck
from drake_ispace.files.places import CONTENTS
from drake_ispace.hiding import hide
from drake_ispace.report.closed_loop import closed_loop
from drake_ispace.report.dead_reckoning import reckoned
from drake_ispace.report.explain_page import changed_lines, new_blocks, write_explanation
from drake_ispace.report.pictures.explain_plots import distances
from drake_ispace.rollout.engine import simulate_compiled
from drake_ispace.scenario import load_scenario
from drake_ispace.wiring.catalog import build_diagram

FRICTION = {"coulomb_friction": {"torque_n_m": 0.01}}
DATA = {"explanation.json", "index.html", "before.svg"}


@pytest.fixture(scope="module")
def model():
    return load_scenario("omni_multirate")


@pytest.fixture(scope="module")
def runs(model):
    runs = hide(model, "omni", FRICTION, ["square", "circle"], seed=3, seconds=6.0)
    return [replace(recording, path=Path(name)) for name, recording in runs.items()]


@pytest.fixture(scope="module")
def written(model, runs, tmp_path_factory):
    """Verdict -> folder."""
    place = tmp_path_factory.mktemp("pages")
    found = {
        "named": answers.named(model), "set": answers.one_of_a_set(model), "none": answers.nothing(),
        "unknown": answers.unknown(), "incomplete": answers.incomplete(model),
    }
    for name, explanation in found.items():
        write_explanation(explanation, model, runs[:1], runs[1:], place / name)
    return {name: place / name for name in found}


def text_of(folder):
    return (folder / "index.html").read_text(encoding="utf-8")


def test_each_verdict_has_the_files_that_it_can_have(written):
    more = {"model.yaml", "after.svg", "residuals.png"}
    for name, folder in written.items():
        named = name in ("named", "set", "incomplete")
        assert set(os.listdir(folder)) == DATA | {"path.png", CONTENTS} | (more if named else set())
    assert set(os.listdir(written["none"].parent)) == set(written)  # nothing beside


@pytest.mark.parametrize("verdict", ["named", "set", "none", "unknown", "incomplete"])
def test_a_page_needs_no_other_file(written, verdict):
    page = text_of(written[verdict])
    sources = re.findall(r'src="([^"]*)"', page)
    pictures = set(os.listdir(written[verdict])) - {"explanation.json", "index.html", "model.yaml", CONTENTS}
    assert len(sources) == len(pictures)
    assert all(source.startswith("data:image/") for source in sources) and "href" not in page
    assert page.count("<table") == page.count("</table>") and page.rstrip().endswith("</html>")


def test_the_page_tells_effect_interval_and_gap(written):
    page = text_of(written["named"])
    assert "<h1>The model lacks coulomb friction</h1>" in page
    assert "0.0097 to 0.0103" in page and "98 % of the gap closed." in page and "below -100 to 100 %" in page
    assert page.index("What is missing") < page.index("Where it shows") < page.index("<h2>The gap")
    assert page.index("<h2>The gap") < page.index("The new scenario")


def test_a_set_names_its_rivals_and_warnings_come_first(written):
    page = text_of(written["set"])
    assert "<code>stribeck_friction</code>" in page and "slow reversals" in page and "on a bound" in page
    assert "got worse &lt;b&gt;" in page and page.index("got worse") < page.index("What is missing")
    assert "reverse slowly" in page


def test_no_effect_and_an_unknown_one_say_so(written):
    assert "nothing beyond noise (p = 0.4)" in text_of(written["none"]) and "gyro_bias" in text_of(written["none"])
    page = text_of(written["unknown"])
    assert "a force that goes with place" in page and "from 3.1 s on" in page and "12.5 standard deviations" in page


def test_an_incomplete_answer_says_what_is_left_and_marks_its_model(written):
    page, model = text_of(written["incomplete"]), (written["incomplete"] / "model.yaml").read_text()
    assert "coulomb friction, and something more</h1>" in page and "41 % goes with speed" in page
    assert page.index("What is missing") < page.index("What is left") < page.index("Where it shows")
    assert model.startswith("# incomplete: has coulomb_friction") and load_scenario(
        str(written["incomplete"] / "model.yaml")).omni.effects == FRICTION


def test_no_percentage_where_the_gap_is_too_small(model, tmp_path, runs):
    small = answers.named(model, gap=answers.GAP[1:2])
    write_explanation(small, model, runs[:1], runs[1:], tmp_path / "page")
    assert "small beside what noise may leave" in text_of(tmp_path / "page") and "% of the gap" not in str(small)


def test_a_model_whose_own_path_its_wheels_refuse_has_a_page_all_the_same(tmp_path):
    rover = load_scenario("velocity_base", ["rover.plant.wheels=differential"])
    write_explanation(answers.nothing(), rover, [], [], tmp_path / "page")
    assert "the Diagram could not be drawn: rover.trajectory.heading: expected tangent" in text_of(tmp_path / "page")


def test_the_new_model_is_a_few_lines_that_load(written, model):
    file = written["named"] / "model.yaml"
    assert load_scenario(str(file)).omni.effects == FRICTION and len(file.read_text().splitlines()) == 5
    assert "coulomb_friction" in (written["named"] / "after.svg").read_text()
    assert "coulomb_friction" not in (written["named"] / "before.svg").read_text()


def test_only_what_is_new_is_marked_where_the_model_had_settings():
    model = load_scenario("omni_multirate", ["omni.plant.mass_kg=8", "omni.effects.weak_motor.loss=0.1"])
    lines = changed_lines(model, answers.named(model))
    assert [line.strip() for kind, line in lines if kind == "+"] == ["coulomb_friction:", "torque_n_m: 0.01"]
    assert any("mass_kg: 8" in line for kind, line in lines if kind == " ")


def test_an_effect_of_the_plant_colours_the_plant(model):
    explanation = answers.named(model)
    diagram = build_diagram(explanation.model)
    assert new_blocks(explanation, "omni", diagram) == ["omni_coulomb_friction"]
    (effect,) = explanation.effects
    heavy = replace(explanation, effects=[replace(effect, name="mass_error")])
    assert new_blocks(heavy, "omni", diagram) == ["omni_plant"]


@pytest.mark.parametrize("picture", ["path.png", "residuals.png"])
def test_plots_show_something(written, picture):
    image = cv2.imread(str(written["named"] / picture))
    assert image.std() > 10.0 and min(image.shape[:2]) > 150


# ------------------------------------------------------------------------------------------- the loop closed once more


@pytest.mark.parametrize("name, kind", [
    ("omni_multirate", "square"), ("omni_multirate", "circle"), ("pendulum_multirate", "square"),
    ("pendulum_multirate", "figure_eight"),
])
def test_the_loop_closed_on_a_recorded_reference_is_the_run_again(name, kind):
    robot = name.partition("_")[0]
    model = load_scenario(name, [f"{robot}.trajectory.kind={kind}", "seconds=6", f"{robot}.trajectory.radius_m=0.5"])
    recording = to_recording(simulate_compiled(model), robot)
    again = closed_loop(load_scenario(name), robot, recording)
    assert np.sqrt(np.mean(distances(recording.channels["kinect"], again)[1] ** 2)) < 3e-3  # a pixel


def test_the_true_effect_brings_the_simulation_to_the_measurement(model, runs):
    right = answers.named(model).model
    for recording in runs:
        rms = [
            np.sqrt(np.mean(distances(recording.channels["kinect"], closed_loop(one, "omni", recording))[1] ** 2))
            for one in (model, right)
        ]
        assert rms[1] < 0.7 * rms[0]


def test_a_robot_with_another_controller_gets_a_dead_reckoned_path(model, runs, tmp_path):
    foreign = answers.named(model, controller=ControllerCheck(0.5, 1.0))
    assert write_explanation(foreign, model, runs[:1], runs[1:], tmp_path / "out").closed_loop is None
    page = text_of(tmp_path / "out")
    assert "dead-reckoned by the measured wheels" in page and "<code>circle</code>" in page
    before, after = re.search(r"([\d.]+) mm rms from the measured ones as given, ([\d.]+) mm", page).groups()
    assert float(before) == pytest.approx(float(after), abs=1.0)  # wheels turn as measured, friction or not


def test_dead_reckoned_paths_keep_the_clock_of_the_prediction(model, runs):
    """Of a recording that starts late."""
    late = replace(runs[0], channels={
        name: replace(channel, t=channel.t + 7.0) for name, channel in runs[0].channels.items()
    })
    seen, path = reckoned([model], late)
    assert seen.t[0] < 0.2 and np.sqrt(np.mean(distances(seen, path)[1] ** 2)) < 0.01


def test_a_reference_that_cannot_be_followed_gives_a_dead_reckoned_path(model, runs, tmp_path):
    turning = runs[0].channels["reference"]
    turning = replace(turning, values=turning.values + np.linspace(0, 3, len(turning.t))[:, None] * [0, 0, 1])
    recording = replace(runs[0], channels={**runs[0].channels, "reference": turning})
    assert closed_loop(model, "omni", recording) is None
    without = {name: channel for name, channel in runs[0].channels.items() if name != "reference"}
    recording = replace(runs[0], channels=without)
    write_explanation(answers.named(model), model, [recording], [], tmp_path / "out")
    assert "path.png" in os.listdir(tmp_path / "out")
    assert "dead-reckoned by the measured wheels" in text_of(tmp_path / "out")
