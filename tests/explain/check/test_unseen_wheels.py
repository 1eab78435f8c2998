"""Encoders of a robot that no camera sees: a mistake of theirs is not made several of the IMU and the torques."""

from dataclasses import replace

import numpy as np
import pytest

from drake_ispace.explain.check.check import check
from drake_ispace.explain.check.finding import Finding
from drake_ispace.explain.check.unseen_wheels import with_rivals
from drake_ispace.files.recording import Channel
from drake_ispace.hiding import hide
from hidden import two_wheels

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


@pytest.mark.first_case
@pytest.mark.parametrize(("matrix", "fault"), [
    ([[0.0, 1.0], [1.0, 0.0]], "wheels_swapped"), ([[1.0, 0.0], [0.0, -1.0]], "wheel_sign"),
    pytest.param([[-1.0, 0.0], [0.0, -1.0]], "encoder_sign", marks=pytest.mark.slow),
    pytest.param([[4.0, 0.0], [0.0, 4.0]], "counts_per_turn", marks=pytest.mark.slow),
])
def test_one_mistake_of_the_encoders_is_one(unseen, matrix, fault):
    checked = check(MODEL, mixed(unseen, "encoder", matrix))
    (finding,) = checked.findings
    assert (finding.fault, finding.channel, finding.run) == (fault, "encoder", "all")
    for repaired, sound in zip(checked.repaired, unseen, strict=True):
        np.testing.assert_allclose(repaired.channels["encoder"].values, sound.channels["encoder"].values, atol=1e-12)


def driven(seed, wheels=lambda angles: angles, channels=("command", "imu")):
    """A run of a two-wheeled robot that no camera sees, with its command and an IMU; wheels: as they are read."""
    run = two_wheels.drive(seed, 20.0, left_share=0.0, late_s=0.0, lag_s=0.05, in_step=True)
    encoder, random = run.channels["encoder"], np.random.default_rng(seed)
    t = np.arange(0.05, 19.9, 0.01)
    later, earlier = (
        np.column_stack([np.interp(t + d, encoder.t, one) for one in encoder.values.T]) for d in (0.03, -0.03)
    )
    right, left = ((later - earlier) / 0.06 * two_wheels.RADIUS_M).T
    turning, rates = (right - left) / (2.0 * two_wheels.HALF_TRACK_M), random.normal(0.0, 0.02, (len(t), 6))
    along = 0.5 * (right + left)
    rates += np.column_stack([np.gradient(along, t), along * turning, 0.0 * t + 9.81, 0.0 * t, 0.0 * t, turning])
    there = {"imu": Channel(t, ("ax", "ay", "az", "wx", "wy", "wz"), rates), "command": run.channels["command"]}
    read = replace(encoder, values=wheels(encoder.values))
    return replace(run, channels={"encoder": read} | {name: there[name] for name in channels})


@pytest.mark.first_case
@pytest.mark.parametrize(("wheels", "fault"), [
    (lambda v: v[:, ::-1], "wheels_swapped"), (lambda v: -v, "encoder_sign"), (lambda v: v * [-1.0, 1.0], "wheel_sign"),
])
def test_wheels_that_command_and_gyro_both_contradict_are_mistaken(wheels, fault):
    (finding,) = check(two_wheels.model(), [driven(seed, wheels) for seed in (1, 2)]).findings
    assert (finding.fault, finding.channel) == (fault, "encoder")


@pytest.mark.first_case
@pytest.mark.parametrize("channel", ["command", "imu"])
def test_where_only_one_channel_contradicts_the_wheels_they_are_its_rival(channel):
    runs = [driven(seed, lambda v: v[:, ::-1], (channel,)) for seed in (1, 2)]
    (finding,) = check(two_wheels.model(), runs).findings
    assert finding.channel == channel and "wheels_swapped" in finding.rivals


def test_a_command_of_the_other_sense_is_mistaken_where_the_gyro_goes_with_the_wheels():
    runs = [driven(seed) for seed in (1, 2)]
    runs = mixed(runs, "command", np.diag([1.0, 1.0, -1.0]))
    (finding,) = check(two_wheels.model(), runs).findings
    assert (finding.fault, finding.channel, finding.rivals) == ("command_sign", "command", ())


@pytest.mark.slow
def test_a_mistake_of_a_gyro_or_of_torques_is_theirs(unseen):
    turned = np.diag([1.0, 1.0, 1.0, 1.0, 1.0, -1.0])
    assert found(mixed(unseen, "imu", turned)) == [("imu_axes", "imu", "all")]
    assert found(mixed(unseen, "torque", -np.eye(2))) == [("torque_sign", "torque", "all")]


@pytest.mark.slow
def test_a_mistake_of_a_gyro_is_its_own_where_torques_tell_nothing(unseen):
    turned = mixed(unseen, "imu", np.diag([1.0, 1.0, 1.0, 1.0, 1.0, -1.0]))
    dead = mixed(turned, "torque", np.zeros((2, 2)))
    without = [replace(run, channels={n: c for n, c in run.channels.items() if n != "torque"}) for run in turned]
    for runs in (dead, without):
        assert {channel for fault, channel, _ in found(runs) if fault != "channel_dead"} == {"imu"}


@pytest.mark.slow
def test_runs_need_not_have_the_same_channels_nor_names_of_columns(unseen):
    one, other = mixed(unseen, "encoder", [[0.0, 1.0], [1.0, 0.0]])
    encoder = replace(other.channels["encoder"], columns=("theta_1", "theta_2"))
    named_otherwise = replace(other, channels=other.channels | {"encoder": encoder})
    assert {(fault, channel) for fault, channel, _ in found([one, named_otherwise])} == {("wheels_swapped", "encoder")}
    without = replace(other, channels={n: c for n, c in other.channels.items() if n != "encoder"})
    assert ("wheels_swapped", "encoder") in {(fault, channel) for fault, channel, _ in found([one, without])}


@pytest.mark.slow
def test_a_camera_that_saw_next_to_nothing_is_none():
    runs = list(hide(MODEL, "pendulum", {}, ["square", "figure_eight"], 4, 12.0).values())
    blind = [
        replace(run, channels=run.channels | {"kinect": replace(c, t=c.t[:3], values=c.values[:3])})
        for run in runs for c in (run.channels["kinect"],)
    ]
    assert ("wheels_swapped", "encoder", "all") in found(mixed(blind, "encoder", [[0.0, 1.0], [1.0, 0.0]]))


def test_faults_of_the_encoders_are_rivals_of_others_once():
    axes = Finding("imu_axes", "-wz", "imu", rivals=("wheels_swapped",))
    assert with_rivals([axes], ("wheels_swapped", "wheel_sign"))[0].rivals == ("wheels_swapped", "wheel_sign")


@pytest.mark.slow
def test_a_gyro_that_goes_with_no_run_may_be_mistaken_otherwise(unseen):
    noise = np.random.default_rng(3)
    shaken = [
        replace(run, channels=run.channels | {"imu": replace(imu, values=np.column_stack([
            imu.values[:, :5], 0.3 * np.sin(np.cumsum(noise.uniform(0.0, 0.03, len(imu.t)))),
        ]))}) for run in unseen for imu in (run.channels["imu"],)
    ]
    strange = [finding for finding in check(MODEL, shaken).findings if finding.fault == "channel_of_another_run"]
    assert len(strange) == 2 and all("imu_axes" in finding.rivals for finding in strange)
