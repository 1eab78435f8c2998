"""Ways that are turned by one angle: the camera's headings are off, or the model's wheels sit at other angles."""

from dataclasses import replace

import numpy as np
import pytest

from drake_ispace.explain.check.check import check
from hidden import three_wheels, two_wheels

OFF_RAD = np.deg2rad(40.0)


@pytest.fixture(scope="module")
def runs():
    return [three_wheels.drive(70 + i, 12.0) for i in range(2)]


@pytest.fixture(scope="module")
def turned():
    """The model whose wheels sit too early by that angle."""
    model = three_wheels.model()
    first_rad = model.rover.plant.first_rad - OFF_RAD
    return replace(model, rover=replace(model.rover, plant=replace(model.rover.plant, first_rad=first_rad)))


def seen_turned(runs, angle_rad):
    """The runs whose camera has headings that are off by that angle."""
    off = [0.0, 0.0, angle_rad]
    kinects = [replace(run.channels["kinect"], values=run.channels["kinect"].values + off) for run in runs]
    return [replace(run, channels=run.channels | {"kinect": one}) for run, one in zip(runs, kinects, strict=True)]


def test_a_command_that_goes_with_the_camera_accuses_the_models_wheels(runs, turned):
    (finding,) = check(turned, runs).findings
    assert (finding.fault, finding.channel, finding.runs) == ("wheel_angles", "model", (0, 1))
    assert "by 40 degrees" in finding.advice and "heading_offset" in finding.rivals


def test_a_command_that_goes_with_the_wheels_accuses_the_camera(runs):
    (finding,) = check(three_wheels.model(), seen_turned(runs, OFF_RAD)).findings
    assert (finding.fault, finding.channel) == ("heading_offset", "kinect") and "wheel_angles" in finding.rivals


def test_without_a_command_either_may_be_wrong(runs, turned):
    alone = [replace(run, channels={n: c for n, c in run.channels.items() if n != "command"}) for run in runs]
    (finding,) = check(turned, alone).findings
    assert {finding.fault, *finding.rivals} >= {"heading_offset", "wheel_angles"}


@pytest.mark.parametrize("mixed", [[[0, 1, 0], [1, 0, 0], [0, 0, 1]], [[-1, 0, 0], [0, -1, 0], [0, 0, -1]]])
def test_a_command_that_is_wrong_by_itself_accuses_no_wheels(runs, mixed):
    wrong = []
    for run in seen_turned(runs, -1.5 * OFF_RAD):
        command = run.channels["command"]
        wrong.append(replace(run, channels=run.channels | {"command": replace(command, values=command.values @ mixed)}))
    assert {finding.channel for finding in check(three_wheels.model(), wrong).findings} == {"command", "kinect"}


def test_wheels_that_hold_the_robot_sideways_have_no_other_angles():
    late = [two_wheels.drive(80 + i, 12.0, left_share=0.0, late_s=0.0, lag_s=0.02, in_step=True) for i in range(2)]
    assert {finding.channel for finding in check(two_wheels.model(), seen_turned(late, OFF_RAD)).findings} == {"kinect"}
