"""`drake-ispace explain`: what it hands on, prints, writes and refuses. What it finds is tested elsewhere."""

import inspect
import json
import os
from dataclasses import replace

import pytest

import answers
from drake_ispace.cli import explain as cli_explain
from drake_ispace.cli.app import main
from drake_ispace.explain import explain as explain_module
from drake_ispace.hiding import hide
from drake_ispace.scenario import load_scenario

MODEL = ["--model", "omni_multirate"]


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """A folder with short runs a, b, c of the omni robot, and p of the pendulum."""
    place = tmp_path_factory.mktemp("runs")
    runs = hide(load_scenario("omni_multirate"), "omni", {}, ["square", "circle", "circle"], seconds=6.0)
    for name, recording in zip("abc", runs.values(), strict=True):
        recording.save(place / name)
    (fallen,) = hide(load_scenario("pendulum_multirate"), "pendulum", {}, ["square"], seconds=0.5).values()
    fallen.save(place / "p")
    only = {"reference": runs["square"].channels["reference"]}
    replace(runs["square"], channels=only).save(place / "blind")
    return place


@pytest.fixture(autouse=True)
def folder(recorded, tmp_path, monkeypatch):
    """The current folder, with the runs in it."""
    for name in os.listdir(recorded):
        (tmp_path / name).symlink_to(recorded / name)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def asked(monkeypatch):
    """`explain` replaced by an answer at once; what it was asked."""
    found = {}

    def explain(model, runs, held_out=(), seed=0, tell=None, trust_data=False, most_s=None):
        tell("looking")
        found.update(model=model, runs=runs, held_out=held_out, seed=seed, most_s=most_s)
        return answers.named(model)

    monkeypatch.setattr(explain_module, "explain", explain)
    return found


def test_runs_model_and_seed_are_handed_on(asked, said):
    options = ["--held-out", "c", "--seed", "7", "--set", "omni.plant.mass_kg=8", "--most-seconds", "40"]
    said("explain", "a", "b", *MODEL, *options)
    assert [str(run.path) for run in asked["runs"]] == ["a", "b"]
    assert [str(run.path) for run in asked["held_out"]] == ["c"]
    assert (asked["seed"], asked["most_s"]) == (7, 40.0) and asked["model"].omni.plant.mass_kg == 8.0


def test_a_model_needs_no_path_on_which_it_could_be_simulated(asked, said):
    """The default heading is fixed, which two wheels cannot hold."""
    said("explain", "a", "--model", "velocity_base", "--set", "rover.plant.wheels=differential")
    assert [str(run.path) for run in asked["runs"]] == ["a"]


def test_several_runs_may_be_held_out_at_once(asked, said):
    said("explain", "a", *MODEL, "--held-out", "b", "c", "--seed", "1")
    assert len(asked["runs"]) == 1 and len(asked["held_out"]) == 2


def test_for_people_it_prints_the_explanation(asked, said):
    text = said("explain", "a", *MODEL)
    assert text == f"{answers.named(load_scenario('omni_multirate'))}\n"


def test_json_is_the_explanation_as_data(asked, document, folder):
    data = document("explain", "a", *MODEL)
    assert data == answers.named(load_scenario("omni_multirate")).to_data()
    keys = {"verdict", "effects", "detection", "localization", "untestable", "gap", "model", "seconds"}
    assert keys <= set(data) and {row["runs"] for row in data["gap"]} == {"held_out", "training"}
    assert sorted(os.listdir(folder)) == ["a", "b", "blind", "c", "p"]  # nothing is written without --out


def test_out_is_a_folder_with_page_model_and_the_same_data(asked, document, said, folder):
    data = document("explain", "a", *MODEL, "--out", "new/report")
    assert data["model"] == "new/report/model.yaml"
    assert json.loads((folder / "new/report/explanation.json").read_text()) == data
    assert load_scenario(data["model"]).omni.effects == {"coulomb_friction": {"torque_n_m": 0.01}}
    assert (folder / "new/report/index.html").is_file() and os.listdir("new") == ["report"]
    said("explain", "a", *MODEL, "--out", "new/report")  # a second one replaces it
    assert os.listdir("new") == ["report"]


def test_an_explanation_that_fails_leaves_nothing(monkeypatch, folder):
    def fail(*arguments, **named):
        raise KeyboardInterrupt

    monkeypatch.setattr(explain_module, "explain", fail)
    with pytest.raises(SystemExit) as stopped:
        main(["explain", "a", *MODEL, "--out", "report"])
    assert stopped.value.code == 130 and not (folder / "report").exists()
    assert sorted(os.listdir(folder)) == ["a", "b", "blind", "c", "p"]


# What is wrong -> arguments, and parts of the sentence.
REFUSED = {
    "nothing": (MODEL, ["expected the folder of at least one run"]),
    "no_model": (["a"], ["--model"]),
    "no_such_run": (["a", "nowhere", *MODEL], ["nowhere", "expected the folder of a run"]),
    "no_such_held_out_run": (["a", *MODEL, "--held-out", "nowhere"], ["nowhere", "expected the folder of a run"]),
    "twice": (["a", "b", "./a", *MODEL], ["RUN a: is named twice", "different runs"]),
    "held_out_too": (["a", "b", *MODEL, "--held-out", "b"], ["--held-out b: is named twice", "not fitted to"]),
    "another_robot": (["p", *MODEL], ["p:", "robot 'pendulum'", "expected omni"]),
    "another_robot_held_out": (["a", *MODEL, "--held-out", "p"], ["p:", "robot 'pendulum'", "expected omni"]),
    "two_robots": (["a", "p", "--model", "shared_space"], ["p:", "robot 'pendulum'", "expected 'omni' as a"]),
    "no_channel": (["blind", *MODEL], ["blind", "none of the channels encoder, kinect"]),
    "no_such_model": (["a", "--model", "omni_multirat"], ["'omni_multirat'", "did you mean 'omni_multirate'?"]),
    "no_such_diagram": (["a", *MODEL, "--set", "diagram=omni"], ["no Diagram 'omni'"]),
    "seed": (["a", *MODEL, "--seed", "-1"], ["--seed", "expected at least 0", "-1"]),
    "out_is_a_file": (["a", *MODEL, "--out", "a/recording.yaml"], ["recording.yaml", "expected a folder"]),
    "out_is_a_run": (["a", *MODEL, "--out", "b"], ["b: holds something else than an explanation"]),
}


@pytest.mark.parametrize("arguments, parts", REFUSED.values(), ids=REFUSED.keys())
def test_bad_arguments_are_refused(refused, folder, arguments, parts):
    message = refused("explain", *arguments)
    for part in parts:
        assert part in message
    assert sorted(os.listdir(folder)) == ["a", "b", "blind", "c", "p"]


def test_as_much_is_used_as_from_python():
    signatures = map(inspect.signature, (cli_explain.explain, explain_module.explain))
    command, function = (signature.parameters for signature in signatures)
    assert command["most_seconds"].default == function["most_s"].default
