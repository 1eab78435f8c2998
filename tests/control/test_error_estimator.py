"""Position-error estimator (6.32)-(6.33): the room's error carried on by odometry, from the time of its fix."""

import numpy as np
import pytest

from drake_ispace.control.estimate.error_estimator import ErrorEstimator, HeldError

NEVER = [-1.0, -1.0, 0.0, 0.0, 0.0]


def ticks(path, errors):
    """path: a function tick -> s, phi."""
    return [{"path": [k, *path(k)], "error": error} for k, error in enumerate(errors)]


def ahead(tick):
    return (2.0 + 0.001 * tick, 0.5 + 0.002 * tick)


def test_before_the_first_error_the_robot_stays_where_it_is(drive):
    rows = drive(ErrorEstimator(), "error", ticks(lambda k: (2.0 + 0.1 * k, 0.5), [NEVER] * 3))
    assert rows == pytest.approx(np.array([[0.0, 0.0, 0.0], [-0.1, 0.0, 0.0], [-0.2, 0.0, 0.0]]))


def test_an_error_acts_in_its_tick_and_is_worked_off_by_odometry(drive):
    message = [0.0, 0.0, 0.3, 0.2, 0.25]
    rows = drive(ErrorEstimator(), "error", ticks(ahead, [message] * 19))
    assert rows[0] == pytest.approx([0.3, 0.2, 0.25])
    assert rows[18] == pytest.approx([0.3 - 0.018, 0.2 - 0.036, 0.25])


def test_a_new_error_replaces_the_old_target(drive):
    rows = drive(ErrorEstimator(), "error", ticks(ahead, [[0.0, 0.0, 0.3, 0.2, 0.0], [1.0, 1.0, 0.1, -0.1, 0.25]]))
    assert rows[1] == pytest.approx([0.1, -0.1, 0.25])


@pytest.mark.parametrize("latency", [1, 18, 19, 38])
def test_a_late_error_counts_from_the_capture_of_its_fix(drive, latency):
    errors = [NEVER] * latency + [[0.0, 0.0, 0.3, 0.2, 0.0]]
    rows = drive(ErrorEstimator(latency), "error", ticks(ahead, errors))
    # captured at tick 0; odometry has gone on since
    assert rows[-1] == pytest.approx([0.3 - 0.001 * latency, 0.2 - 0.002 * latency, 0.0])


def test_a_new_way_point_with_the_same_fix_counts(drive):
    # the robot is not seen any more: the fix of tick 0 stays, the way point goes on
    errors = [[0.0, 19.0 * (k // 19), 0.3 + 0.02 * (k // 19), 0.0, 0.0] for k in range(38)]
    rows = drive(ErrorEstimator(), "error", ticks(ahead, errors))
    assert rows[19] == pytest.approx([0.32 - 0.019, -0.038, 0.0])
    assert rows[37] == pytest.approx([0.32 - 0.037, -0.074, 0.0])


def test_an_error_whose_fix_is_older_than_the_memory_is_ignored(drive):
    errors = [NEVER, NEVER, NEVER, [0.0, 0.0, 0.3, 0.2, 0.0]]
    assert drive(ErrorEstimator(2), "error", ticks(lambda k: (0.0, 0.0), errors))[3, 0] == 0.0
    assert drive(ErrorEstimator(3), "error", ticks(lambda k: (0.0, 0.0), errors))[3, 0] == pytest.approx(0.3)


def test_held_error_passes_the_room_s_error_as_it_came(drive):
    assert drive(HeldError(), "error", [{"error": [19.0, 38.0, 0.3, 0.2, 0.25]}])[0] == pytest.approx([0.3, 0.2, 0.25])
