"""Errors of a drive that come with changes of its command, and those that do not."""

import numpy as np
import pytest

import drake_ispace as di
from drake_ispace.explain.prove.left.by_command import changes_before, left_at_changes, told_to_move
from hidden import two_wheels

RANDOM = np.random.default_rng(8)


def test_changes_of_each_column_count_in_parts_of_its_largest_value():
    command = np.zeros((10, 2))
    command[3:, 0], command[6:, 1] = -4.0, 0.5
    found = changes_before(command, np.array([2, 5, 9]), [4, 7])
    assert found.tolist() == [[0.0, 0.0], [1.0, 1.0], [1.0, 2.0]]


def test_what_is_told_to_rest_for_a_while_is_told_to_move_no_more():
    command = np.zeros((10, 2))
    command[3:5, 1] = -0.5
    assert told_to_move(command, np.array([2, 3, 6, 7, 9]), 3).tolist() == [False, True, True, False, False]


def runs(after, quiet=1.0):
    """Runs whose command changes in every fifth of 40 blocks of 25 rows, with noise of either size."""
    result, random = [], np.random.default_rng(8)
    for shift in range(3):
        changed = np.repeat(np.arange(40) % 5 == shift, 25)
        noise = random.standard_normal((1000, 1)) * np.where(changed, after, quiet)[:, None]
        result.append((changed[:, None].astype(float), noise))
    return result


def test_what_errors_are_larger_by_after_changes():
    assert left_at_changes(runs(3.0)) == pytest.approx(np.sqrt((9.0 - 1.0) / 5.0), rel=0.1)


@pytest.mark.parametrize("after", [1.0, 0.5])
def test_errors_that_are_no_larger_after_changes_leave_nothing(after):
    assert left_at_changes(runs(after)) == 0.0


def test_large_errors_at_any_time_are_chance():
    moved = [(changes, np.roll(errors, 400 + 90 * i, axis=0)) for i, (changes, errors) in enumerate(runs(3.0))]
    assert left_at_changes(moved) == 0.0


def test_a_few_larger_errors_at_any_time_hide_none_after_changes():
    found = runs(3.0)
    for _, errors in found:
        errors[::111] = 20.0
    assert left_at_changes(found) == pytest.approx(np.sqrt((9.0 - 1.0) / 5.0), rel=0.3)


def test_a_command_that_always_changes_as_much_tells_nothing():
    assert left_at_changes([(np.ones((50, 1)), RANDOM.standard_normal((50, 2)))]) == 0.0


def test_a_robot_that_is_never_told_to_move_tells_nothing():
    assert left_at_changes([(np.empty((0, 2)), np.empty((0, 1)))] * 2) == 0.0


@pytest.mark.slow
@pytest.mark.parametrize("hidden", [
    {"swing_s2": 0.001}, pytest.param({"brake_s2_m": 0.5}, marks=pytest.mark.slow),
])
def test_a_drive_that_swings_or_brakes_slowly_is_neither_sound_nor_a_lag(hidden):
    """Its errors are small beside the accelerations by which a drive may leave its command at random."""
    drives = [two_wheels.drive(820 + i, 20.0, 0.0, 0.0, 0.0, others=hidden, in_step=True) for i in range(3)]
    found = di.explain(two_wheels.model(), drives, (), [di.effects()["velocity_lag"]])
    assert found.verdict in ("unknown", "incomplete") and found.remainders
