"""Recordings with hidden effects: the effect is in them, and nothing in them says which."""

import hashlib
import json
import os
from pathlib import Path

import numpy as np
import pytest

from drake_ispace.blocks.errors import InputError
from drake_ispace.hiding import MOTIONS, hide, save_hidden
from drake_ispace.robots.recordings import load
from drake_ispace.scenario import load_scenario
from noisy import NOISE_AND_SLIP

FRICTION = {"coulomb_friction": {"torque_n_m": 0.02}}


@pytest.fixture(scope="module")
def model():
    return load_scenario("omni_multirate")


@pytest.fixture(scope="module")
def runs(model):
    return hide(model, "omni", FRICTION, ["square", "circle", "square"], seed=5, seconds=3.0)


def test_every_motion_is_a_run_and_a_repeated_one_differs_in_its_noise(runs):
    assert list(runs) == ["square", "circle", "square_3"]
    first, again = runs["square"], runs["square_3"]
    assert np.array_equal(first.channels["reference"].values, again.channels["reference"].values)
    assert not np.array_equal(first.channels["encoder"].values, again.channels["encoder"].values)


def test_nothing_in_a_recording_tells_the_answer(runs, tmp_path):
    save_hidden(runs, "omni", FRICTION, 5, tmp_path / "out")
    for name in runs:
        folder = tmp_path / "out" / name
        recording = load(folder)
        assert "truth" not in recording.channels and recording.settings is None and recording.notes == ""
        assert sorted(os.listdir(folder)) == sorted(["recording.yaml", *(f"{c}.csv" for c in recording.channels)])
        text = (folder / "recording.yaml").read_text()
        assert "friction" not in text and "effects" not in text and "seed" not in text


def test_the_answer_lies_beside_them_with_its_hash(runs, tmp_path):
    digest = save_hidden(runs, "omni", FRICTION, 5, tmp_path / "out")
    answer = (tmp_path / "out" / "answer.json").read_bytes()
    assert json.loads(answer)["effects"] == FRICTION
    assert digest == hashlib.sha256(answer).hexdigest()
    assert (tmp_path / "out" / "answer.sha256").read_text() == f"{digest}  answer.json\n"
    assert os.listdir(tmp_path) == ["out"]


def test_the_effect_is_in_the_data_and_noise_too(model, runs):
    without = hide(model, "omni", {}, ["circle"], seed=5, seconds=3.0)["circle"]
    assert np.array_equal(hide(model, "omni", FRICTION, ["circle"], 5 + 1009, 3.0)["circle"].channels["torque"].values,
                          runs["circle"].channels["torque"].values)  # the seed alone decides
    effort = [np.abs(run.channels["torque"].values).mean() for run in (without, runs["circle"])]
    assert effort[1] > 1.08 * effort[0]
    resting = without.channels["encoder"].values[:150]
    assert np.ptp(resting, axis=0).max() > 0.0  # the torque's noise turns wheels at rest


@pytest.mark.parametrize("diagram, robot", [("pendulum_multirate", "pendulum"), ("velocity_base", "rover")])
def test_other_robots_stay_in_the_room_on_every_motion(diagram, robot):
    runs = hide(load_scenario(diagram), robot, {}, seconds=12.0)
    assert list(runs) == list(MOTIONS)
    for recording in runs.values():
        assert recording.robot == robot and np.abs(recording.channels["kinect"].values[:, :2]).max() < 1.1


def refusal(*arguments):
    with pytest.raises(InputError) as error:
        hide(*arguments)
    return str(error.value)


@pytest.mark.parametrize("arguments, parts", [
    (["omni", {"coulomb": {}}], ["effects.coulomb", "no such effect"]),
    (["omni", {"coulomb_friction": {"torque": 1.0}}], ["coulomb_friction.torque", "unknown"]),
    (["omni", {"gyro_bias": {}}], ["gyro_bias", "omni cannot have it"]),
    (["omni", {}, ["spiral"]], ["no motion 'spiral'", "square"]),
    (["omnni", {}], ["no robot 'omnni'", "did you mean 'omni'?"]),
    (["pendulum", {}, ["square"]], ["omni_multirate has no robot pendulum"]),
])
def test_what_cannot_be_hidden_is_refused(model, arguments, parts):
    message = refusal(model, *arguments)
    assert [part for part in parts if part not in message] == []


def test_a_robot_that_gets_lost_is_no_data():
    high = {"centre_of_gravity_offset": {"height_m": 0.3}}
    message = refusal(load_scenario("pendulum_multirate"), "pendulum", high, ["square"])
    assert "centre_of_gravity_offset" in message and "falls or is lost after" in message and "smaller" in message


def test_an_effect_without_a_wire_in_the_diagram_is_refused():
    with pytest.raises(InputError, match="velocity_lag: has no place in the Diagram odometry_replay"):
        hide(load_scenario("odometry_replay"), "rover", {"velocity_lag": {"time_constant_s": 0.1}}, ["square"])


# --------------------------------------------------------------------------------------------------- from a terminal


HIDE = ["hide", "omni_multirate", "--effect", "coulomb_friction:torque_n_m=0.01", "--seconds", "0.5", "--out", "runs"]


def test_the_command_writes_recordings_and_does_not_print_the_answer(here, document, said):
    data = document(*HIDE, "--runs", "3")
    assert list(data["recordings"].values()) == ["runs/square", "runs/circle", "runs/figure_eight"]
    assert all(load(path).robot == "omni" for path in data["recordings"].values())
    assert hashlib.sha256(Path(data["answer"]).read_bytes()).hexdigest() == data["sha256"]
    text = said(*HIDE[:-1], "again", "--runs", "1")
    assert "answer: again/answer.json" in text and "friction" not in text


def test_several_effects_with_several_parameters(here, said):
    effects = ["--effect", "weak_motor:wheel=2,loss=0.2", "--effect", "floor_tilt:slope_x_rad=0.01"]
    said("hide", "omni_multirate", *effects, "--seconds", "0.5", "--runs", "1", "--out", "runs")
    assert json.loads(Path("runs/answer.json").read_text())["effects"] == {
        "weak_motor": {"wheel": 2, "loss": 0.2}, "floor_tilt": {"slope_x_rad": 0.01},
    }


def test_of_two_robots_one_is_chosen(here, said):
    words = ["hide", "shared_space", "--runs", "1", "--seconds", "0.5", "--out", "runs"]
    for setting in ("omni.trajectory.radius_m=0.3", *NOISE_AND_SLIP):
        words += ["--set", setting]
    said(*words, "--robot", "pendulum")
    assert load("runs/square").robot == "pendulum"


def test_a_folder_with_something_in_it_is_left_alone(here, refused, said):
    said(*HIDE, "--runs", "1")
    assert "runs: is there already, expected a new or an empty folder" in refused(*HIDE)
