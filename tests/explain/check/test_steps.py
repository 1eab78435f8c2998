"""Columns that nobody fills, and counters that are set anew, of a robot that drives."""

from dataclasses import replace

import numpy as np
import pytest

from drake_ispace.explain.check.check import check
from drake_ispace.explain.check.compare.links import base_of
from drake_ispace.explain.check.runs import robot_of
from drake_ispace.explain.check.sampling.samples import sample_findings
from drake_ispace.explain.check.steps import dead_findings
from drake_ispace.files.recording import Channel, Recording
from hidden import two_wheels

SOUND = {"left_share": 0.0, "late_s": 0.0, "lag_s": 0.0, "in_step": True}


def found(channel, change, seconds=12.0):
    """(fault, channel) of what is found in two runs of which the first has this channel changed."""
    first, second = (two_wheels.drive(640 + i, seconds, **SOUND) for i in range(2))
    old = first.channels[channel]
    changed = replace(old, values=change(old.t, old.values.copy()))
    checked = check(two_wheels.model(), [replace(first, channels=first.channels | {channel: changed}), second])
    return [(finding.fault, finding.channel, finding.runs) for finding in checked.findings]


def test_angles_that_are_set_to_zero_are_no_jump_of_the_camera():
    def reset(t, values):
        row = np.searchsorted(t, 7.0)
        values[row:] -= values[row]
        return values

    assert found("encoder", reset) == [("counter_reset", "encoder", (0,))]


def of_encoder(t, angles):
    encoder = Channel(t, ("theta_r", "theta_l"), angles)
    return [finding.fault for finding in sample_findings(Recording("rover", channels={"encoder": encoder}))]


@pytest.mark.parametrize("shaken", [True, False])
@pytest.mark.parametrize(("every_s", "rows"), [(0.02, 8), (0.2, 3), (0.2, 1)])
def test_a_dash_between_rests_is_no_counter_that_was_set_anew(every_s, rows, shaken):
    """Its wheels turn by a count now and then, or not at all, and fast for a few rows."""
    t, count = every_s * np.arange(200), 2.0 * np.pi / two_wheels.COUNTS
    angles = count * shaken * np.random.default_rng(1).integers(0, 2, (200, 2))
    for begin in (60, 120):
        angles[begin:] += 3.0 * np.clip(np.arange(200 - begin) + 1.0, 0, rows)[:, None]
    assert of_encoder(t, angles) == []


@pytest.mark.parametrize("held", [2, 10])
def test_a_dash_in_a_table_that_holds_its_samples_is_no_leap(held):
    t = 0.01 * np.arange(2000)
    angle = 0.05 * t + 6.0 * np.clip(t - 10.0, 0.0, 0.3)
    assert of_encoder(t, np.repeat(angle[::held], held)[:, None] * [1.0, 1.1]) == []


def test_a_wheel_in_coarse_counts_beside_a_fine_one_does_not_leap():
    t = 0.01 * np.arange(2000)
    assert of_encoder(t, np.column_stack([0.5 * np.floor(0.8 * t), 0.4 * t + 0.1 * np.sin(t)])) == []


def test_wheels_that_turn_while_rows_are_missing_do_not_leap():
    t = 0.01 * np.arange(2000)
    angles = 0.001 * np.random.default_rng(1).integers(0, 2, (2000, 2)) + 0.5 * (t > 10.0)[:, None]
    kept = (t <= 10.0) | (t > 10.6)
    assert of_encoder(t[kept], angles[kept]) == []


def test_a_camera_that_jumps_is_no_counter_that_was_set_anew():
    def moved(t, values):
        values[t > 7.0, :2] += [0.6, 0.3]
        return values

    assert found("kinect", moved) == [("camera_jump", "kinect", (0,))]


def test_a_camera_that_is_moved_by_a_few_centimetres_jumps():
    def moved(t, values):
        values[t > 6.0, :2] += [0.03, -0.02]
        return values

    assert found("kinect", moved) == [("camera_jump", "kinect", (0,))]


@pytest.mark.parametrize("seed", [9101, 9115])
def test_fixes_that_are_lost_on_a_bend_are_no_jump(seed):
    run = two_wheels.drive(seed, 15.0, **SOUND, speeds_m_s=(0.1, 0.7), rates_rad_s=(-2.5, 2.5))
    camera = run.channels["kinect"]
    kept = (camera.t < 6.2) | (camera.t > 6.8)
    lost = replace(camera, t=camera.t[kept], values=camera.values[kept])
    run = replace(run, channels=run.channels | {"kinect": lost})
    assert "camera_jump" not in {finding.fault for finding in check(two_wheels.model(), [run]).findings}


@pytest.mark.first_case
@pytest.mark.parametrize("dash_s", [0.04, 0.1, 0.4])
def test_a_short_dash_under_a_late_camera_is_no_jump_and_no_fix_that_is_off(dash_s):
    t = 0.02 * np.arange(600)
    way = 0.6 * np.clip(t - 5.0, 0.0, dash_s)
    fix_t = np.arange(0.0, 11.9, 0.1)
    seen = np.interp(fix_t - 0.15, t, way)[:, None] * [1.0, 0.0, 0.0]
    seen += 0.001 * np.random.default_rng(3).standard_normal(seen.shape)
    run = Recording("mine", "velocity_base", {
        "command": Channel(t, ("vx", "vy", "wz"), np.gradient(way, t)[:, None] * [1.0, 0.0, 0.0]),
        "encoder": Channel(t, ("theta_1", "theta_2"), np.repeat(way[:, None] / two_wheels.RADIUS_M, 2, axis=1)),
        "kinect": Channel(fix_t, ("x", "y", "phi"), seen),
    })
    found = {finding.fault for finding in check(two_wheels.model(), [run]).findings}
    assert not found & {"camera_jump", "camera_outliers", "counter_reset", "robot_carried"}


def test_a_command_that_turns_the_other_way_in_degrees_is_told_as_both():
    turned = found("command", lambda t, values: values * [1.0, 1.0, -np.degrees(1.0)])
    assert {(fault, runs) for fault, _, runs in turned} == {("wrong_unit", (0,)), ("command_sign", (0,))}


def test_a_command_that_nobody_filled_in_is_told():
    assert found("command", lambda t, values: 0.0 * values) == [("channel_dead", "command", (0,))]


def dead(ways, left_m, recorded=(1.0, 1.0)):
    """What is dead in 10 s in which wheels go ways (500, 2) [m] under a marker so far left of the middle."""
    model, t, rng = two_wheels.model(), 0.02 * np.arange(500), np.random.default_rng(2)
    motion = np.diff(ways, axis=0, prepend=0.0) / two_wheels.RADIUS_M @ model.rover.plant.geometry.forward.T
    heading = np.cumsum(motion[:, 2])
    places = np.cumsum(motion[:, :1] * np.column_stack([np.cos(heading), np.sin(heading)]), axis=0)
    places += left_m * np.column_stack([-np.sin(heading), np.cos(heading)])
    poses = np.column_stack([places, heading]) + 0.001 * rng.standard_normal((500, 3))
    run = Recording("rover", "velocity_base", {
        "encoder": Channel(t, ("theta_right", "theta_left"), ways / two_wheels.RADIUS_M * recorded),
        "kinect": Channel(t, ("x", "y", "phi"), poses),
    })
    base = base_of(run, robot_of(model, [run], ["a run"]), model.rover)
    return [(finding.fault, finding.channel) for finding in dead_findings(run, base)]


SWINGS_M = np.abs((0.004 * np.arange(500) + 0.5) % 1.0 - 0.5)[:, None]  # of a wheel, to and fro


@pytest.mark.parametrize("left_m", [-0.3, -0.05, 0.0, 0.05, 0.3])
def test_a_wheel_about_which_the_robot_pivots_is_not_dead(left_m):
    assert dead(SWINGS_M * [1.0, 0.0], left_m) == []


@pytest.mark.parametrize("left_m", [-0.05, 0.05])
@pytest.mark.parametrize("ways", [(1.0, -1.0), (1.0, 0.7)])
@pytest.mark.parametrize("recorded", [(1.0, 0.0), (0.0, 0.0)])
def test_a_wheel_that_turns_without_its_angle_is_dead_wherever_the_marker_is(left_m, ways, recorded):
    assert dead(SWINGS_M * ways, left_m, recorded) == [("channel_dead", "encoder")]


@pytest.mark.parametrize("ways, recorded", [
    ((0.31, 0.29), (0.0, 0.0)), ((0.31, 0.29), (0.0, -1.0)), ((0.4, 0.2), (0.0, 2.0)), ((0.29, 0.31), (57.3, 0.0)),
])
def test_no_marker_goes_as_far_on_a_circle_as_a_wheel_that_is_dead(ways, recorded):
    """Whatever the other wheel counts."""
    assert dead(0.02 * np.arange(500)[:, None] * ways, 0.05, recorded) == [("channel_dead", "encoder")]


@pytest.mark.first_case
@pytest.mark.parametrize("heading", [0.0, 1.0])
def test_a_heading_that_nobody_filled_in_is_told(heading):
    assert found("kinect", lambda t, values: values * [1.0, 1.0, 0.0] + [0.0, 0.0, heading]) == [
        ("channel_dead", "kinect", (0,))
    ]


@pytest.mark.slow
def test_a_command_of_a_robot_that_rests_is_not_dead():
    """Its encoders go to and fro by a count."""
    still = {"speeds_m_s": (0.0, 0.0), "rates_rad_s": (0.0, 0.0)}
    run = two_wheels.drive(645, 60.0, **SOUND, **still)
    encoder, count = run.channels["encoder"], 2.0 * np.pi / two_wheels.COUNTS
    shaken = encoder.values + count * np.random.default_rng(0).integers(0, 2, encoder.values.shape)
    run = replace(run, channels=run.channels | {"encoder": replace(encoder, values=shaken)})
    assert not [finding for finding in check(two_wheels.model(), [run]).findings if finding.channel == "command"]


def test_wheels_that_spin_for_a_while_are_no_counter_that_was_set_anew():
    run = two_wheels.drive(646, 30.0, **SOUND, camera_hz=2.0)
    encoder = run.channels["encoder"]
    spins = np.clip(encoder.t - 20.0, 0.0, 0.4)[:, None] / two_wheels.RADIUS_M
    run = replace(run, channels=run.channels | {"encoder": replace(encoder, values=encoder.values + spins)})
    faults = {finding.fault for finding in check(two_wheels.model(), [run]).findings}
    assert faults and "counter_reset" not in faults


def pushed(seed, seconds, since, until, way):
    """What is found in two runs, of which the first is pushed across the room in between, that many metres."""
    runs = [two_wheels.drive(seed + i, seconds, **SOUND) for i in range(2)]
    kinect = runs[0].channels["kinect"]
    values = kinect.values.copy()
    values[:, 1] += way * np.clip((kinect.t - since) / (until - since), 0.0, 1.0)
    runs[0] = replace(runs[0], channels=runs[0].channels | {"kinect": replace(kinect, values=values)})
    return check(two_wheels.model(), runs).findings


def test_a_robot_that_is_pushed_as_it_drives_is_cut_out_for_as_long_as_it_is_pushed():
    """While it drives along the push, or fast, it has more in common with what the wheels say than not."""
    (finding,) = pushed(640, 24.0, 17.0, 19.0, 0.4)
    assert "robot_carried" in (finding.fault, *finding.rivals) and finding.runs == (0,)
    assert 16.0 < finding.from_s < 17.2 and 18.8 < finding.to_s < 20.0


@pytest.mark.slow
def test_a_long_push_in_which_the_robot_drives_along_for_a_while_is_told_once():
    (finding,) = pushed(642, 40.0, 17.0, 25.0, 1.6)
    assert finding.runs == (0,) and finding.from_s < 17.2 and finding.to_s > 24.8


def test_a_robot_that_reverses_under_a_late_camera_is_not_carried():
    late = SOUND | {"late_s": 0.2, "speeds_m_s": (-0.6, 0.6), "rates_rad_s": (-2.0, 2.0)}
    assert not check(two_wheels.model(), [two_wheels.drive(760 + i, 24.0, **late) for i in range(2)]).findings


def after_a_rest(channel, spun=0.0, rest_s=4.0):
    """A channel of a robot that rests before it drives, with wheels that turn in the air meanwhile."""
    t = np.arange(0.0, rest_s, np.median(np.diff(channel.t)))
    turned = 6.0 * np.interp(t, [0.5, 2.5], [0.0, 1.0])[:, None] * spun
    noise = 0.0 if np.any(spun) or channel.columns[0] != "x" else two_wheels.FIX_RMS
    rest = channel.values[0] + turned + noise * np.random.default_rng(1).standard_normal((len(t), 1))
    values = np.vstack([rest, channel.values + 6.0 * np.asarray(spun)])
    return replace(channel, t=np.concatenate([t, channel.t + rest_s]), values=values)


def test_a_robot_that_mostly_rests_under_a_camera_that_rounds_is_not_carried():
    """Most motions from fix to fix are none, whatever the latency."""
    run = two_wheels.drive(770, 24.0, **SOUND | {"speeds_m_s": (-0.6, 0.6), "rates_rad_s": (-2.0, 2.0)})
    channels = {name: after_a_rest(run.channels[name], rest_s=40.0) for name in ("encoder", "kinect")}
    kinect = channels["kinect"]
    channels["kinect"] = replace(kinect, values=np.round(kinect.values, 2))
    found = check(two_wheels.model(), [replace(run, channels=channels)]).findings
    assert not [finding for finding in found if finding.fault == "robot_carried"]


def test_wheels_that_turn_in_the_air_before_the_robot_drives_are_no_clock_that_is_off():
    """A clock that is off by seconds moves that time out of the run, and explains nothing of it."""
    runs = []
    for i in range(2):
        sound = two_wheels.drive(650 + i, 16.0, **SOUND)
        spun = {"encoder": np.array([1.0, 1.3])} if i == 0 else {}
        runs.append(replace(sound, channels={
            name: after_a_rest(sound.channels[name], spun.get(name, 0.0)) for name in ("encoder", "kinect")
        }))
    (finding,) = check(two_wheels.model(), runs).findings
    assert finding.fault == "robot_lifted" and finding.runs == (0,)
    assert finding.from_s < 0.7 and 2.3 < finding.to_s < 3.5


def test_a_wheel_that_stands_while_the_robot_turns_about_it_is_not_frozen():
    """The other one goes three quarters round it: the way is longer than its chord."""
    t = 0.02 * np.arange(900)
    way = 2.0 * two_wheels.HALF_TRACK_M * 1.5 * np.pi
    left = np.interp(t, [8.0, 10.0, 14.0, 16.0], [0.0, 0.4, 0.4, 0.8])
    right = left + np.interp(t, [2.0, 6.0, 10.0, 14.0], [0.0, way, way, 2.0 * way])
    phi = (right - left) / (2.0 * two_wheels.HALF_TRACK_M)
    middle, steps = 0.5 * (phi[1:] + phi[:-1]), 0.5 * np.diff(right + left)
    x, y = (np.concatenate([[0.0], np.cumsum(steps * of(middle))]) for of in (np.cos, np.sin))
    seen = np.column_stack([x, y, phi]) + 5e-4 * np.random.default_rng(1).standard_normal((900, 3))
    count = 2.0 * np.pi / two_wheels.COUNTS
    wheels = count * np.floor(np.column_stack([right, left]) / two_wheels.RADIUS_M / count)
    run = Recording("mine", "velocity_base", {
        "encoder": Channel(t, ("theta_1", "theta_2"), wheels), "kinect": Channel(t[::2], ("x", "y", "phi"), seen[::2]),
    })
    assert check(two_wheels.model(), [run]).findings == []
