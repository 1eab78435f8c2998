"""Trajectory tracker: the error in the robot's own coordinates, as corrected, as printed, and without a tracker."""

import numpy as np
import pytest
from messages import fix, way_point

from drake_ispace.control.guide.tracker import Tracker, TrajectoryTracker


@pytest.fixture
def error(drive):
    """s_e, phi_h and fed-forward speed of one fix and one way point."""

    def of(robot, target, **tracker):
        return drive(TrajectoryTracker(Tracker(**tracker)), "error", [{"fix": robot, "way_point": target}])[0, 2:]

    return of


def test_a_point_straight_ahead(error):
    assert error(fix(), way_point(0.3, 0.0)) == pytest.approx([0.3, 0.0, 0.0])


def test_a_point_straight_ahead_when_facing_y(error):
    assert error(fix(phi=np.pi / 2.0), way_point(0.0, 0.3)) == pytest.approx([0.3, 0.0, 0.0])


def test_a_point_ahead_to_the_left(error):
    # (0.3, 0.3): 0.424 m away at 45 degrees, of which 0.3 m forward
    assert error(fix(), way_point(0.3, 0.3)) == pytest.approx([0.3, np.pi / 4.0, 0.0])


def test_a_point_at_the_side_asks_for_turning_only(error):
    assert error(fix(), way_point(0.0, 0.4)) == pytest.approx([0.0, np.pi / 2.0, 0.0], abs=1e-15)


def test_a_point_behind_is_reached_in_reverse(error):
    assert error(fix(), way_point(-0.3, 0.0)) == pytest.approx([-0.3, 0.0, 0.0], abs=1e-15)
    # behind to the left, at 135 degrees: backing up to the right heading needs a turn of -45
    assert error(fix(), way_point(-0.3, 0.3)) == pytest.approx([-0.3, -np.pi / 4.0, 0.0])
    assert error(fix(), way_point(-0.3, -0.3)) == pytest.approx([-0.3, np.pi / 4.0, 0.0])


def test_heading_error_is_wrapped(error):
    # robot at 170 degrees, target at -170: 20 degrees to the left
    target = way_point(0.3 * np.cos(np.radians(190)), 0.3 * np.sin(np.radians(190)))
    assert error(fix(phi=np.radians(170.0)), target)[1] == pytest.approx(np.radians(20.0))
    assert error(fix(phi=np.radians(170.0 + 3600.0)), target)[1] == pytest.approx(np.radians(20.0))


def test_inside_the_hold_radius_heading_fades(error):
    # 5 cm away with 10 cm hold radius: half of 45 degrees
    assert error(fix(), way_point(0.05 / np.sqrt(2), 0.05 / np.sqrt(2)))[1] == pytest.approx(np.pi / 8.0)


def test_passing_the_way_point_does_not_flip_the_heading(error):
    before, after = error(fix(-1e-6, 1e-7), way_point(0.0, 0.0)), error(fix(1e-6, 1e-7), way_point(0.0, 0.0))
    assert abs(before[1] - after[1]) < 1e-4
    assert (before[0], after[0]) == pytest.approx((1e-6, -1e-6))


def test_at_the_way_point_there_is_no_error(error):
    assert list(error(fix(0.1, 0.2, 0.3), way_point(0.1, 0.2))) == [0.0, 0.0, 0.0]


def test_look_ahead_keeps_its_distance_while_the_way_point_moves(error):
    assert error(fix(), way_point(0.3, 0.0, rates=(0.25, 0.0, 0.0)))[0] == pytest.approx(0.1)
    assert error(fix(), way_point(0.1, 0.0, rates=(0.25, 0.0, 0.0)))[0] == pytest.approx(-0.1)


def test_the_robot_closes_up_at_the_end(error):
    assert error(fix(), way_point(0.3, 0.0, rates=(0.0, 0.0, 0.0)))[0] == pytest.approx(0.3)


def test_speed_is_fed_forward_with_look_ahead_only(error):
    moving = way_point(0.3, 0.0, rates=(0.15, 0.2, 0.0))
    assert error(fix(), moving)[2] == pytest.approx(0.25)
    assert error(fix(), moving, feed_forward=False)[2] == 0.0
    assert error(fix(), moving, look_ahead_m=0.0)[2] == 0.0
    assert error(fix(), way_point(0.3, 0.0))[2] == 0.0


def test_the_longest_error(error):
    assert error(fix(), way_point(2.0, 0.0))[0] == 0.5
    assert error(fix(), way_point(-2.0, 0.0))[0] == -0.5


def test_as_printed_a_robot_that_faces_y_never_moves(error):
    assert error(fix(phi=np.pi / 2.0), way_point(0.0, 0.3), mode="as_printed")[:2] == pytest.approx([0.0, 0.0])


def test_as_printed_by_hand(error):
    # facing x it is right; at 45 degrees: cos * sqrt((0.3 c)^2 + (0.3 s)^2) = 0.7071 * 0.3
    assert error(fix(), way_point(0.3, 0.0), mode="as_printed")[0] == pytest.approx(0.3)
    assert error(fix(), way_point(0.3, 0.3), mode="as_printed")[:2] == pytest.approx([0.3 * np.sqrt(0.5), np.pi / 4.0])


def test_without_tracker_the_error_is_the_distance(error):
    found = error(fix(), way_point(-0.3, 0.4, rates=(0.25, 0.0, 0.0)), mode="jacobian")
    assert found == pytest.approx([0.5, np.arctan2(0.4, -0.3), 0.0])


def test_messages_carry_the_stamps_of_fix_and_way_point(drive):
    ticks = [{"fix": fix(tick=19), "way_point": way_point(0.3, 0.0, tick=38)}]
    assert list(drive(TrajectoryTracker(Tracker()), "error", ticks)[0, :2]) == [19.0, 38.0]


def test_while_not_seen_the_last_fix_counts(drive):
    ticks = [
        {"fix": fix(0.1, tick=0), "way_point": way_point(0.3, 0.0, tick=0)},
        {"fix": fix(0.0, tick=19, seen=0.0), "way_point": way_point(0.5, 0.0, tick=19)},
    ]
    assert list(drive(TrajectoryTracker(Tracker()), "error", ticks)[1]) == pytest.approx([0.0, 19.0, 0.4, 0.0, 0.0])


@pytest.mark.parametrize("robot, target", [
    (fix(tick=-1, seen=0.0), way_point(0.3, 0.0)), (fix(), way_point(0.3, 0.0, tick=-1)),
])
def test_without_fix_or_way_point_there_is_no_error(error, robot, target):
    assert list(error(robot, target)) == [0.0, 0.0, 0.0]
