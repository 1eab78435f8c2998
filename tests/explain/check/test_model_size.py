"""Ways that are longer or shorter than those of the wheels by one factor: a room in another unit, or a model of
another size."""

from dataclasses import replace

import pytest

from drake_ispace.explain.check.check import check
from hidden import three_wheels


@pytest.fixture(scope="module")
def runs():
    return [three_wheels.drive(70 + i, 12.0) for i in range(2)]


def of_size(times):
    """The model, so many times as large as the robot."""
    model = three_wheels.model()
    plant = model.rover.plant
    larger = replace(plant, radius_m=times * plant.radius_m, centre_distance_m=times * plant.centre_distance_m)
    return replace(model, rover=replace(model.rover, plant=larger))


def scaled(runs, channel, times):
    """The runs, a channel of which is multiplied column by column."""
    of_each = [replace(run.channels[channel], values=run.channels[channel].values * times) for run in runs]
    return [replace(run, channels=run.channels | {channel: one}) for run, one in zip(runs, of_each, strict=True)]


@pytest.mark.parametrize(("times", "said"), [(0.5, "2 times as large"), (2.54, "about 0.39 times as large")])
def test_a_command_that_goes_as_far_as_the_camera_accuses_the_model(runs, times, said):
    (finding,) = check(of_size(times), runs).findings
    assert (finding.fault, finding.channel, finding.runs) == ("model_size", "model", (0, 1))
    assert said in finding.advice and "wrong_unit" in finding.rivals


def test_a_command_that_goes_as_far_as_the_wheels_accuses_the_camera(runs):
    (finding,) = check(three_wheels.model(), scaled(runs, "kinect", [0.5, 0.5, 1.0])).findings
    assert (finding.fault, finding.channel) == ("wrong_unit", "kinect") and "model_size" in finding.rivals


def test_without_a_command_either_may_be_wrong(runs):
    alone = [replace(run, channels={n: c for n, c in run.channels.items() if n != "command"}) for run in runs]
    (finding,) = check(of_size(0.5), alone).findings
    assert {finding.fault, *finding.rivals} >= {"wrong_unit", "model_size"}


@pytest.mark.parametrize("times", [[0.7, 0.7, 0.7], [2.0, 2.0, 2.0]])
def test_a_drive_that_does_less_than_told_accuses_no_model(runs, times):
    """Of a model of another size turns would be as told."""
    wrong = scaled(scaled(runs, "kinect", [2.0, 2.0, 1.0]), "command", times)
    assert {finding.channel for finding in check(three_wheels.model(), wrong).findings} == {"kinect"}
