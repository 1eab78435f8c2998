"""Measured sensors -> torque: whether the controller that drove the robot is the model's."""

from dataclasses import replace

import pytest

from drake_ispace.explain.answer.controller import check_controller
from drake_ispace.explain.explain import explain
from drake_ispace.hiding import hide
from drake_ispace.scenario import load_scenario
from hidden.generator import generate
from stand_ins.tried import FEW

ROBOTS = ("omni", "pendulum")


@pytest.fixture(scope="module", params=ROBOTS)
def hidden(request):
    """(robot, its model, a run of it with other friction and wheels than the model's)."""
    model = load_scenario(f"{request.param}_multirate")
    effects = {"viscous_friction": {"coefficient_n_m_s": 0.001}, "wheel_radius_error": {"share": 0.03}}
    return request.param, model, hide(model, request.param, effects, ["square"], seconds=8.0)["square"]


def test_the_models_own_controller_leaves_nothing_whatever_the_plant_lacks(hidden):
    robot, model, run = hidden
    check = check_controller(model, robot, run)
    assert check.unexplained < 1e-6 and check.gain == pytest.approx(1.0)


@pytest.mark.first_case
@pytest.mark.parametrize("robot", ROBOTS)
def test_the_same_law_written_by_another_hand_leaves_little(robot):
    model = load_scenario(f"{robot}_multirate")
    assert check_controller(model, robot, generate(robot, "circle", seconds=10.0, seed=3)).unexplained < 0.08


def test_another_controller_is_seen(hidden):
    robot, _, run = hidden
    other = load_scenario(f"{robot}_vision_feedback")
    assert check_controller(other, robot, run).unexplained > 0.12


def test_without_a_channel_that_it_takes_nothing_is_said(hidden):
    robot, model, run = hidden
    for name in ("reference", "encoder", "kinect", "torque"):
        channels = {key: channel for key, channel in run.channels.items() if key != name}
        assert check_controller(model, robot, replace(run, channels=channels)) is None


@pytest.mark.slow
def test_explain_warns_of_another_controller():
    model = load_scenario("omni_multirate")
    runs = list(hide(model, "omni", {}, ["square", "circle"], seconds=6.0).values())
    assert explain(model, runs, effects=FEW).controller.unexplained < 0.05
    found = explain(load_scenario("omni_multirate", ["omni.control.r=[3.0, 3.0, 3.0]"]), runs, effects=FEW)
    assert found.controller.unexplained > 0.12
    assert any("the controller is not the model's" in warning for warning in found.warnings)
    assert found.to_data()["controller"]["unexplained"] == found.controller.unexplained
