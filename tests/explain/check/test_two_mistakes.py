"""Logs with two mistakes at once, of which neither alone explains anything."""

from dataclasses import replace

import numpy as np
import pytest

from drake_ispace.explain.check.check import check
from drake_ispace.hiding import hide
from hidden import two_wheels

DEG = np.pi / 180.0
#: Channel, fault, and what is done to the channel's stamps (n,) and values (n, d).
CHANGES = {
    "inches": ("kinect", "wrong_unit", lambda t, v: (t, v * ([1.0 / 0.0254] * 2 + [1.0]))),
    "millimetres and degrees": ("kinect", "wrong_unit", lambda t, v: (t, v * [1e3, 1e3, 1.0 / DEG])),
    "headings in degrees": ("kinect", "wrong_unit", lambda t, v: (t, v * [1.0, 1.0, 1.0 / DEG])),
    "headings a quarter off": ("kinect", "heading_offset", lambda t, v: (t, v + [0.0, 0.0, np.pi / 2.0])),
    "x mirrored": ("kinect", "camera_axis_mirrored", lambda t, v: (t, v * [-1.0, 1.0, 1.0])),
    "camera late": ("kinect", "clock_offset", lambda t, v: (t + 2.0, v)),
    "revolutions": ("encoder", "wrong_unit", lambda t, v: (t, v / (2.0 * np.pi))),
    "wheel backwards": ("encoder", "wheel_sign", lambda t, v: (t, v * ([-1.0] + [1.0] * (v.shape[1] - 1)))),
    "torque in N cm": ("torque", "wrong_unit", lambda t, v: (t, 100.0 * v)),
    "torque backwards": ("torque", "torque_sign", lambda t, v: (t, v * ([1.0, -1.0] + [1.0] * (v.shape[1] - 2)))),
    "gyro in degrees": ("imu", "wrong_unit", lambda t, v: (t, v * ([1.0] * 3 + [1.0 / DEG] * 3))),
    "imu late": ("imu", "clock_offset", lambda t, v: (t + 2.0, v)),
}


@pytest.fixture(scope="module")
def sound():
    """Robot -> three sound runs."""
    return {robot: list(hide(f"{robot}_multirate", robot, {}, ["square", "figure_eight", "circle"], 4, 14.0).values())
            for robot in ("omni", "pendulum")}


def mistaken(run, names):
    """A copy of a run with mistakes, one after the other."""
    for name in names:
        channel, _, change = CHANGES[name]
        old = run.channels[channel]
        kept = 3 if channel == "kinect" else old.values.shape[1]
        t, values = change(old.t.copy(), old.values[:, :kept].copy())
        new = replace(old, t=t, values=values, columns=old.columns[:kept], period_s=None)
        run = replace(run, channels=run.channels | {channel: new})
    return run


@pytest.mark.first_case
@pytest.mark.parametrize(("robot", "one", "other"), [
    pytest.param("omni", "inches", "headings a quarter off", marks=pytest.mark.slow),
    ("omni", "headings in degrees", "revolutions"),
    pytest.param("omni", "millimetres and degrees", "wheel backwards", marks=pytest.mark.slow),
    pytest.param("omni", "headings a quarter off", "camera late", marks=pytest.mark.slow),
    pytest.param("omni", "x mirrored", "camera late", marks=pytest.mark.slow),
    ("omni", "torque in N cm", "torque backwards"),
    ("pendulum", "inches", "x mirrored"),
    pytest.param("pendulum", "revolutions", "headings a quarter off", marks=pytest.mark.slow),
    pytest.param("pendulum", "gyro in degrees", "imu late", marks=pytest.mark.slow),
])
def test_both_mistakes_are_found_and_nothing_else(sound, robot, one, other):
    runs = [mistaken(run, (one, other)) for run in sound[robot]]
    found = check(f"{robot}_multirate", runs)
    assert sorted(finding.fault for finding in found.findings) == sorted([CHANGES[one][1], CHANGES[other][1]])
    assert all(finding.run == "all" for finding in found.findings)


@pytest.mark.slow
def test_repairs_of_both_give_the_sound_motion_again(sound):
    runs = [mistaken(run, ("millimetres and degrees", "headings a quarter off")) for run in sound["omni"]]
    for before, after in zip(sound["omni"], check("omni_multirate", runs).repaired, strict=True):
        before, after = (run.channels["kinect"].values[:, :2] for run in (before, after))
        assert np.abs(np.diff(after, axis=0) - np.diff(before, axis=0)).max() < 1e-9


@pytest.mark.slow
def test_one_mistake_of_one_run_is_not_made_two_of_all(sound):
    first, *others = sound["omni"]
    (finding,) = check("omni_multirate", [mistaken(first, ("headings a quarter off",)), *others]).findings
    assert finding.fault == "heading_offset" and finding.runs == (0,)


@pytest.fixture(scope="module")
def driven():
    """Sound runs of a two-wheeled robot with the command that drove it."""
    return [two_wheels.drive(40 + i, 20.0, left_share=0.0, late_s=0.0, in_step=True) for i in range(2)]


@pytest.mark.first_case
@pytest.mark.parametrize(("faults", "change"), [
    (["heading_offset", "wheels_swapped"], lambda v: v + [0.0, 0.0, np.pi / 2.0]),
    (["heading_offset", "wheels_swapped"], lambda v: v + [0.0, 0.0, np.pi]),
    (["heading_offset", "wheels_swapped"], lambda v: v[:, [1, 0, 2]] * [-1.0, 1.0, 1.0]),
    (["camera_axis_mirrored", "wheels_swapped"], lambda v: v * [-1.0, 1.0, 1.0]),
    (["wheels_swapped"], lambda v: v),
])
def test_swapped_wheels_under_another_camera_are_told_where_the_command_speaks_for_them(driven, faults, change):
    runs = []
    for run in driven:
        encoder, kinect = run.channels["encoder"], run.channels["kinect"]
        changed = {
            "encoder": replace(encoder, values=encoder.values[:, ::-1]),
            "kinect": replace(kinect, values=change(kinect.values)),
        }
        runs.append(replace(run, channels=run.channels | changed))
    assert sorted(finding.fault for finding in check(two_wheels.model(), runs).findings) == faults
