"""Commands along the axes of the room, as planners give them."""

from dataclasses import replace

import numpy as np
import pytest

from drake_ispace.blocks.frames import rotated
from drake_ispace.explain.check.check import check
from drake_ispace.explain.check.compare.columns import command_columns
from drake_ispace.explain.check.repaired import save_repaired
from drake_ispace.faults.repair import Mixed
from drake_ispace.files.recording import load
from hidden import three_wheels, two_wheels

FAULT = "command_in_room_frame"


def along_room(run, room_rad=0.0):
    """A copy of a run whose command was logged along the axes of the room, these being turned against the camera's."""
    told, kinect = run.channels["command"], run.channels["kinect"]
    phi = np.interp(told.t, kinect.t, np.unwrap(kinect.column("phi")))
    values = np.column_stack([rotated(told.values[:, :2], phi - room_rad), told.values[:, 2]])
    return replace(run, channels=run.channels | {"command": replace(told, values=values)})


@pytest.fixture(scope="module")
def runs():
    return [along_room(three_wheels.drive(70 + i, 12.0)) for i in range(3)]


@pytest.mark.first_case
def test_one_reason_is_told_for_all_runs_and_repaired(runs, tmp_path):
    checked = check(three_wheels.model(), runs)
    (finding,) = checked.findings
    assert (finding.fault, finding.channel, finding.runs) == (FAULT, "command", (0, 1, 2))
    copies = [load(place) for place in save_repaired(checked, runs, tmp_path)]
    assert check(three_wheels.model(), copies).findings == [] and FAULT in copies[0].notes


def test_the_planners_room_may_be_turned():
    model, turned = three_wheels.model(), [along_room(three_wheels.drive(70 + i, 12.0), 0.7) for i in range(2)]
    checked = check(model, turned)
    (finding,) = checked.findings
    assert finding.fault == FAULT and "turned by 40 degrees" in finding.what
    assert check(model, checked.repaired).findings == []


def test_another_unit_besides_is_told_as_well(runs):
    millimetres = Mixed("command", ("vx", "vy", "wz"), ((1e3, 0.0, 0.0), (0.0, 1e3, 0.0), (0.0, 0.0, 1.0)))
    findings = check(three_wheels.model(), [millimetres.apply(run) for run in runs]).findings
    assert {finding.fault for finding in findings} == {FAULT, "wrong_unit"}


@pytest.mark.slow
def test_robots_of_two_wheels_have_it_as_well():
    runs = [along_room(two_wheels.drive(80 + i, 15.0, left_share=0.0, late_s=0.06, lag_s=0.1, in_step=True))
            for i in range(2)]
    assert [finding.fault for finding in check(two_wheels.model(), runs).findings] == [FAULT]


@pytest.mark.parametrize("rates", [(0.0, 0.0), (0.01, 0.02)])
def test_a_robot_that_hardly_turns_is_not_accused(rates):
    straight = {"speeds_m_s": (0.2, 0.4), "rates_rad_s": rates, "left_share": 0.0, "late_s": 0.0, "lag_s": 0.0}
    runs = [two_wheels.drive(seed, 15.0, in_step=True, **straight) for seed in (0, 1)]
    assert check(two_wheels.model(), runs).findings == []


def test_without_a_camera_nobody_says_so(runs):
    assert FAULT not in {reading.fault for reading in command_columns()}
    blind = [replace(run, channels={n: c for n, c in run.channels.items() if n != "kinect"}) for run in runs]
    assert FAULT not in {finding.fault for finding in check(three_wheels.model(), blind).findings}
