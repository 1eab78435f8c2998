"""The rear wheels of a tricycle are computed: what is wrong of them may be the steering."""

from dataclasses import replace

import numpy as np
import pytest

from drake_ispace.explain.check.check import check
from drake_ispace.robots.robot_file import REAR_COMPUTED
from hidden import two_wheels


def wheels(run, matrix, notes=f"encoder: {REAR_COMPUTED}"):
    """The run of a robot whose wheels' angles were computed, multiplied by a matrix."""
    encoder = run.channels["encoder"]
    mixed = replace(encoder, values=encoder.values @ np.transpose(matrix))
    return replace(run, channels=run.channels | {"encoder": mixed}, notes=notes)


@pytest.fixture(scope="module")
def runs():
    return [two_wheels.drive(80 + i, 12.0, left_share=0.0, late_s=0.0, lag_s=0.02, in_step=True) for i in range(2)]


def test_computed_wheels_that_changed_places_tell_of_steering_of_the_other_sense(runs):
    (finding,) = check(two_wheels.model(), [wheels(run, [[0, 1], [1, 0]]) for run in runs]).findings
    assert (finding.fault, finding.runs) == ("steering", (0, 1)) and "steer_front" in finding.repair


def test_logged_wheels_that_changed_places_are_told_as_that(runs):
    (finding,) = check(two_wheels.model(), [wheels(run, [[0, 1], [1, 0]], notes="") for run in runs]).findings
    assert finding.fault == "wheels_swapped"


def test_a_track_that_makes_no_sense_may_be_a_steering_angle_in_another_unit(runs):
    little = 0.5 * np.array([[1.0, 1.0], [1.0, 1.0]]) + 0.01 * np.array([[1.0, -1.0], [-1.0, 1.0]])
    findings = check(two_wheels.model(), [wheels(run, little) for run in runs]).findings
    assert any(finding.channel == "model" and finding.rivals[0] == "steering" for finding in findings)
