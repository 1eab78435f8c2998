"""A command of another run is told from that of a drive that wanders."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from drake_ispace.explain.check.check import check
from drake_ispace.files.recording import Channel, Recording
from drake_ispace.scenario import load_scenario
from hidden import two_wheels
from hidden.generator import generate

STEP_S = 0.02
MODEL = load_scenario("velocity_base", [
    "rover.plant.wheels=differential", "rover.plant.radius_m=0.033", "rover.plant.half_track_m=0.08",
])


def squares(seed, wanders_m_s=0.0, side_s=3.8, turn_rad_s=0.9):
    """30 s of squares; each wheel leaves its command at random, for a third of a second at a time."""
    t, rng = STEP_S * np.arange(1500), np.random.default_rng(seed)
    goes, at = t >= 2.0, (t - 2.0) % (side_s + 1.75)
    ahead, turn = np.where(goes & (at < side_s), 0.13, 0.0), np.where(goes & (at >= side_s), turn_rad_s, 0.0)
    keep = np.exp(-STEP_S / 0.3)
    speeds = np.column_stack([ahead + 0.08 * turn, ahead - 0.08 * turn])
    noise = lfilter([np.sqrt(1.0 - keep**2)], [1.0, -keep], rng.standard_normal(speeds.shape), axis=0)
    angles = np.cumsum(speeds + wanders_m_s * noise * (speeds != 0.0), axis=0) * STEP_S / 0.033
    return Recording("rover", channels={
        "command": Channel(t, ("vx", "vy", "wz"), np.column_stack([ahead, 0.0 * t, turn]), {}, STEP_S),
        "encoder": Channel(t, ("theta_right", "theta_left"), angles, {}, STEP_S),
    })


@pytest.mark.first_case
@pytest.mark.parametrize("seed", range(4))
def test_a_command_is_no_stranger_to_a_drive_that_wanders(seed):
    assert not [finding for finding in check(MODEL, [squares(seed, 0.02)]).findings if finding.channel == "command"]


def test_a_command_that_turns_the_same_way_as_another_run_is_found():
    run, other = squares(0, 0.003), squares(1, 0.003, side_s=1.0)
    mixed = replace(run, channels=run.channels | {"encoder": other.channels["encoder"]})
    assert ("channel_of_another_run", "command") in [(f.fault, f.channel) for f in check(MODEL, [mixed]).findings]


def test_wheels_that_fit_no_change_of_a_command_raise_nothing():
    run, other = squares(0, 0.003, side_s=1.2), squares(1, side_s=2.3)
    check(MODEL, [replace(run, channels=run.channels | {"encoder": other.channels["encoder"]})])


def test_a_command_of_another_run_is_found():
    run, other = squares(0, 0.003), squares(1, side_s=2.3, turn_rad_s=-0.6)
    mixed = replace(run, channels=run.channels | {"command": other.channels["command"]})
    assert [(f.fault, f.channel) for f in check(MODEL, [mixed]).findings] == [("channel_of_another_run", "command")]


def test_wheels_of_another_run_are_found_although_the_command_says_little():
    """The camera of the other run goes with them, and no other wheels with the camera of this one."""
    own, other = (two_wheels.drive(660 + i, 20.0, left_share=0.0, late_s=0.0, lag_s=0.0, in_step=True) for i in (0, 1))
    mixed = replace(own, channels=own.channels | {"encoder": other.channels["encoder"]})
    for channels in (mixed.channels, {k: v for k, v in mixed.channels.items() if k != "command"}):
        (finding,) = check(two_wheels.model(), [other, replace(mixed, channels=channels)]).findings
        assert (finding.fault, finding.channel, finding.runs) == ("channel_of_another_run", "encoder", (1,))


def test_a_camera_of_another_run_that_turns_the_other_way_is_found():
    """On a circle a share of the way looks like a turn, which must not make a turn of the other sense."""
    sound = {"left_share": 0.0, "late_s": 0.0, "lag_s": 0.0, "in_step": True}
    left, right, free = (
        two_wheels.drive(650 + i, 20.0, **sound, **how) for i, how in enumerate([
            {"speeds_m_s": (0.2, 0.2), "rates_rad_s": (0.6, 0.6)},
            {"speeds_m_s": (0.2, 0.2), "rates_rad_s": (-0.6, -0.6)}, {},
        ])
    )
    mixed = replace(right, channels=right.channels | {"kinect": left.channels["kinect"]})
    (finding,) = check(two_wheels.model(), [left, mixed, free]).findings
    assert (finding.fault, finding.channel, finding.runs) == ("channel_of_another_run", "kinect", (1,))
    assert finding.what == "moves with the wheels of run 1"


@pytest.mark.first_case
@pytest.mark.parametrize(("robot", "channel"), [
    ("omni", "torque"), ("pendulum", "torque"), pytest.param("pendulum", "imu", marks=pytest.mark.slow),
])
def test_a_torque_or_an_imu_of_another_run_is_found_by_whose_wheels_it_follows(robot, channel):
    own, other = (generate(robot, motion, {}, 8.0, 7 + i) for i, motion in enumerate(("back_and_forth", "eight")))
    mixed = replace(own, channels=own.channels | {channel: other.channels[channel]})
    (finding,) = check(f"{robot}_multirate", [mixed, other]).findings
    assert (finding.fault, finding.channel, finding.runs) == ("channel_of_another_run", channel, (0,))
    assert finding.what == "moves with the wheels of run 2"


@pytest.mark.slow
def test_the_camera_of_a_robot_that_is_pushed_twice_is_no_other_runs():
    """Both pushes take it aside and turn it, faster than it ever drives."""
    run = two_wheels.drive(5, 24.0, 0.0, 0.0, 0.0, in_step=True)
    kinect = run.channels["kinect"]
    pushed = np.clip((kinect.t - 5.0) / 2.0, 0.0, 1.0) + np.clip((kinect.t - 15.0) / 2.0, 0.0, 1.0)
    turn, poses = 2.5 * pushed, kinect.values[:, :3].copy()
    steps, c, s = np.diff(poses[:, :2], axis=0), np.cos(turn[:-1]), np.sin(turn[:-1])
    turned = np.column_stack([c * steps[:, 0] - s * steps[:, 1], s * steps[:, 0] + c * steps[:, 1]])
    poses[1:, :2] = poses[0, :2] + np.cumsum(turned + 1.5 * np.diff(pushed)[:, None], axis=0)
    poses[:, 2] += turn
    moved = replace(kinect, values=poses, columns=kinect.columns[:3])
    found = check(two_wheels.model(), [replace(run, channels=run.channels | {"kinect": moved})]).findings
    assert {finding.fault for finding in found} == {"robot_carried"} and len(found) == 2
