"""The conventional loop's pose: the room's in the tick of a new fix, odometry's in all others."""

import pytest

from drake_ispace.control.estimate.conventional_merge import ConventionalMerge

NEVER = [-1.0, 0.0, 0.0, 0.0, 0.0]


def poses(drive, fixes):
    ticks = [{"odometry": [k, 0.1 * k, 0.2, 0.3], "fix": fix} for k, fix in enumerate(fixes)]
    return drive(ConventionalMerge(), "pose", ticks)


def test_a_new_fix_counts_in_its_tick_only(drive):
    fix = [1.0, 1.0, 7.0, 8.0, 0.9]
    rows = poses(drive, [NEVER, fix, fix, fix])
    assert list(rows[:, 1]) == pytest.approx([0.0, 7.0, 0.2, 0.3])
    assert list(rows[1]) == [1.0, 7.0, 8.0, 0.9]


def test_a_fix_in_which_the_robot_is_not_seen_is_ignored(drive):
    assert poses(drive, [[0.0, 0.0, 7.0, 8.0, 0.9]])[0] == pytest.approx([0.0, 0.0, 0.2, 0.3])


def test_a_late_fix_counts_when_it_arrives(drive):
    assert list(poses(drive, [NEVER, NEVER, [0.0, 1.0, 7.0, 8.0, 0.9]])[:, 1]) == pytest.approx([0.0, 0.1, 7.0])
