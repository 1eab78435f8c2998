"""The gap: which row is the headline, what closed means, and when no percentage is given."""

from dataclasses import replace

import numpy as np
import pytest

import answers
from drake_ispace.explain.answer.verdict import made_worse
from drake_ispace.explain.prove.errors.free_run import Measure
from drake_ispace.explain.prove.errors.gap import Columns, headlines, rows_of

POSITION = Measure("RPE", "5s", "position", "m", "torque")
ROW = answers.GAP[0]


def rows(before, after, sensors=0.01, chance=0.02, runs=6):
    """The row of a position whose error is `before` and `after` in each of some runs."""
    errors = [[{POSITION: np.full((20, 2), size / np.sqrt(2.0))} for _ in range(runs)] for size in (before, after)]
    return rows_of(Columns(*errors, None, {POSITION: sensors}, {POSITION: chance}), "held_out", "", 0)


def test_closed_is_the_share_of_the_squared_error_above_what_noise_leaves():
    (row,) = rows(0.3, 0.1)
    noise = 0.01**2 + 0.02**2
    assert row.before == pytest.approx(0.3) and row.after == pytest.approx(0.1)
    assert row.closed == pytest.approx(1.0 - (0.1**2 - noise) / (0.3**2 - noise)) and row.ci90[0] <= row.closed


@pytest.mark.parametrize("after", [0.005, 0.02])
def test_an_error_below_what_noise_leaves_is_wholly_closed(after):
    assert rows(0.3, after)[0].closed == 1.0


@pytest.mark.parametrize("sensors, chance", [(0.11, 0.01), (0.01, 0.11)])
def test_no_percentage_where_the_error_is_not_three_times_both(sensors, chance):
    (row,) = rows(0.3, 0.1, sensors, chance)
    assert row.closed is None and headlines([row]) == []


def test_the_headline_is_the_longest_horizon_at_which_the_gap_is_clear():
    run, short = replace(ROW, metric="ATE", horizon="run", closed=None), replace(ROW, horizon="1s", before=3.0)
    assert headlines([short, run, ROW]) == [ROW] and headlines([run, short]) == [short]
    assert headlines([replace(ROW, metric="ATE", horizon="run"), ROW])[0].horizon == "run"


def test_there_is_a_headline_for_each_of_what_drives_the_model_the_clearest_first():
    command = replace(ROW, driven_by="command", before=2.0 * ROW.before)
    assert headlines([ROW, command, replace(command, horizon="1s")]) == [command, ROW]


@pytest.mark.parametrize("change, told", [
    ({}, True), ({"sensors": 0.11}, False), ({"sensors": None}, False), ({"anywhere": True}, False),
])
def test_a_gap_that_is_clear_beside_sensors_alone_is_told_where_that_is_asked_for(change, told):
    hidden = replace(ROW, chance=0.4, closed=None, **change)
    assert headlines([hidden]) == [] and headlines([hidden], by_sensors=True) == [hidden] * told


def test_a_gap_that_is_clear_beside_all_noise_goes_before_one_that_sensors_alone_show():
    hidden = replace(ROW, metric="ATE", horizon="run", chance=0.4, closed=None)
    assert headlines([hidden, ROW], by_sensors=True) == [ROW]
    other = replace(hidden, driven_by="wheels")
    assert headlines([ROW, other], by_sensors=True) == [other, ROW]


@pytest.mark.parametrize("after, told", [(0.5, "run"), (0.3001, "5s"), (0.05, "5s")])
def test_a_shorter_horizon_does_not_tell_of_a_gap_that_grew_over_a_longer_one(after, told):
    longer = replace(ROW, metric="ATE", horizon="run", chance=0.4, closed=None, after=after)
    assert [row.horizon for row in headlines([longer, ROW], by_sensors=True)] == [told]


def test_nor_does_it_where_the_robot_may_be_anywhere_and_is_clearly_farther_off():
    astray = replace(ROW, metric="ATE", horizon="run", after=0.5, closed=None, anywhere=True)
    assert headlines([astray, ROW], by_sensors=True) == [ROW]
    assert headlines([replace(astray, worse=True), ROW], by_sensors=True)[0].horizon == "run"


@pytest.mark.parametrize("other", [
    {"runs": "training"}, {"channel": "heading", "unit": "rad"}, {"metric": "prediction", "channel": "imu: wy"},
])
def test_the_headline_is_of_a_place_on_unseen_runs(other):
    assert headlines([replace(ROW, **other)]) == []


@pytest.mark.parametrize("after, is_worse", [(0.052, False), (0.08, True), (0.03, False)])
def test_a_channel_is_made_worse_only_beyond_what_noise_leaves(after, is_worse):
    (row,) = rows(0.05, after)
    assert row.worse is is_worse and (made_worse([row]) == [row]) is is_worse
    assert made_worse([replace(row, runs="training")]) == []


def test_a_simulation_that_may_be_anywhere_proves_nothing():
    errors = [[{POSITION: np.full((20, 2), size)} for _ in range(6)] for size in (9.0, 1.5)]
    noise = {POSITION: 0.1}, {POSITION: 2.5}
    (row,) = rows_of(Columns(*errors, None, *noise, size_m=0.6), "held_out", "", 0)
    assert row.closed is None and row.anywhere
    assert rows_of(Columns(*errors, None, *noise, size_m=6.0), "held_out", "", 0)[0].closed == 1.0
