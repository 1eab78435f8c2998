"""A model whose tyres hold every turn, of a robot that skids: the model is at fault, and nothing else."""

from dataclasses import replace

import numpy as np
import pytest

from drake_ispace.explain.check.check import check
from drake_ispace.files.recording import Channel
from drake_ispace.plants.wheels import Wheel, WheelGeometry, differential, skidding
from drake_ispace.scenario import load_scenario
from hidden import two_wheels

BEHIND_M = 0.13  # from the middle to each axle


def model(counts=two_wheels.COUNTS, behind_m=BEHIND_M):
    """Four tyres at their true places, left before right."""
    track, radius = two_wheels.HALF_TRACK_M, two_wheels.RADIUS_M
    tyres = [[x, y, 0.0, radius, 0.0, 1.0] for x in (behind_m, -behind_m) for y in (track, -track)]
    return load_scenario("velocity_base", [
        "rover.plant.wheels=listed", f"rover.plant.wheel_list={tyres}", f"rover.encoder.counts_per_turn={counts}",
        "rover.trajectory.heading=tangent",
    ])


def skids(seed, times, seconds=12.0, counts=two_wheels.COUNTS, without=(), **given):
    """A run of a robot that turns so many times less than its wheels say; front and rear wheels turn alike."""
    run = two_wheels.drive(
        seed, seconds, left_share=0.0, late_s=0.0, in_step=True, others={"track_share": times - 1.0}, **given
    )
    wheels, count = run.channels["encoder"], 2.0 * np.pi / counts
    columns = tuple(f"theta_{k}" for k in (1, 2, 3, 4))
    values = count * np.floor(wheels.values[:, [1, 0, 1, 0]] / count)
    channels = run.channels | {"encoder": replace(wheels, columns=columns, values=values)}
    return replace(run, channels={name: channel for name, channel in channels.items() if name not in without})


def faults(runs, of=None):
    return [(finding.fault, finding.channel) for finding in check(of or model(), runs).findings]


@pytest.mark.parametrize(("times", "counts", "without", "given"), [
    (1.6, two_wheels.COUNTS, (), {}),
    (1.6, 64, ("command",), {"speeds_m_s": (0.05, 0.2), "rates_rad_s": (-0.3, 0.3)}),
    pytest.param(1.0, two_wheels.COUNTS, ("command",), {}, marks=pytest.mark.slow),
    pytest.param(1.3, two_wheels.COUNTS, ("command",), {"camera_hz": 10.0}, marks=pytest.mark.slow),
    pytest.param(2.0, two_wheels.COUNTS, (), {"speeds_m_s": (0.0, 0.0)}, marks=pytest.mark.slow),  # on the spot
])
def test_tyres_that_hold_every_turn_are_the_models_fault(times, counts, without, given):
    runs = [skids(seed, times, counts=counts, without=without, **given) for seed in (1, 2)]
    (finding,) = check(model(counts), runs).findings
    assert (finding.fault, finding.channel, finding.runs) == ("tyres_hold", "model", (0, 1))
    assert f"{times:.2g} times as far apart" in finding.repair and not finding.repairs and not finding.is_bearable


def test_a_mistake_besides_is_found_as_well():
    runs = [skids(seed, 1.6, without=("command",)) for seed in (1, 2)]
    degrees = [
        replace(run, channels=run.channels | {"kinect": replace(seen, values=seen.values * [1.0, 1.0, 180.0 / np.pi])})
        for run in runs for seen in (run.channels["kinect"],)
    ]
    checked = check(model(), degrees)
    assert [finding.fault for finding in checked.findings] == ["tyres_hold", "wrong_unit"]
    for repaired, sound in zip(checked.repaired, runs, strict=True):
        np.testing.assert_allclose(repaired.channels["kinect"].values, sound.channels["kinect"].values, atol=1e-9)
        np.testing.assert_array_equal(repaired.channels["encoder"].values, sound.channels["encoder"].values)


def test_of_a_robot_that_never_turns_nothing_is_said():
    assert faults([skids(seed, 1.6, without=("command",), rates_rad_s=(0.0, 0.0)) for seed in (1, 2)]) == []


@pytest.mark.parametrize("channel", [
    pytest.param("imu", marks=pytest.mark.slow), pytest.param("command", marks=pytest.mark.first_case),
])
def test_a_gyro_or_a_command_tells_of_turns_where_no_camera_does(channel):
    run = skids(1, 1.3, without=("kinect",))
    command = run.channels["command"]
    if channel == "imu":
        rates = np.random.default_rng(1).normal(0.0, 0.01, (len(command.t), 6))
        rates[:, 2] += 9.81
        rates[:, 5] += command.values[:, 2] / 1.3
        columns = ("ax", "ay", "az", "wx", "wy", "wz")
        run = replace(run, channels={
            "encoder": run.channels["encoder"], "imu": Channel(command.t, columns, rates, {}, None),
        })
    (finding,) = [finding for finding in check(model(), [run]).findings if finding.channel == "model"]
    assert finding.fault == "tyres_hold" and "a camera tells" in finding.repair


@pytest.mark.slow
def test_tyres_in_one_line_as_far_apart_as_is_said_agree():
    track, radius = 1.6 * two_wheels.HALF_TRACK_M, two_wheels.RADIUS_M
    tyres = [[0.0, y, 0.0, radius, 0.0, 1.0] for _ in range(2) for y in (track, -track)]
    mended = load_scenario("velocity_base", [
        "rover.plant.wheels=listed", f"rover.plant.wheel_list={tyres}", "rover.trajectory.heading=tangent",
    ])
    assert faults([skids(seed, 1.6, without=("command",)) for seed in (1, 2)], mended) == []


def test_tyres_that_skid_roll_as_before_and_let_the_robot_turn():
    tyres = WheelGeometry(tuple(
        Wheel(0.1 + x, y, drive, 0.05, holds_sideways=True)
        for x in (0.2, -0.2) for y, drive in ((0.3, 0.0), (-0.3, np.pi))
    ))
    in_line = skidding(tyres)
    assert tyres.holds_turns and not in_line.holds_turns
    np.testing.assert_allclose(in_line.inverse, tyres.inverse, atol=1e-12)
    np.testing.assert_allclose([wheel.x_m for wheel in in_line.wheels], 0.1)
    two = differential(0.05, 0.15)
    assert not two.holds_turns and skidding(two) is two


def test_tyres_of_a_bicycle_are_left_where_they_are():
    tyres = WheelGeometry(tuple(Wheel(x, 0.0, 0.0, 0.05, holds_sideways=True) for x in (0.1, -0.1)))
    assert tyres.holds_turns and skidding(tyres) is tyres


def test_tyres_that_hold_every_motion_are_refused():
    tyres = tuple(Wheel(x, y, 0.1 * (x > 0.0), 0.05, holds_sideways=True) for x in (0.2, -0.2) for y in (0.3, -0.3))
    with pytest.raises(ValueError, match="hold every motion"):
        WheelGeometry(tyres)


@pytest.mark.parametrize("times", [1.5, pytest.param(1.6, marks=pytest.mark.slow)])
def test_a_command_that_tells_what_the_camera_sees_is_not_accused_of_tyres_that_skid(times):
    """The driver knows by how much they do, as a multiplier of the distance between the wheels says it."""
    runs = []
    for seed in (1, 2):
        run = two_wheels.drive(
            seed, 20.0, left_share=0.0, late_s=0.0, in_step=True, others={"track_share": times - 1.0},
        )
        told = run.channels["command"]
        told = replace(told, values=told.values / [1.0, 1.0, times])
        runs.append(replace(run, channels=run.channels | {"command": told}))
    assert "command" not in {channel for _, channel in faults(runs, two_wheels.model())}
