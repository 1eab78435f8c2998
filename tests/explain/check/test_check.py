"""Do the checks find what is wrong with recordings, and nothing in sound ones?"""

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest

from drake_ispace.blocks.errors import InputError
from drake_ispace.explain.check.check import check
from drake_ispace.explain.check.compare.frames import _grid
from drake_ispace.explain.check.repaired import save_repaired
from drake_ispace.explain.check.sampling.samples import wrap_findings
from drake_ispace.faults.repair import rows
from drake_ispace.files.recording import Channel, Recording, load
from drake_ispace.hiding import hide
from drake_ispace.scenario import load_scenario
from hidden import two_wheels
from hidden.generator import generate
from hidden.outside import cases, runs_of

MODEL = {"omni": "omni_multirate", "pendulum": "pendulum_multirate"}
#: One of the two every time, both with the slow tests.
OMNI = ["omni", pytest.param("pendulum", marks=pytest.mark.slow)]
PENDULUM = [pytest.param("omni", marks=pytest.mark.slow), "pendulum"]


@pytest.fixture(scope="module")
def sound():
    """Robot -> two sound runs of 12 s."""
    return {robot: list(hide(model, robot, {}, ["square", "figure_eight"], 4, 12.0).values())
            for robot, model in MODEL.items()}


def changed(run, channel, values=lambda t, v: v, stamps=lambda t: t):
    """A copy of a run with other values or stamps in a channel."""
    old = run.channels[channel]
    columns = old.columns[: old.values.shape[1]]
    new = replace(old, t=stamps(old.t.copy()), values=values(old.t.copy(), old.values.copy()), period_s=None)
    if "t_received" in columns:
        new = replace(new, columns=columns[:-1], values=new.values[:, :-1])
    return replace(run, channels=run.channels | {channel: new})


def without(run, channel):
    return replace(run, channels={name: c for name, c in run.channels.items() if name != channel})


def found(runs, robot):
    return check(MODEL[robot], runs).findings


@pytest.mark.parametrize("robot", MODEL)
def test_nothing_is_found_in_sound_runs(sound, robot):
    assert found(sound[robot], robot) == []


def marked(run, ahead_m, left_m):
    """A run whose marker is so far from the middle of the robot."""
    def placed(t, v):
        c, s = np.cos(v[:, 2]), np.sin(v[:, 2])
        v[:, :2] += np.column_stack([c * ahead_m - s * left_m, s * ahead_m + c * left_m])
        return v

    return changed(run, "kinect", placed)


@pytest.mark.first_case
@pytest.mark.parametrize("robot", PENDULUM)
@pytest.mark.parametrize("place", [(0.25, 0.0), (0.0, -0.4), (0.7, 0.0), (-0.5, 0.5)])
def test_a_marker_anywhere_on_the_robot_accuses_nobody(sound, robot, place):
    assert found([marked(run, *place) for run in sound[robot]], robot) == []


@pytest.mark.first_case
@pytest.mark.parametrize("robot", MODEL)
@pytest.mark.parametrize("degrees", [60, *(pytest.param(degrees, marks=pytest.mark.slow) for degrees in (30, -150))])
def test_headings_may_be_off_by_any_angle(sound, robot, degrees):
    turned = lambda t, v: v + np.deg2rad(degrees) * (np.arange(v.shape[1]) == 2)  # noqa: E731
    checked = check(MODEL[robot], [changed(run, "kinect", turned) for run in sound[robot]])
    (finding,) = checked.findings
    assert (finding.fault, finding.what) == ("heading_offset", f"headings off by {degrees} degrees")
    for run, plain in zip(checked.repaired, sound[robot], strict=True):
        left = run.channels["kinect"].column("phi") - plain.channels["kinect"].column("phi")
        assert np.abs(left).max() < 0.02


@pytest.mark.slow
@pytest.mark.parametrize(("robot", "channel", "factors", "fault"), [
    ("omni", "encoder", (4,) * 4, "counts_per_turn"), ("omni", "kinect", (1, -1, 1), "camera_axis_mirrored"),
    ("pendulum", "encoder", (1, -1), "wheel_sign"), ("pendulum", "kinect", (1e3, 1e3, 1), "wrong_unit"),
])
def test_mistakes_are_found_beside_a_marker_that_is_not_at_the_middle(sound, robot, channel, factors, fault):
    scaled = lambda t, v: v[:, : len(factors)] * np.array(factors)  # noqa: E731
    (finding,) = found([changed(marked(run, 0.15, 0.25), channel, scaled) for run in sound[robot]], robot)
    assert (finding.fault, finding.channel) == (fault, channel)


@pytest.mark.parametrize("robot", OMNI)
@pytest.mark.parametrize(("channel", "factors", "fault"), [
    ("kinect", (1e3, 1e3, 1), "wrong_unit"), ("kinect", (-1, 1, 1), "camera_axis_mirrored"),
    ("encoder", (-1,) + (1,) * 3, "wheel_sign"), ("encoder", (4,) * 4, "counts_per_turn"),
    ("torque", (-1,) * 4, "torque_sign"),
    *(pytest.param(*case, marks=pytest.mark.slow) for case in [
        ("kinect", (1, 1, 180 / np.pi), "wrong_unit"), ("encoder", (180 / np.pi,) * 4, "wrong_unit"),
        ("torque", (1e3,) * 4, "wrong_unit"),
    ]),
])
def test_units_and_signs_of_whole_logs(sound, robot, channel, factors, fault):
    def scaled(t, v):
        v[:, : len(factors)] *= factors[: v.shape[1]]
        return v

    (finding,) = found([changed(run, channel, scaled) for run in sound[robot]], robot)
    assert (finding.fault, finding.channel, finding.run) == (fault, channel, "all")
    assert finding.drop_in_deviance > 12.0 and finding.repairs


@pytest.mark.slow
@pytest.mark.parametrize("robot", MODEL)
@pytest.mark.parametrize("factor", [20.0, pytest.param(5.0, marks=pytest.mark.slow)])
def test_torques_in_no_known_unit_are_told_with_the_factor(sound, robot, factor):
    (finding,) = found([changed(run, "torque", lambda t, v: factor * v) for run in sound[robot]], robot)
    assert (finding.fault, finding.channel, finding.run) == ("wrong_unit", "torque", "all")
    assert finding.repairs[0].matrix[0][0] == pytest.approx(1.0 / factor, rel=0.1)


@pytest.mark.slow
@pytest.mark.parametrize("robot", PENDULUM)
def test_a_motor_may_be_weak_and_a_robot_heavy(sound, robot):
    for factor in (2.5, 0.5):
        assert not found([changed(run, "torque", lambda t, v, k=factor: k * v) for run in sound[robot]], robot)


@pytest.mark.first_case
@pytest.mark.parametrize(("matrix", "fault"), [
    (np.diag([1, 1, 1, 1, 1, -1]), "imu_axes"), (np.diag([1 / 9.80665] * 3 + [1] * 3), "wrong_unit"),
    (np.eye(6)[[2, 0, 1, 5, 3, 4]], "imu_axes"),
])
def test_axes_and_units_of_the_imu(sound, matrix, fault):
    (finding,) = found([changed(run, "imu", lambda t, v: v @ matrix.T) for run in sound["pendulum"]], "pendulum")
    assert (finding.fault, finding.channel) == (fault, "imu")


@pytest.mark.slow
def test_gravity_that_was_taken_off(sound):
    runs = [changed(run, "imu", lambda t, v: v - [0, 0, 9.80665, 0, 0, 0]) for run in sound["pendulum"]]
    assert [finding.fault for finding in found(runs, "pendulum")] == ["gravity_missing"]


@pytest.mark.parametrize(("stamps", "fault"), [
    (lambda t: t + 0.8, "clock_offset"), (lambda t: 1e3 * t, "time_unit"), (lambda t: t + 1.7e9, "epoch_stamps"),
    (lambda t: t + 300.0, "clocks_disjoint"),
])
def test_clocks_of_the_camera(sound, stamps, fault):
    (finding,) = found([changed(run, "kinect", stamps=stamps) for run in sound["omni"]], "omni")
    assert (finding.fault, finding.channel) == (fault, "kinect")


@pytest.mark.first_case
@pytest.mark.parametrize("robot", MODEL)
@pytest.mark.parametrize("lost", [0.0, 0.2])
def test_frames_that_are_stamped_when_they_arrive(sound, robot, lost):
    run, rng = sound[robot][1], np.random.default_rng(0)
    kinect = run.channels["kinect"]
    kept = rng.random(len(kinect.t)) >= lost
    fewer = replace(run, channels=run.channels | {"kinect": rows(kinect, kept)})
    jittered = changed(fewer, "kinect", stamps=lambda t: np.sort(t + 0.02 * rng.standard_normal(len(t))))
    (finding,) = found([jittered], robot)
    assert (finding.fault, finding.channel) == ("stamp_jitter", "kinect")
    (repair,) = finding.repairs
    off = repair.apply(jittered).channels["kinect"].t - kinect.t[kept]
    assert np.mean(np.abs(off - np.median(off)) < 0.01) > 0.95
    assert found([fewer], robot) == []


@pytest.mark.slow
@pytest.mark.parametrize("gear", [7.0, 1.0 / 34.0])
def test_any_whole_number_may_be_the_gear_that_was_forgotten(sound, gear):
    finding = found([changed(run, "encoder", lambda t, v: gear * v) for run in sound["omni"]], "omni")[0]
    assert finding.fault == "counts_per_turn"
    (repair,) = finding.repairs
    assert np.allclose(repair.matrix, np.eye(4) / gear)


@pytest.mark.slow
@pytest.mark.parametrize(("gear", "told", "said"), [
    (2.6, 2.6, "turns 2.6 times"), (3.7, 4.0, "turns 4 times too large, as measured 3.7"),
])
def test_a_gear_that_is_near_no_whole_number_is_told_as_measured(sound, gear, told, said):
    finding = found([changed(run, "encoder", lambda t, v: gear * v) for run in sound["omni"]], "omni")[0]
    assert finding.fault == "counts_per_turn" and finding.what.startswith(said)
    assert np.diag(finding.repairs[0].matrix) == pytest.approx(np.full(4, 1.0 / told), rel=0.02)


def test_an_offset_of_a_clock_has_an_interval(sound):
    (finding,) = found([changed(run, "kinect", stamps=lambda t: t - 1.5) for run in sound["pendulum"]], "pendulum")
    low, high = finding.interval
    assert low <= 1.5 <= high and high - low < 0.5


def test_a_latency_is_no_fault(sound):
    assert found([changed(run, "kinect", stamps=lambda t: t + 0.08) for run in sound["omni"]], "omni") == []


@pytest.mark.slow
def test_the_wheels_own_clock_is_told_from_that_of_the_others(sound):
    (finding,) = found([changed(run, "encoder", stamps=lambda t: t + 1.0) for run in sound["omni"]], "omni")
    assert (finding.fault, finding.channel) == ("clock_offset", "encoder")


@pytest.mark.slow
def test_one_run_alone_may_be_wrong(sound):
    first, second = sound["omni"]
    (finding,) = found([changed(first, "encoder", lambda t, v: -v), second], "omni")
    assert finding.fault == "encoder_sign" and finding.runs == (0,)


@pytest.mark.slow
def test_a_gyro_tells_swapped_wheels_from_a_mirrored_room(sound):
    wheels = [changed(run, "encoder", lambda t, v: v[:, ::-1]) for run in sound["pendulum"]]
    assert found(wheels, "pendulum")[0].fault == "wheels_swapped"
    room = [changed(run, "kinect", lambda t, v: v * ([1, -1, -1, 1][: v.shape[1]])) for run in sound["pendulum"]]
    assert found(room, "pendulum")[0].fault == "camera_axis_mirrored"


@pytest.mark.parametrize("begin, end", [(1234, 1235), (1234, None)])
def test_an_odd_leap_of_one_wheel_hides_no_wraps(begin, end):
    t = 0.005 * np.arange(4000)
    angles = (t[:, None] * [3.0, 2.0, 2.5, 1.5]) % (2.0 * np.pi)
    angles[begin:end, 3] += 3.0
    wheels = Channel(t, ("theta_1", "theta_2", "theta_3", "theta_4"), angles)
    (finding,) = wrap_findings(Recording("omni", channels={"encoder": wheels}), 2000.0)
    assert finding.fault == "angle_wrap"


@pytest.mark.parametrize("moved", [
    lambda t: 4.5 * t,  # 0.18 rad a step: every 35th starts anew
    lambda t: np.where(t < 30.0, -1e-3 * (np.rint(25.0 * t) % 200 == 100), -0.5 * (t - 30.0)),  # shakes at rest, goes
], ids=["fast", "rests"])
def test_wheels_that_start_anew_often_or_at_rest_are_continued(moved):
    t = 0.04 * np.arange(1500)
    angles = moved(t)
    run = Recording("omni", channels={"encoder": Channel(t, ("theta_1",), angles[:, None] % (2.0 * np.pi))})
    (finding,) = wrap_findings(run, 2000.0)
    turned = finding.repairs[0].apply(run).channels["encoder"].values[:, 0] - angles
    assert np.allclose(turned, turned[0])


@pytest.mark.slow
def test_places_in_steps_of_10_cm_are_coarse_and_nothing_else(sound):
    rough = [changed(run, "kinect", lambda t, v: np.column_stack([np.round(v[:, :2], 1), v[:, 2:]]))
             for run in sound["omni"]]
    assert {finding.fault for finding in found(rough, "omni")} == {"channel_quantised"}


def test_counters_that_wrap_are_continued(sound):
    wrapped = [changed(run, "encoder", lambda t, v: v % (2.0 * np.pi)) for run in sound["omni"]]
    checked = check(MODEL["omni"], wrapped)
    assert [finding.fault for finding in checked.findings] == ["angle_wrap"]
    turned = checked.repaired[0].channels["encoder"].values - sound["omni"][0].channels["encoder"].values
    assert np.allclose(turned, turned[0])


def carried(t, v):
    """0.8 m to the side within a second, in the middle of the run."""
    v[:, 1] += 0.8 * np.clip(t - 6.0, 0.0, 1.0)
    return v


def frozen(t, v):
    inside = (t > 5.0) & (t < 7.0)
    v[inside] = v[inside][0]
    return v


def frozen_column(t, v, column=1):
    v[:, [column]] = frozen(t, v[:, [column]])
    return v


def set_anew(t, v, column=1):
    v[t > 6.0, column] -= 7.3
    return v


def spiked(t, v):
    v[[40, 80], 0] += 0.7
    return v


def hardly_spiked(t, v):
    """Fixes that are off by less than the camera alone could tell from motion, a single one and two in a row."""
    v[[40, 44, 45], 1] += 0.13
    return v


def turned_over(t, v):
    """Headings of single fixes that are off, one of them the first of all."""
    v[[0, 40, 44, 45], 2] += np.pi
    return v


def jumped(t, v):
    v[t > 6.0, 0] += 0.3
    return v


@pytest.mark.first_case
@pytest.mark.parametrize(("channel", "values", "fault"), [
    ("kinect", carried, "robot_carried"), ("kinect", frozen, "channel_frozen"), ("encoder", frozen, "channel_frozen"),
    ("kinect", spiked, "camera_outliers"), ("kinect", hardly_spiked, "camera_outliers"),
    ("kinect", jumped, "camera_jump"), ("torque", frozen, "channel_frozen"),
])
def test_what_is_limited_in_time_is_found_there(sound, channel, values, fault):
    first, second = sound["omni"]
    (finding,) = found([changed(first, channel, values), second], "omni")
    assert finding.fault == fault and finding.limited and finding.runs == (0,)
    assert 2.0 < finding.from_s < 7.5 and finding.to_s < 10.0


@pytest.mark.first_case
@pytest.mark.parametrize("robot", PENDULUM)
@pytest.mark.parametrize("column", [0, 1])
@pytest.mark.parametrize(("values", "fault", "what", "lasts_s"), [
    (frozen_column, "channel_frozen", "repeats, then leaps", 2.0), (set_anew, "counter_reset", "leaps", 0.0),
])
def test_one_wheel_that_stops_or_starts_anew_is_told(sound, robot, column, values, fault, what, lasts_s):
    first, second = sound[robot]
    spoilt = changed(first, "encoder", lambda t, v: values(t, v, column))
    (finding,) = found([spoilt, second], robot)
    assert finding.fault == fault and finding.runs == (0,) and what in finding.what
    assert first.channels["encoder"].columns[column] in finding.what
    assert finding.to_s - finding.from_s == pytest.approx(lasts_s, abs=0.1)


def with_lost_rows(run, channel, at_s, lost_s):
    """A copy of a run without some time of a channel, whose later stamps are moved up."""
    old = run.channels[channel]
    late, kept = old.t >= at_s, (old.t < at_s) | (old.t >= at_s + lost_s)
    moved = replace(old, t=(old.t - lost_s * late)[kept], values=old.values[kept])
    return replace(run, channels=run.channels | {channel: moved})


@pytest.mark.first_case
@pytest.mark.parametrize("robot", MODEL)
def test_angles_that_are_lost_where_later_stamps_are_moved_up_are_a_clock_that_jumps(sound, robot):
    first, second = sound[robot]
    lost_s = 0.5
    (finding,) = found([with_lost_rows(first, "encoder", 4.0, lost_s), second], robot)
    assert (finding.fault, finding.channel, finding.runs) == ("clock_jump", "encoder", (0,))
    (repair,) = finding.repairs
    assert repair.since_s == pytest.approx(4.0, abs=0.01) and repair.offset_s == pytest.approx(lost_s, abs=0.05)


def with_rows_twice(channel, at, count):
    """The channel with rows that come a second time, and later stamps moved on."""
    values, period_s = channel.values, np.median(np.diff(channel.t))
    values = np.vstack([values[:at], values[at - count : at], values[at:]])
    return replace(channel, t=channel.t[0] + period_s * np.arange(len(values)), values=values)


@pytest.mark.slow
def test_rows_that_come_twice_where_later_stamps_are_moved_are_a_clock_of_the_wheels_that_jumps():
    exact = {"left_share": 0.0, "late_s": 0.0, "lag_s": 0.0, "in_step": True}
    first, second = (two_wheels.drive(680 + i, 20.0, **exact) for i in range(2))
    old = first.channels["encoder"]
    stitched = replace(first, channels=first.channels | {"encoder": with_rows_twice(old, 500, 60)})
    checked = check(two_wheels.model(), [stitched, second])
    found = {(finding.fault, finding.channel, finding.runs) for finding in checked.findings}
    assert found == {("rows_duplicated", "encoder", (0,)), ("clock_jump", "encoder", (0,))}
    repaired = checked.repaired[0].channels["encoder"]
    angles = np.column_stack([np.interp(old.t, repaired.t, angle) for angle in repaired.values.T])
    assert np.abs(angles - old.values).max() < 0.2


def test_rows_that_come_twice_are_no_counter_that_starts_anew():
    t = 0.02 * np.arange(900)
    once = Channel(t, ("theta_1",), (2.0 * np.pi / 60 * np.arange(900) + 0.01 * np.sin(t))[:, None])
    recording = lambda wheels: Recording("omni", channels={"encoder": wheels})  # noqa: E731
    assert not list(wrap_findings(recording(with_rows_twice(once, 450, 60)), 2000.0))


def test_a_counter_that_starts_anew_once_at_a_steady_speed_is_no_row_that_comes_twice():
    t = 0.02 * np.arange(500)
    angles = 2.0 * np.pi / 200 * np.minimum(np.arange(500), 320)
    wheels = Channel(t, ("theta_1", "theta_2"), np.column_stack([angles, angles]) % (2.0 * np.pi))
    (finding,) = wrap_findings(Recording("mine", channels={"encoder": wheels}), 2000.0)
    assert finding.fault == "angle_wrap"


@pytest.mark.slow
@pytest.mark.parametrize("robot", MODEL)
def test_a_torque_that_lost_rows_where_later_stamps_are_moved_up_has_a_clock_that_jumps(sound, robot):
    first, second = sound[robot]
    lost_s = 0.5
    (finding,) = found([with_lost_rows(first, "torque", 4.0, lost_s), second], robot)
    assert (finding.fault, finding.channel, finding.runs) == ("clock_jump", "torque", (0,))
    (repair,) = finding.repairs
    assert repair.offset_s == pytest.approx(lost_s, abs=0.1)
    assert 1.5 < repair.since_s < 5.0  # on a straight line at one speed a torque does not say when


@pytest.mark.slow
@pytest.mark.parametrize("robot", MODEL)
def test_a_clock_that_leaves_out_some_time_jumps_there(sound, robot):
    first, second = sound[robot]
    kinect = first.channels["kinect"]
    jumped = replace(kinect, t=kinect.t + 0.5 * (kinect.t >= 4.0))
    (finding,) = found([replace(first, channels=first.channels | {"kinect": jumped}), second], robot)
    assert finding.fault == "clock_jump" and finding.from_s == jumped.t[jumped.t >= 4.5][0]


@pytest.mark.slow
def test_a_check_is_printed_in_sentences(sound):
    first, second = sound["omni"]
    assert str(check(MODEL["omni"], [first, second])) == "The recordings agree with each other"
    title, line = str(check(MODEL["omni"], [changed(first, "kinect", jumped), second])).splitlines()
    assert title == "The recordings agree with each other once this is repaired or left out"
    wrong = [changed(run, "encoder", lambda t, v: -v) for run in (first, second)]
    assert str(check(MODEL["omni"], wrong)).startswith("What is wrong with the recordings")
    assert "kinect in " in line and "the place jumps by 0.299 m" in line and "repair: " in line


@pytest.mark.parametrize("fixes", [0, 2])
def test_wheels_with_nothing_beside_them_do_not_agree_with_it(fixes):
    run = generate("omni", "circle", {}, 8.0, 5)
    kinect = run.channels["kinect"]
    few = {"kinect": replace(kinect, t=kinect.t[:fixes], values=kinect.values[:fixes])} if fixes else {}
    checked = check(MODEL["omni"], replace(run, channels={"encoder": run.channels["encoder"]} | few))
    assert str(checked) == "Nothing was compared: that takes wheels and another channel, for some seconds together"


@pytest.mark.first_case
@pytest.mark.parametrize(("robot", "channel", "column"), [("omni", "torque", 0), ("pendulum", "imu", 4)])
def test_a_column_that_stops_for_a_while_is_told(sound, robot, channel, column):
    first, second = sound[robot]
    (finding,) = found([changed(first, channel, lambda t, v: frozen_column(t, v, column)), second], robot)
    assert (finding.fault, finding.channel, finding.runs) == ("channel_frozen", channel, (0,))
    assert finding.what == f"{first.channels[channel].columns[column]} repeats"


def test_a_single_fix_of_a_slow_camera_that_is_off_is_an_outlier(sound):
    first, second = sound["omni"]
    kinect = first.channels["kinect"]
    slow = replace(kinect, t=kinect.t[::3], values=kinect.values[::3].copy(), period_s=None)
    slow.values[12, 1] += 0.3
    (finding,) = found([replace(first, channels=first.channels | {"kinect": slow}), second], "omni")
    assert finding.fault == "camera_outliers" and finding.from_s == finding.to_s == slow.t[12]


@pytest.mark.slow
def test_headings_of_single_fixes_that_are_off_are_left_out(sound):
    first, second = sound["omni"]
    checked = check(MODEL["omni"], [changed(first, "kinect", turned_over), second])
    (finding,) = checked.findings
    assert finding.fault == "camera_outliers" and finding.runs == (0,) and finding.what.startswith("4 fixes")
    left = np.delete(first.channels["kinect"].t, [0, 40, 44, 45])
    assert np.array_equal(checked.repaired[0].channels["kinect"].t, left)


@pytest.mark.slow
@pytest.mark.parametrize("angle_rad", [0.5 * np.pi, -0.5 * np.pi, np.pi])
def test_headings_that_are_turned_for_a_while_are_turned_back(sound, angle_rad):
    def turned(t, v):
        v[(t > 3.0) & (t < 5.0) | (t > 11.0), 2] += angle_rad
        return v

    first, second = sound["omni"]
    checked = check(MODEL["omni"], [changed(first, "kinect", turned), second])
    (finding,) = checked.findings
    assert finding.fault == "heading_offset" and finding.limited and finding.runs == (0,)
    off = checked.repaired[0].channels["kinect"].column("phi") - first.channels["kinect"].column("phi")
    assert np.allclose(np.sin(off), 0.0, atol=1e-12) and np.allclose(np.cos(off), 1.0)


@pytest.mark.slow
def test_headings_of_every_fifth_fix_are_turned_back(sound):
    def turned(t, v):
        v[1::5, 2] += np.pi
        return v

    first, second = sound["omni"]
    (finding,) = found([changed(first, "kinect", turned), second], "omni")
    assert finding.fault == "heading_offset" and finding.limited


def test_a_hand_between_outliers_is_found_as_well(sound):
    def both(t, v):
        v[[20, 110], 0] += 0.7
        return carried(t, v)

    first, second = sound["omni"]
    faults = {finding.fault: finding for finding in found([changed(first, "kinect", both), second], "omni")}
    assert set(faults) == {"camera_outliers", "robot_carried"} and 5.0 < faults["robot_carried"].from_s < 7.5


@pytest.mark.slow
def test_a_camera_of_another_run(sound):
    first, second = sound["omni"]
    stranger = replace(first, channels=first.channels | {"kinect": second.channels["kinect"]})
    (finding,) = found([stranger, second], "omni")
    assert (finding.fault, finding.channel) == ("channel_of_another_run", "kinect")


def test_wheels_by_name_cannot_be_mistaken(sound):
    encoder = sound["pendulum"][0].channels["encoder"]
    turned = replace(encoder, columns=encoder.columns[::-1], values=encoder.values[:, ::-1])
    assert found([replace(run, channels=run.channels | {"encoder": turned}) if i == 0 else run
                  for i, run in enumerate(sound["pendulum"])], "pendulum") == []


@pytest.mark.parametrize("channel", ["encoder", "kinect", "torque"])
def test_a_channel_without_samples_is_refused(sound, channel):
    first, *others = sound["omni"]
    none = rows(first.channels[channel], np.zeros(len(first.channels[channel].t), bool))
    with pytest.raises(InputError, match=f"run 1: channel {channel} holds no sample"):
        check("omni_multirate", [replace(first, channels=first.channels | {channel: none}), *others])


def with_one_sample(run, channel):
    one = rows(run.channels[channel], np.arange(len(run.channels[channel].t)) == 0)
    return replace(run, channels=run.channels | {channel: replace(one, file="run/its.csv")})


def test_an_encoder_of_one_sample_is_refused_with_its_file(sound):
    with pytest.raises(InputError, match=r"run 1: channel encoder \(run/its.csv\) holds one sample"):
        check("omni_multirate", [with_one_sample(sound["omni"][0], "encoder"), sound["omni"][1]])


def test_a_camera_that_saw_the_robot_once_is_as_good_as_none(sound):
    assert found([with_one_sample(sound["omni"][0], "kinect"), sound["omni"][1]], "omni") == []


def test_an_unknown_wheel_is_refused(sound):
    run = sound["pendulum"][0]
    encoder = replace(run.channels["encoder"], columns=("theta_r", "theta_x"))
    with pytest.raises(InputError, match="theta_x"):
        check(MODEL["pendulum"], [replace(run, channels=run.channels | {"encoder": encoder})])


def test_numbers_that_no_sensor_gives_are_refused(sound):
    with pytest.raises(InputError, match="theta_1"):
        check(MODEL["omni"], [changed(sound["omni"][0], "encoder", lambda t, v: v * 1e200)])


def test_repaired_copies_are_sound_and_say_what_was_done(sound, tmp_path):
    runs = [changed(run, "encoder", lambda t, v: v * [1, -1, 1, 1]) for run in sound["omni"]]
    runs[0] = changed(runs[0], "kinect", carried)
    checked = check(MODEL["omni"], runs)
    places = save_repaired(checked, runs, tmp_path)
    copies = [load(place) for place in places]
    assert len(copies) == 3 and check(MODEL["omni"], copies).findings == []
    assert all("wheel_sign" in copy.notes for copy in copies)


@pytest.fixture(scope="module")
def commanded():
    """Two runs of a robot on mecanum wheels whose drive follows its command a quarter of a second later."""
    lag = {"velocity_lag": {"time_constant_s": 0.15}, "velocity_delay": {"delay_s": 0.1}}
    model = load_scenario("velocity_base", ["rover.plant.wheels=mecanum", "rover.trajectory.heading=tangent"])
    return model, list(hide(model, "rover", lag, ["square", "trapezium"], 4, 12.0).values())


def test_a_drive_may_lag_behind_its_command(commanded):
    assert check(*commanded).findings == []


@pytest.mark.first_case
@pytest.mark.parametrize(("factors", "fault"), [
    ((1, 1, -1), "command_sign"), ((1e3, 1e3, 1), "wrong_unit"), ((1, 1, np.pi / 180.0), "wrong_unit"),
])
def test_columns_of_the_command(commanded, factors, fault):
    model, runs = commanded
    (finding,) = check(model, [changed(run, "command", lambda t, v: v * factors) for run in runs]).findings
    assert (finding.fault, finding.channel) == (fault, "command")


@pytest.mark.slow
def test_a_command_tells_swapped_wheels_from_a_mirrored_room():
    late = [two_wheels.drive(80 + i, 15.0, left_share=0.0, late_s=0.06, lag_s=0.02, in_step=True) for i in range(2)]
    swapped = [changed(run, "encoder", lambda t, v: v[:, ::-1].copy()) for run in late]
    (finding,) = check(two_wheels.model(), swapped).findings
    assert finding.fault == "wheels_swapped" and "camera_axis_mirrored" in finding.rivals


@pytest.mark.slow
@pytest.mark.parametrize("wheels", [
    lambda t, v: v * [1.004, 1.0], lambda t, v: v + 0.05 * np.sin(3.3 * t)[:, None] * (t[:, None] > 2.0),
])
def test_a_steady_turn_on_the_spot_accuses_nobody(wheels):
    """Whose wheels move by next to nothing ahead, where neither the camera nor the command does."""
    sound = {"left_share": 0.0, "late_s": 0.0, "lag_s": 0.02, "in_step": True}
    spin = two_wheels.drive(51, 30.0, **sound, speeds_m_s=(0.0, 0.0), rates_rad_s=(1.5, 1.5))
    runs = [two_wheels.drive(50, 15.0, **sound), changed(spin, "encoder", wheels)]
    assert check(two_wheels.model(), runs).findings == []


@pytest.mark.slow
@pytest.mark.parametrize(("speed", "rate", "lag_s"), [
    (0.0, 1.2, 0.0), (0.0, 1.2, 0.1), (0.3, 0.0, 0.0), (0.3, 0.5, 0.0), (0.3, 0.5, 0.1),
])
@pytest.mark.parametrize("gain", [pytest.param(0.0, marks=pytest.mark.slow), -0.03])
def test_steady_motion_accuses_nobody(speed, rate, lag_s, gain):
    """In which a gain looks like a drifting clock, and a turn like a share of the way."""
    steady = {"speeds_m_s": (speed, speed), "rates_rad_s": (rate, rate), "lag_s": lag_s, "others": {"gain_share": gain}}
    size = abs(gain) / 10.0
    runs = [two_wheels.drive(310 + i, 20.0, left_share=size, late_s=-gain, in_step=True, **steady) for i in range(2)]
    assert check(two_wheels.model(), runs).findings == []


@pytest.mark.slow
def test_headings_that_are_nothing_but_noise_are_in_no_other_unit():
    straight = {"speeds_m_s": (0.3, 0.3), "rates_rad_s": (0.0, 0.0), "left_share": 0.0, "late_s": 0.0, "lag_s": 0.0}
    runs = [two_wheels.drive(seed, 30.0, in_step=True, **straight) for seed in (0, 1)]
    assert check(two_wheels.model(), runs).findings == []


@pytest.mark.slow
def test_wheels_may_be_named_in_any_order(commanded):
    model, runs = commanded
    encoder = runs[0].channels["encoder"]
    order, names = [1, 0, 3, 2], ("theta_front_right", "theta_front_left", "theta_rear_right", "theta_rear_left")
    named = replace(encoder, columns=names, values=encoder.values[:, order], units={})
    assert check(model, [replace(runs[0], channels=runs[0].channels | {"encoder": named}), runs[1]]).findings == []


@pytest.mark.slow
@pytest.mark.parametrize("seconds", [40.0, pytest.param(100.0, marks=pytest.mark.slow)])
def test_a_steady_circle_hardly_says_whose_torque_it_is(seconds):
    """Its push towards the middle is constant, and what is left of the torque is noise."""
    run = hide("omni_multirate", "omni", {}, ["circle"], 3, seconds)["circle"]
    assert found([run], "omni") == []


def test_the_even_steps_of_half_an_hour_of_stamps_take_little_memory():
    t = 0.3 + 0.0953 * np.arange(19000) + np.random.default_rng(0).uniform(-0.02, 0.02, 19000)
    tracemalloc.start()
    grid = _grid(t)
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert grid.since_s == pytest.approx(0.3, abs=1e-3) and most < 400 * t.nbytes
    assert grid.step_s == pytest.approx(0.0953, abs=1e-3 / len(t))


@pytest.mark.first_case
@pytest.mark.parametrize("seconds", [5.0, 6.0])
def test_a_larger_wheel_is_no_gyro_of_another_run_where_the_robot_only_drives_straight(seconds):
    larger = {"single_wheel_radius_error": {"wheel": 2, "share": 0.05}}
    run = generate("pendulum", "square", larger, seconds, 10)
    assert check(MODEL["pendulum"], [run]).serious == []


@pytest.mark.slow
def test_a_gyro_of_another_run_is_found(sound):
    runs = list(sound["pendulum"])
    runs[0] = replace(runs[0], channels=runs[0].channels | {"imu": runs[1].channels["imu"]})
    assert ("channel_of_another_run", "imu") in [(f.fault, f.channel) for f in check(MODEL["pendulum"], runs).serious]


@pytest.mark.slow
def test_a_torque_of_another_run_is_found_beside_a_sound_one(sound):
    square, eight = sound["omni"]
    swapped = replace(square, channels=square.channels | {"torque": eight.channels["torque"]})
    faults = {(finding.fault, finding.channel) for finding in found([swapped], "omni")}
    assert ("channel_of_another_run", "torque") in faults


@pytest.mark.slow
@pytest.mark.parametrize("how", [
    {"camera_hz": 120.0, "encoder_hz": 200.0, "others": {"marker_y_m": -0.112}},  # about a wheel that hardly turns
    {"camera_hz": 0.8},  # a fix long after it has begun to move
], ids=["it turns about a wheel", "a slow camera"])
def test_a_robot_whose_wheels_may_rest_is_not_carried_and_no_wheel_is_stuck(how, monkeypatch):
    monkeypatch.setattr(two_wheels, "COUNTS", 256)
    runs = [two_wheels.drive(seed, 40.0, 0.0, 0.0, 0.0, in_step=True, **how) for seed in (2001, 2002)]
    assert check(two_wheels.model(), runs).findings == []


@pytest.mark.slow
@pytest.mark.parametrize("number", [pytest.param(10, marks=pytest.mark.slow), 35])
def test_a_torque_is_no_stranger_and_its_clock_right_beside_ripple_of_encoders_and_friction_that_fades(number):
    case = cases()[number]
    assert (case["effect"], case["robot"]) in (("encoder_ripple", "omni"), ("motor_warm_up", "pendulum"))
    assert check(MODEL[case["robot"]], runs_of(case)).serious == []


@pytest.mark.slow
def test_a_clock_of_torque_that_drifts_alike_in_all_runs_is_told(sound):
    def drifting(run):
        torque = run.channels["torque"]
        return replace(run, channels=run.channels | {"torque": replace(torque, t=torque.t * 1.05)})

    found = check(MODEL["omni"], [drifting(run) for run in sound["omni"]]).serious
    assert {(f.fault, f.channel) for f in found} == {("clock_drift", "torque")}


@pytest.mark.slow
def test_motors_that_cog_shake_the_body_and_are_no_imu_with_other_axes():
    (case,) = [case for case in cases() if case["seed"] == 537]
    assert case["effect"] == "cogging" and found(runs_of(case), "pendulum") == []


@pytest.mark.slow
@pytest.mark.parametrize(("dimension", "share", "fault"), [
    ("track_share", 0.6, "effective_track"), ("track_share", 1.0, "half_track"), ("track_share", 0.3, None),
    ("track_share", 2.0, "effective_track"), ("track_share", -0.5, "half_track"),
    ("track_share", -0.4, None),
    ("radius_share", -0.5, "counts_per_turn"), ("radius_share", -0.4, None), ("radius_share", 0.6, None),
])
def test_another_size_is_no_factor_of_two(dimension, share, fault):
    runs = [
        two_wheels.drive(900 + i, 15.0, 0.0, 0.0, 0.0, others={dimension: share}, in_step=True) for i in range(2)
    ]
    assert [finding.fault for finding in check(two_wheels.model(), runs).findings] == ([fault] if fault else [])


@pytest.mark.slow
@pytest.mark.parametrize("robot", OMNI)
@pytest.mark.parametrize("times", [3.0, 20.0])
def test_a_track_of_the_model_that_is_far_too_wide_is_the_models(robot, times):
    """The omni robot is looked at where it turns; beside such dimensions nothing is told of torques."""
    runs = [generate(robot, motion, {}, 12.0, 5 + i) for i, motion in enumerate(("square", "eight", "circle"))]
    key, size_m = {"omni": ("wheel_distance_m", 0.36), "pendulum": ("half_track_m", 0.2)}[robot]
    model = load_scenario(f"{robot}_multirate", [f"{robot}.plant.{key}={times * size_m}"])
    (finding,) = check(model, runs).findings
    found_times = float(finding.advice.split()[-4])
    assert finding.fault == "wrong_track" and found_times == pytest.approx(1.0 / times, rel=0.05)


@pytest.mark.parametrize("key", [
    "omni.plant.wheel_radius_m", "pendulum.plant.half_track_m", "rover.plant.half_width_m",
])
def test_a_robot_of_millimetres_typed_as_metres_is_refused(key):
    with pytest.raises(InputError, match=f"{key}: expected at most .* \\[m\\], got 200"):
        load_scenario("velocity_base", [f"{key}=200"])


@pytest.mark.first_case
@pytest.mark.parametrize("robot", PENDULUM)
@pytest.mark.parametrize("times", [0.3, 1.7, 2.0])
def test_a_room_of_another_size_is_the_cameras_not_the_wheels(robot, times, sound):
    larger = lambda t, v: v * np.where(np.arange(v.shape[1]) < 2, times, 1.0)  # noqa: E731
    runs = [changed(run, "kinect", larger) for run in sound[robot]]
    (finding,) = found(runs, robot)
    assert finding.fault == "wrong_unit" and finding.channel == "kinect" and f"{times:g} times" in finding.what


@pytest.mark.slow
@pytest.mark.parametrize("seed", [100, 300])
def test_wheels_that_spin_in_the_air_are_no_mistake_of_the_whole_run(seed):
    runs = [generate("omni", motion, {}, 20.0, seed + i) for i, motion in enumerate(("square", "eight", "circle"))]
    t, angles = runs[0].channels["encoder"].t, runs[0].channels["encoder"].values
    spun = np.clip(t - 10.0, 0.0, 1.5)[:, None] * np.linspace(9.0, 13.0, angles.shape[1])
    lifted = replace(runs[0].channels["encoder"], values=angles + spun)
    runs[0] = replace(runs[0], channels=runs[0].channels | {"encoder": lifted})
    (finding,) = check(MODEL["omni"], runs).findings
    assert {finding.fault, *finding.rivals} >= {"robot_carried", "robot_lifted"} and finding.limited


@pytest.mark.slow
@pytest.mark.parametrize("wheel", [0, 2])
def test_a_wheel_that_counts_backwards_on_a_circle_is_told_by_the_other_three(wheel):
    """A marker that may be anywhere explains to the camera what it does."""
    (run,) = hide(MODEL["omni"], "omni", {}, ["circle"], 5, 8.0).values()
    backwards = changed(run, "encoder", lambda t, v: v * np.where(np.arange(v.shape[1]) == wheel, -1.0, 1.0))
    (finding,) = found([backwards], "omni")
    assert finding.what == f"wheel {wheel + 1} counts backwards" and not found([run], "omni")


@pytest.mark.slow
def test_a_wheel_that_counts_backwards_is_told_beside_a_sound_run_of_the_same_motion():
    runs = [run for seed in (5, 6) for run in hide(MODEL["omni"], "omni", {}, ["circle"], seed, 8.0).values()]
    runs[1] = changed(runs[1], "encoder", lambda t, v: v * np.where(np.arange(v.shape[1]) == 0, -1.0, 1.0))
    (finding,) = found(runs, "omni")
    assert (finding.what, finding.runs) == ("wheel 1 counts backwards", (1,))


@pytest.mark.slow
def test_three_mistakes_of_wheels_and_model_are_another_robot_and_nothing_is_repaired():
    runs = [generate("omni", motion, {}, 12.0, 5 + i) for i, motion in enumerate(("square", "eight", "circle"))]
    in_degrees = lambda t, v: np.rad2deg(v) * np.where(np.arange(v.shape[1]) == 0, -1.0, 1.0)  # noqa: E731
    runs = [changed(run, "encoder", in_degrees) for run in runs]
    checked = check(load_scenario(MODEL["omni"], ["omni.plant.wheel_distance_m=0.72"]), runs)
    assert [finding.fault for finding in checked.findings] == ["another_robot"]
    for run, repaired in zip(runs, checked.repaired, strict=True):
        assert np.array_equal(run.channels["encoder"].values, repaired.channels["encoder"].values)


def test_a_unit_is_told_beside_a_run_without_the_channel(sound):
    in_mm = lambda t, v: v * np.where(np.arange(v.shape[1]) < 2, 1000.0, 1.0)  # noqa: E731
    (finding,) = found([changed(sound["omni"][0], "kinect", in_mm), without(sound["omni"][1], "kinect")], "omni")
    assert (finding.fault, finding.runs) == ("wrong_unit", (0,))


def test_swapped_wheels_are_told_beside_a_run_that_no_camera_saw():
    """Of two wheels a mirrored room explains as much, which the command of that run is asked about, too."""
    runs = [two_wheels.drive(900 + i, 12.0, 0.0, 0.0, 0.0, in_step=True) for i in range(2)]
    swapped = [changed(run, "encoder", lambda t, v: v[:, ::-1].copy()) for run in runs]
    checked = check(two_wheels.model(), [without(swapped[0], "kinect"), swapped[1]])
    (finding,) = checked.findings
    assert (finding.fault, finding.runs) == ("wheels_swapped", (0, 1))
    for run, repaired in zip(runs, checked.repaired, strict=True):
        assert np.array_equal(run.channels["encoder"].values, repaired.channels["encoder"].values)


@pytest.mark.slow
def test_a_wheel_that_counts_backwards_in_one_run_is_not_told_of_a_run_in_which_it_rests():
    runs = list(hide(MODEL["omni"], "omni", {}, ["square", "figure_eight", "trapezium"], 5, 8.0).values())
    runs[0] = changed(runs[0], "encoder", lambda t, v: v * np.where(np.arange(v.shape[1]) == 0, -1.0, 1.0))
    (finding,) = found(runs, "omni")
    assert (finding.fault, finding.runs) == ("wheel_sign", (0,))


@pytest.mark.slow
@pytest.mark.parametrize("number", [0, 1])
def test_places_in_millimetres_in_one_run_of_two_are_that_and_nobody_carried_the_robot(number):
    """By its turns, which are right, the run follows the wheels well as it is."""
    runs = [two_wheels.drive(900 + i, 15.0, 0.0, 0.0, 0.0, in_step=True) for i in range(2)]
    in_mm = lambda t, v: v * np.where(np.arange(v.shape[1]) < 2, 1000.0, 1.0)  # noqa: E731
    runs[number] = changed(runs[number], "kinect", in_mm)
    (finding,) = check(two_wheels.model(), runs).findings
    assert (finding.fault, finding.what, finding.runs) == ("wrong_unit", "places in mm", (number,))


@pytest.mark.slow
def test_the_width_of_a_track_that_skids_is_measured():
    others = {"track_share": 2.0}
    runs = [two_wheels.drive(900 + i, 15.0, 0.0, 0.0, 0.0, others=others, in_step=True) for i in range(2)]
    (finding,) = check(two_wheels.model(), runs).findings
    assert finding.advice == "make the model's track about 3 times as wide"
