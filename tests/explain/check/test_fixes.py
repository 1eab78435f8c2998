"""What the check says of poses: outliers, headings that are off for a while, and poses that no camera saw."""

from dataclasses import replace

import numpy as np
import pytest

from drake_ispace.blocks.frames import rotated, wrap
from drake_ispace.explain.check.camera.fixes import course_findings
from drake_ispace.explain.check.check import check
from drake_ispace.explain.check.compare.links import base_of
from drake_ispace.explain.check.runs import robot_of
from drake_ispace.explain.check.turns import turn_findings
from drake_ispace.faults.repair import CutOut, Turned
from drake_ispace.files.recording import Channel, Recording
from hidden import two_wheels

SOUND = {"left_share": 0.0, "late_s": 0.0, "lag_s": 0.0, "in_step": True}


def runs(count=2, **others):
    return [two_wheels.drive(820 + i, 30.0, **SOUND | others) for i in range(count)]


def with_fixes(run, values, t=None):
    kinect = run.channels["kinect"]
    return replace(run, channels=run.channels | {
        "kinect": replace(kinect, values=values, t=kinect.t if t is None else t)
    })


def later(run, seconds):
    """The run with all stamps later."""
    return replace(run, channels={
        name: replace(channel, t=channel.t + seconds) for name, channel in run.channels.items()
    })


def noisy(run, place_m, heading_rad, seed=1):
    """The run with so much more white noise in its fixes."""
    values = run.channels["kinect"].values
    return with_fixes(run, values + np.random.default_rng(seed).normal(size=values.shape) * (
        place_m, place_m, heading_rad))


@pytest.mark.first_case
@pytest.mark.parametrize("hz, late_s", [(30.0, 0.0), (30.0, 0.1), (10.0, 0.0)])
def test_nobody_carries_the_robot_of_a_noisy_camera(hz, late_s):
    """From fix to fix the noise is more than the robot moves."""
    sound = [noisy(run, 0.02, 0.005, i) for i, run in enumerate(runs(4, camera_hz=hz, late_s=late_s))]
    assert not check(two_wheels.model(), sound).findings


@pytest.mark.first_case
@pytest.mark.parametrize("share", [0.02, 0.1])
def test_fixes_that_are_off_are_left_out_and_no_others(share):
    first, second = runs()
    random, values = np.random.default_rng(3), first.channels["kinect"].values.copy()
    off = np.sort(random.choice(len(values), round(share * len(values)), replace=False))
    values[off] += random.uniform(0.5, 2.0, (len(off), 3)) * random.choice([-1.0, 1.0], (len(off), 3))
    values[:, 2] = wrap(values[:, 2])
    checked = check(two_wheels.model(), [with_fixes(first, values), second])
    assert [finding.fault for finding in checked.findings] == ["camera_outliers"]
    left = np.isin(first.channels["kinect"].t[off], checked.repaired[0].channels["kinect"].t)
    assert np.mean(left) < 0.05
    assert len(values) - len(checked.repaired[0].channels["kinect"].t) < 1.05 * len(off)


@pytest.mark.slow
def test_a_robot_that_shakes_for_a_while_keeps_its_fixes():
    """At nearly half the camera's rate every motion comes back at once."""
    t, fixes = np.arange(0.0, 40.0, 0.02), np.arange(0.0133, 39.9, 0.2)
    x = lambda t: np.where(t % 20.0 < 3.0, 0.02 * np.sin(2.0 * np.pi * 2.0 * t), 0.0)  # noqa: E731
    values = 5e-4 * np.random.default_rng(0).normal(size=(len(fixes), 3))
    values[:, 0] += x(fixes)
    kinect = Channel(fixes, ("x", "y", "phi"), values, {}, None)
    angles = np.column_stack([x(t), x(t)]) / two_wheels.RADIUS_M
    run = Recording("mine", "velocity_base", {
        "command": Channel(t, ("vx", "vy", "wz"), np.column_stack([np.gradient(x(t), t), 0.0 * t, 0.0 * t]), {}, 0.02),
        "encoder": Channel(t, ("theta_1", "theta_2"), angles, {}, 0.02), "kinect": kinect,
    }, "")
    assert not check(two_wheels.model(), [run]).findings


@pytest.mark.first_case
@pytest.mark.parametrize("later_s", [0.0, -40.0])
@pytest.mark.parametrize("degrees", [25.0, -10.0])
def test_headings_that_are_off_for_a_while_are_turned_back_there_and_nowhere_else(degrees, later_s):
    first, second = runs()
    kinect = first.channels["kinect"]
    values, off = kinect.values.copy(), (kinect.t > 10.0) & (kinect.t < 14.0)
    values[off, 2] = wrap(values[off, 2] + np.deg2rad(degrees))
    checked = check(two_wheels.model(), [later(with_fixes(first, values), later_s), second])
    (finding,) = checked.findings
    assert (finding.fault, finding.runs) == ("heading_offset", (0,))
    assert finding.from_s == pytest.approx(10.0 + later_s, abs=0.1)
    assert finding.to_s == pytest.approx(14.0 + later_s, abs=0.1)
    error = wrap(checked.repaired[0].channels["kinect"].values[:, 2] - kinect.values[:, 2])
    assert np.quantile(np.abs(error), 0.99) < np.deg2rad(1.0)


@pytest.mark.parametrize("turns, offs", [((25.0, 25.0, -50.0), (25.0, 50.0)), ((120.0, 120.0, 120.0), (120.0, 120.0))])
def test_what_headings_say_for_longest_is_right(turns, offs):
    """Here before 8 s and after 20 s."""
    (run,) = runs(1)
    kinect = run.channels["kinect"]
    parts = [kinect.t < 8.0, kinect.t < 14.0, kinect.t < 20.0]
    off = np.select(parts, [0.0, turns[0], turns[0] + turns[1]], sum(turns))
    values = kinect.values + np.outer(np.deg2rad(off), [0.0, 0.0, 1.0])
    model = two_wheels.model()
    base = base_of(run, robot_of(model, [run], ["a run"]), model.rover)
    found = list(turn_findings(with_fixes(run, values), base))
    assert [finding.fault for finding in found] == 2 * ["heading_offset"]
    assert [float(f.what.split(" by ")[1].split()[0]) for f in found] == pytest.approx(list(offs), rel=0.1)
    assert all(isinstance(repair, Turned) for finding in found for repair in finding.repairs)


def test_headings_that_jump_once_where_the_path_does_not_agree_are_cut_there():
    """The one of 25 degrees was found, the way back in small steps was not."""
    (run,) = runs(1)
    kinect = run.channels["kinect"]
    off = np.deg2rad(25.0) * np.interp(kinect.t, [6.0, 6.01, 7.0, 12.0], [0.0, 1.0, 1.0, 0.0])
    values = kinect.values + np.outer(off, [0.0, 0.0, 1.0])
    model = two_wheels.model()
    base = base_of(run, robot_of(model, [run], ["a run"]), model.rover)
    (finding,) = turn_findings(with_fixes(run, values), base)
    assert isinstance(finding.repairs[0], CutOut) and finding.to_s - finding.from_s < 0.5


def reckoned(run, t, share=0.0):
    """(k, 3) poses at times t (k,), computed from the counts of the wheels, which are so much larger than believed."""
    encoder = run.channels["encoder"]
    angles = np.column_stack([np.interp(t, encoder.t, angle) for angle in encoder.values.T])
    ways = np.diff(angles, axis=0) * two_wheels.RADIUS_M * (1.0 + share)
    turns = (ways[:, 0] - ways[:, 1]) / (2.0 * two_wheels.HALF_TRACK_M)
    phi = np.concatenate([[0.3], 0.3 + np.cumsum(turns)])
    forward = np.column_stack([ways.mean(axis=1), np.zeros(len(ways))])
    place = np.vstack([np.zeros(2), np.cumsum(rotated(forward, 0.5 * (phi[1:] + phi[:-1])), axis=0)])
    return np.column_stack([place, wrap(phi)])


@pytest.mark.first_case
@pytest.mark.parametrize("share, late_s, digits", [(0.0, 0.0, 12), (0.03, 0.0, 12), (0.0, 0.04, 12), (0.0, 0.0, 5)])
def test_poses_that_were_computed_from_the_wheels_are_no_cameras(share, late_s, digits):
    """Not even where they tell of other wheels than those believed, or late, or all was rounded in a file."""
    computed = []
    for run in runs(left_share=0.03):
        encoder = run.channels["encoder"]
        t = encoder.t[2:-2:3]
        filed = replace(run, channels=run.channels | {
            "encoder": replace(encoder, values=np.round(encoder.values, digits))})
        computed.append(with_fixes(filed, np.round(reckoned(run, t, share), digits), t + late_s))
    believed = two_wheels.model()
    counted = replace(believed.rover.encoder, counts_per_turn=float(two_wheels.COUNTS))
    checked = check(replace(believed, rover=replace(believed.rover, encoder=counted)), computed)
    assert [(f.fault, f.runs) for f in checked.findings] == [("camera_is_odometry", (0, 1))]
    assert "kinect" not in checked.repaired[0].channels


@pytest.mark.first_case
@pytest.mark.parametrize("camera_hz, encoder_hz", [(30.0, 50.0), (100.0, 50.0), (30.0, 10.0)])
def test_a_camera_without_noise_knows_no_counts(monkeypatch, camera_hz, encoder_hz):
    monkeypatch.setattr(two_wheels, "FIX_RMS", (0.0, 0.0, 0.0))
    monkeypatch.setattr(two_wheels, "_SLIP_RMS", 0.0)
    found = check(two_wheels.model(), runs(camera_hz=camera_hz, encoder_hz=encoder_hz)).findings
    assert "camera_is_odometry" not in {finding.fault for finding in found}


def test_headings_that_are_directions_over_half_a_second_are_told():
    changed = []
    for run in runs(camera_hz=10.0, others={"marker_x_m": 0.25}):
        values = run.channels["kinect"].values.copy()
        way = values[5:, :2] - values[:-5, :2]
        values[5:, 2] = np.arctan2(way[:, 1], way[:, 0])
        changed.append(with_fixes(run, values))
    assert [f.fault for f in check(two_wheels.model(), changed).findings] == ["heading_is_course"]


def test_a_robot_that_drives_along_an_axis_has_headings_where_places_are_rounded():
    """Most of its directions from fix to fix are exactly along the axis, as are its headings."""
    t = np.arange(0.0, 30.0, 0.2)
    x, y = 0.2 * t, 4e-4 * np.random.default_rng(5).normal(size=len(t))
    kinect = Channel(t, ("x", "y", "phi"), np.column_stack([np.round(x, 3), np.round(y, 3), 0.0 * t]), {}, None)
    assert not list(course_findings(Recording("mine", "velocity_base", {"kinect": kinect}, "")))


def with_turned_places(run, degrees):
    values = run.channels["kinect"].values.copy()
    values[:, :2] = rotated(values[:, :2], np.deg2rad(degrees))
    return with_fixes(run, values)


@pytest.mark.first_case
@pytest.mark.parametrize("others", [{}, {"marker_x_m": 0.1, "marker_y_m": 0.05}], ids=["middle", "beside"])
@pytest.mark.parametrize("degrees", [(0.0, 60.0, 0.0), (0.0, 50.0, 120.0), (40.0, 40.0, -130.0)])
def test_places_that_are_turned_are_told_by_their_angle_in_each_run(degrees, others):
    turned = [with_turned_places(run, by) for run, by in zip(runs(3, others=others), degrees, strict=True)]
    checked = check(two_wheels.model(), turned)
    assert {finding.fault for finding in checked.findings} == {"heading_offset"}
    for run, repaired, by in zip(turned, checked.repaired, degrees, strict=True):
        added = wrap(repaired.channels["kinect"].column("phi") - run.channels["kinect"].column("phi"))
        assert np.abs(wrap(added - np.deg2rad(by))).max() < np.deg2rad(2.5)


@pytest.mark.slow
@pytest.mark.parametrize("having", [(0,), (0, 1)], ids=["one run", "all runs"])
@pytest.mark.parametrize("name", ["x", "y"])
@pytest.mark.parametrize("unit, factor", [("mm", 1e3), ("cm", 1e2)])
def test_one_column_of_the_places_in_another_unit_is_told_and_nothing_else(unit, factor, name, having):
    sound = runs()
    wrong = [with_fixes(run, run.channels["kinect"].values * np.where([name == "x", name == "y", False], factor, 1.0))
             if i in having else run for i, run in enumerate(sound)]
    (finding,) = check(two_wheels.model(), wrong).findings
    assert (finding.what, finding.runs) == (f"{name} in {unit}", having)
    assert finding.repair == f"kinect: {name} = {1.0 / factor:g} {name}"


def test_places_along_an_axis_that_is_larger_than_the_other_make_no_directions():
    """Of a robot that mostly rests, noise alone makes most of them turn round."""
    t = np.arange(0.0, 20.0, 0.05)
    random, goes = np.random.default_rng(5), np.clip(t - 13.8, 0.0, None)
    places = 0.1 * np.column_stack([goes, goes]) + 0.001 * random.normal(size=(len(t), 2))
    kinect = Channel(t, ("x", "y", "phi"), np.column_stack([places * [1.0, 1e3], 0.3 * goes]), {}, None)
    assert not list(course_findings(Recording("mine", "velocity_base", {"kinect": kinect}, "")))
