"""Vision feedback: PID on the room's pose, with a backward difference over fixes that are missed."""

import numpy as np
import pytest
from messages import fix, way_point

from drake_ispace.blocks.rates import TICK_S
from drake_ispace.control.feedback.vision_feedback import VisionFeedback

PERIOD = 19 * TICK_S
ZERO = np.zeros(3)


@pytest.fixture
def forces(drive):
    """(fixes, 3) forces for one fix a vision tick."""

    def of(fixes, target=None, k_p=ZERO, k_i=ZERO, k_d=ZERO, **keywords):
        ticks = [{"fix": f, "way_point": target or way_point()} for f in fixes]
        return drive(VisionFeedback(k_p, k_i, k_d, **keywords), "force", ticks)

    return of


def test_proportional_part_and_wrapped_heading(forces):
    row = forces([fix(0.1, 0.2, 3.0, tick=0)], way_point(0.6, 0.0, -3.0), k_p=[2.0, 2.0, 1.0])[0]
    assert row == pytest.approx([1.0, -0.4, 2.0 * np.pi - 6.0])


def test_damping_is_the_backward_difference(forces):
    rows = forces([fix(0.0, tick=0), fix(0.019, -0.0095, 0.038, tick=19)], k_d=[1.0, 1.0, 1.0])
    assert list(rows[0]) == [0.0, 0.0, 0.0]
    assert rows[1] == pytest.approx([-0.2, 0.1, -0.4], rel=1e-8)


def test_over_missed_fixes_the_difference_takes_their_time(forces):
    missed = fix(seen=0.0, tick=19)
    rows = forces([fix(0.0, tick=0), missed, [38.0, 0.0, 0, 0, 0], fix(0.057, tick=57)], k_d=[1.0, 1.0, 1.0])
    assert rows[:, 0] == pytest.approx([0.0, 0.0, 0.0, -0.2], rel=1e-8)  # 57 mm in 0.285 s


def test_missed_fixes_leave_the_last_pose_in_force(forces):
    rows = forces([fix(0.1, tick=0), fix(seen=0.0, tick=19)], way_point(0.6), k_p=[2.0, 2.0, 1.0])
    assert rows[1, 0] == rows[0, 0] == pytest.approx(1.0)


def test_the_difference_of_headings_is_wrapped(forces):
    rows = forces([fix(phi=3.1, tick=0), fix(phi=-3.1, tick=19)], k_d=[1.0, 1.0, 1.0])
    assert rows[1, 2] == pytest.approx(-(2.0 * np.pi - 6.2) / PERIOD)


def test_feed_forward_of_the_way_point(forces):
    target = way_point(rates=(0.25, 0.0, 0.0), accelerations=(0.1, 0.0, 0.0))
    keywords = {"k_d": [10.0, 10.0, 4.0], "mass": [7.31, 7.31, 0.07]}
    assert list(forces([fix(tick=0)], target, **keywords)[0]) == [0.0, 0.0, 0.0]
    row = forces([fix(tick=0)], target, velocity_feed_forward=True, acceleration_feed_forward=True, **keywords)[0]
    assert row == pytest.approx([2.5 + 0.731, 0.0, 0.0])


def test_the_integral_grows_with_error_and_time(forces):
    rows = forces([fix(tick=19 * k) for k in range(11)], way_point(0.5), k_i=[1.0, 1.0, 1.0])
    assert rows[10, 0] == pytest.approx(0.5 * 10 * PERIOD)


def test_the_integral_over_a_missed_fix_takes_its_time(forces):
    rows = forces([fix(tick=0), fix(seen=0.0, tick=19), fix(tick=38)], way_point(0.5), k_i=[1.0, 1.0, 1.0])
    assert rows[2, 0] == pytest.approx(0.5 * 2 * PERIOD)


def test_force_is_limited(forces):
    rows = forces([fix(tick=0)], way_point(5.0, -5.0), k_p=[2.0, 2.0, 1.0], limit=(3.0, 4.0, 1.0))
    assert list(rows[0]) == [3.0, -4.0, 0.0]


def test_the_integral_stops_at_the_limit_and_comes_back_at_once(forces):
    gains = {"k_p": [1.0] * 3, "k_i": [1.0] * 3, "limit": (1.0, 1.0, 1.0)}
    rows = forces([fix(tick=19 * k) for k in range(1000)], way_point(0.5), **gains)
    assert rows[-1, 0] <= 1.0
    # 0.5 of the limit are taken by the proportional part: the integral has stopped at 0.5, so on the other side of
    # the way point the force turns round in the second fix
    back = [fix(1.0, tick=19 * 1000), fix(1.0, tick=19 * 1001)]
    turned = forces([fix(tick=19 * k) for k in range(1000)] + back, way_point(0.5), **gains)
    assert turned[-2, 0] < 0.0


def test_before_the_first_fix_there_is_no_force(forces):
    assert not forces([fix(seen=0.0, tick=-1)], way_point(5.0), k_p=[1.0] * 3).any()
    assert not forces([fix(tick=0)], way_point(5.0, tick=-1), k_p=[1.0] * 3).any()


def test_the_pose_used_is_the_last_seen_one(drive):
    ticks = [{"fix": f, "way_point": way_point()} for f in (fix(0.1, 0.2, 0.3, tick=0), fix(seen=0.0, tick=19))]
    assert list(drive(VisionFeedback(ZERO, ZERO, ZERO), "pose", ticks)[1]) == [0.0, 0.1, 0.2, 0.3]


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_each_axis_has_an_integral_that_comes_down_beyond_the_limit(forces, axis):
    """Beyond the force limit an integral may shrink, and may not grow."""
    def there(value, tick):
        pose = [0.0, 0.0, 0.0]
        pose[axis] = value
        return fix(*pose, tick=tick)

    k_i, limit, wanted = np.zeros(3), np.full(3, np.inf), [0.0, 0.0, 0.0]
    k_i[axis], limit[axis], wanted[axis] = 10.0, 0.3, 0.1
    target = way_point(*wanted)
    fixes = [there(0.0, 19 * k) for k in range(8)] + [there(0.4, 19 * (8 + k)) for k in range(3)]
    rows = forces(fixes, target, k_i=k_i, limit=limit)[:, axis]
    grown = 10.0 * 0.1 * PERIOD * np.arange(8)
    assert rows[:8] == pytest.approx(np.where(grown <= 0.3, grown, grown[grown <= 0.3].max()))
    assert rows[8] == pytest.approx(rows[7] - 10.0 * 0.3 * PERIOD) and rows[9] < rows[8]
