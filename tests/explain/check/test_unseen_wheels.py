"""Encoders of a robot that no camera sees: a mistake of theirs is not made several of the IMU and the torques."""

from dataclasses import replace

import numpy as np
import pytest

from drake_ispace.explain.check.check import check
from drake_ispace.explain.check.finding import Finding
from drake_ispace.explain.check.unseen_wheels import with_rivals
from drake_ispace.faults.repair import Mixed
from drake_ispace.hiding import hide

MODEL = "pendulum_multirate"


@pytest.fixture(scope="module")
def unseen():
    """Two sound runs of 12 s without a camera."""
    runs = hide(MODEL, "pendulum", {}, ["square", "figure_eight"], 4, 12.0).values()
    return [replace(run, channels={n: c for n, c in run.channels.items() if n != "kinect"}) for run in runs]


def mixed(runs, channel, matrix):
    """The runs with the columns of a channel times a matrix."""
    return [
        replace(run, channels=run.channels | {channel: replace(c, values=c.values @ np.array(matrix).T)})
        for run in runs for c in (run.channels[channel],)
    ]


def found(runs):
    return [(finding.fault, finding.channel, finding.run) for finding in check(MODEL, runs).findings]


def test_sound_runs_have_no_finding(unseen):
    assert found(unseen) == []


@pytest.mark.parametrize(("matrix", "fault"), [
    ([[0.0, 1.0], [1.0, 0.0]], "wheels_swapped"), ([[1.0, 0.0], [0.0, -1.0]], "wheel_sign"),
    ([[-1.0, 0.0], [0.0, -1.0]], "encoder_sign"), ([[4.0, 0.0], [0.0, 4.0]], "counts_per_turn"),
])
def test_one_mistake_of_the_encoders_is_one(unseen, matrix, fault):
    checked = check(MODEL, mixed(unseen, "encoder", matrix))
    (finding,) = checked.findings
    assert (finding.fault, finding.channel, finding.run) == (fault, "encoder", "all")
    for repaired, sound in zip(checked.repaired, unseen, strict=True):
        np.testing.assert_allclose(repaired.channels["encoder"].values, sound.channels["encoder"].values, atol=1e-12)


def test_a_mistake_of_a_gyro_or_of_torques_is_theirs(unseen):
    turned = np.diag([1.0, 1.0, 1.0, 1.0, 1.0, -1.0])
    assert found(mixed(unseen, "imu", turned)) == [("imu_axes", "imu", "all")]
    assert found(mixed(unseen, "torque", -np.eye(2))) == [("torque_sign", "torque", "all")]


def test_a_mistake_of_the_encoders_that_explains_as_much_is_a_rival_of_whole_channels():
    undone = (Mixed("imu", ("wz",), ((-1.0,),)),)
    axes, clock = Finding("imu_axes", "-wz", "imu", repairs=undone), Finding("clock_offset", "late", "kinect")
    of_imu, of_camera = with_rivals([axes, clock], ("wheels_swapped",))
    assert of_imu.rivals == ("wheels_swapped",) and of_camera == clock


def test_a_gyro_that_goes_with_no_run_may_be_mistaken_otherwise(unseen):
    noise = np.random.default_rng(3)
    shaken = [
        replace(run, channels=run.channels | {"imu": replace(imu, values=np.column_stack([
            imu.values[:, :5], 0.3 * np.sin(np.cumsum(noise.uniform(0.0, 0.03, len(imu.t)))),
        ]))}) for run in unseen for imu in (run.channels["imu"],)
    ]
    strange = [finding for finding in check(MODEL, shaken).findings if finding.fault == "channel_of_another_run"]
    assert len(strange) == 2 and all(finding.rivals[0] == "imu_axes" for finding in strange)
