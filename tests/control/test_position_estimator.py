"""Position estimator (6.6): fixes carried on by odometry, in the fix's own heading and from its own time."""

import numpy as np
import pytest

from drake_ispace.control.estimate.position_estimator import PositionEstimator

NEVER = [-1.0, 0.0, 0.0, 0.0, 0.0]


def ticks(odometry, fixes):
    """odometry: a function tick -> x, y, phi; fixes: one message per tick."""
    return [{"odometry": [k, *odometry(k)], "fix": fix} for k, fix in enumerate(fixes)]


def still(tick):
    return (0.0, 0.0, 0.0)


def ahead(tick):
    """Odometry of a robot that goes along its own x at 0.25 m/s."""
    return (0.25 * 0.005 * tick, 0.0, 0.0)


def test_until_the_first_fix_odometry_counts(drive):
    rows = drive(PositionEstimator(), "pose", ticks(lambda k: (1.0 + 0.1 * k, 2.0, 0.5), [NEVER] * 3))
    assert rows == pytest.approx(np.array([[0, 1.0, 2.0, 0.5], [1, 1.1, 2.0, 0.5], [2, 1.2, 2.0, 0.5]]))


def test_a_fix_acts_in_the_tick_it_arrives(drive):
    rows = drive(PositionEstimator(), "pose", ticks(still, [NEVER, [1, 1, 0.3, 0.4, 0.2]]))
    assert rows[1] == pytest.approx([1, 0.3, 0.4, 0.2])


def test_increments_follow_the_heading_of_the_fix(drive):
    # the robot really faces y; odometry believes in x
    fix = [0, 1, 0.0, 0.0, np.pi / 2.0]
    rows = drive(PositionEstimator(), "pose", ticks(ahead, [fix] * 19))
    assert rows[-1, 1:] == pytest.approx([0.0, 0.0225, np.pi / 2.0], abs=1e-12)  # 18 ticks of 1.25 mm


def test_as_printed_increments_follow_odometrys_heading(drive):
    fix = [0, 1, 0.0, 0.0, np.pi / 2.0]
    rows = drive(PositionEstimator(as_printed=True), "pose", ticks(ahead, [fix] * 19))
    assert rows[-1, 1:] == pytest.approx([0.0225, 0.0, np.pi / 2.0], abs=1e-12)


def test_a_new_fix_takes_away_what_odometry_missed(drive):
    # odometry sees 0.25 m/s, the robot moves at 0.20
    fixes = [[19 * (k // 19), 1, 0.2 * 0.005 * 19 * (k // 19), 0.0, 0.0] for k in range(58)]
    rows = drive(PositionEstimator(), "pose", ticks(ahead, fixes))
    error = rows[:, 1] - 0.2 * 0.005 * np.arange(58)
    assert error[[0, 19, 38, 57]] == pytest.approx(np.zeros(4), abs=1e-12)
    assert error.max() == pytest.approx(18 * 0.05 * 0.005)  # 4.5 mm just before the next one


def late(latency, tick):
    """The fix in force at a tick, of a robot whose odometry is right, `latency` ticks after its capture."""
    capture = 19 * ((tick - latency) // 19)
    return [capture, 1, *ahead(capture)] if tick >= latency else NEVER


@pytest.mark.parametrize("latency", [1, 18, 19, 40])
def test_a_late_fix_is_fused_with_the_odometry_of_its_capture(drive, latency):
    rows = drive(PositionEstimator(latency), "pose", ticks(ahead, [late(latency, k) for k in range(120)]))
    assert rows[:, 1] == pytest.approx(0.25 * 0.005 * np.arange(120), abs=1e-12)


def test_without_its_stamp_a_late_fix_would_pull_back(drive):
    fixes = [late(18, k) for k in range(120)]
    for fix in fixes:
        if fix[0] >= 0:
            fix[0] = 18 + fix[0]  # as if captured on arrival
    rows = drive(PositionEstimator(18), "pose", ticks(ahead, fixes))
    error = rows[:, 1] - 0.25 * 0.005 * np.arange(120)
    assert error[18:] == pytest.approx(np.full(102, -18 * 0.00125), abs=1e-12)  # 22.5 mm


def test_a_late_fix_with_a_turn_since(drive):
    # captured at tick 0 facing y, then odometry turns by 90 degrees and drives 10 cm: the robot drives along -x
    def odometry(k):
        return [(0.0, 0.0, 0.0), (0.0, 0.0, np.pi / 2.0), (0.0, 0.1, np.pi / 2.0)][k]

    rows = drive(PositionEstimator(2), "pose", ticks(odometry, [NEVER, NEVER, [0, 1, 1.0, 1.0, np.pi / 2.0]]))
    assert rows[2, 1:] == pytest.approx([0.9, 1.0, -np.pi], abs=1e-12)


def test_a_fix_in_which_the_robot_is_not_seen_is_ignored(drive):
    fixes = [[0, 1, 0.3, 0.0, 0.0], [1, 0, 0.0, 0.0, 0.0]]
    assert drive(PositionEstimator(), "pose", ticks(still, fixes))[1] == pytest.approx([1, 0.3, 0.0, 0.0])


def test_a_fix_older_than_the_memory_is_ignored(drive):
    fixes = [NEVER, NEVER, NEVER, [0, 1, 9.0, 9.0, 9.0]]
    assert drive(PositionEstimator(2), "pose", ticks(still, fixes))[3] == pytest.approx([3, 0.0, 0.0, 0.0])
    assert drive(PositionEstimator(3), "pose", ticks(still, fixes))[3, 1:3] == pytest.approx([9.0, 9.0])


def test_fixes_that_arrive_in_the_wrong_order_do_not_go_back(drive):
    fixes = [NEVER, NEVER, [1, 1, 0.2, 0.0, 0.0], [0, 1, 0.1, 0.0, 0.0]]
    assert drive(PositionEstimator(5), "pose", ticks(still, fixes))[3, 1] == 0.2


def test_heading_is_wrapped(drive):
    rows = drive(PositionEstimator(), "pose", ticks(lambda k: (0.0, 0.0, 3.0 * k), [[0, 1, 0.0, 0.0, 0.0]] * 3))
    assert rows[:, 3] == pytest.approx([0.0, 3.0, 6.0 - 2.0 * np.pi])
