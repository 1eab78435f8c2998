"""Is a command that the wheels do not follow told from a drive that is late, weak or limited?"""

from dataclasses import replace

import numpy as np
import pytest

from drake_ispace.explain.check.check import check
from drake_ispace.robots.robot import COMMAND
from hidden import two_wheels

SINCE_S, UNTIL_S = 5.0, 9.0
ROBOT = {"left_share": 0.0, "late_s": 0.0, "lag_s": 0.1, "in_step": True}


def changed(run, change):
    """The run with another command; change: of its stamps and values."""
    command = run.channels[COMMAND]
    t, values = change(command.t.copy(), command.values.copy())
    return replace(run, channels=run.channels | {COMMAND: replace(command, t=t, values=values)})


def findings(change=None, **robot):
    """What is found in two runs, of which the first has another command."""
    first, *others = (two_wheels.drive(seed, 20.0, **ROBOT | robot) for seed in (4, 5))
    return check(two_wheels.model(), [first if change is None else changed(first, change), *others]).findings


def within(t):
    return (t >= SINCE_S) & (t < UNTIL_S)


def frozen(t, values):
    values[within(t)] = values[within(t)][0]
    return t, values


def none(t, values):
    values[within(t)] = 0.0
    return t, values


def lost(t, values):
    return t[~within(t)], values[~within(t)]


def always(column, value):
    """A change of one column into a constant."""
    def change(t, values):
        values[:, column] = value
        return t, values
    return change


@pytest.mark.first_case
@pytest.mark.parametrize(("change", "fault"), [
    (frozen, "command_overridden"), (none, "command_overridden"), (lost, "rows_missing"),
])
def test_wheels_that_do_otherwise_for_a_while_show_where_the_command_is_wrong(change, fault):
    (finding,) = findings(change)
    assert (finding.fault, finding.channel, finding.runs) == (fault, COMMAND, (0,)) and finding.is_bearable
    assert SINCE_S - 1.5 < finding.from_s < finding.to_s < UNTIL_S + 1.5


@pytest.mark.first_case
@pytest.mark.parametrize(("column", "value"), [(2, 0.0), (0, 0.0), (0, 0.2)])
def test_a_column_that_commands_one_value_while_the_robot_moves_is_dead(column, value):
    (finding,) = findings(always(column, value))
    assert (finding.fault, finding.channel, finding.runs) == ("channel_dead", COMMAND, (0,))


@pytest.mark.first_case
@pytest.mark.parametrize("unit", [1e3, 1e6, 1e9])
def test_a_command_in_another_unit_of_time_is_told(unit):
    (finding,) = findings(lambda t, values: (unit * t, values))
    assert (finding.fault, finding.channel, finding.runs) == ("time_unit", COMMAND, (0,))


@pytest.mark.first_case
@pytest.mark.parametrize("others", [
    {"brake_s2_m": 2.0}, {"gain_share": -0.4}, {"ramp_s2_m": 4.0}, {"dead_rad_s": 2.0}, {"swing_s2": 0.02},
    {"delay_s": 0.2},
])
def test_a_drive_that_does_less_or_later_than_told_is_no_fault(others):
    assert not [finding for finding in findings(others=others, moves=0.5) if finding.channel == COMMAND]


def test_a_robot_that_is_stopped_shows_that_its_command_is_not_in_force():
    stopped = [two_wheels.drive(seed, 20.0, **ROBOT, stopped_s=(6.0, 9.0)) for seed in (4, 5, 6)]
    found = check(two_wheels.model(), stopped).findings
    assert {finding.fault for finding in found} == {"command_overridden"}
    assert {i for finding in found for i in finding.runs} == {0, 1, 2}


def test_a_wheel_that_turns_slower_than_told_for_a_while_is_no_other_command():
    assert not [finding for finding in findings(seized_s=(6.0, 10.0)) if finding.channel == COMMAND]


@pytest.mark.first_case
@pytest.mark.parametrize("does", [0.15, 0.25])
def test_a_command_of_one_value_that_a_weak_drive_obeys_is_not_dead(does):
    steady = changed(two_wheels.drive(4, 20.0, **ROBOT), lambda t, values: (t, np.tile([0.3, 0.0, 0.0], (len(t), 1))))
    t, wheel = steady.channels["encoder"].t, does * 0.3 / two_wheels.RADIUS_M
    encoder = replace(steady.channels["encoder"], values=np.column_stack([wheel * t, wheel * t]))
    steady = replace(steady, channels={COMMAND: steady.channels[COMMAND], "encoder": encoder})
    others = [two_wheels.drive(seed, 20.0, **ROBOT) for seed in (5, 6)]
    found = check(two_wheels.model(), [steady, *others]).findings
    assert "channel_dead" not in [finding.fault for finding in found]


def test_a_command_that_is_logged_long_before_and_after_the_run_is_in_seconds():
    def longer(t, values):
        far = np.arange(-590.0, 600.0)
        return far, values[np.clip(np.searchsorted(t, far), 0, len(t) - 1)]
    assert "time_unit" not in [finding.fault for finding in findings(longer)]
