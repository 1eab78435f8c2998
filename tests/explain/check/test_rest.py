"""Are robots that rest most of the time left in peace?"""

import numpy as np
import pytest

from drake_ispace.explain.check.check import check
from drake_ispace.explain.check.compare.links import in_motion
from drake_ispace.explain.check.compare.regression import residuals
from hidden import two_wheels

REST = {"left_share": 0.0, "late_s": 0.0, "lag_s": 0.12, "in_step": True}


def test_windows_in_which_nothing_moves_say_nothing():
    x, y = np.zeros((3, 2)), np.array([[0.01, 0.0], [0.0, 0.2], [0.0, 0.0]])
    assert in_motion(x, y, np.array([0.01, 0.01])).tolist() == [False, True, False]
    assert in_motion(y, x, np.array([0.01, 0.01])).tolist() == [False, True, False]


def test_a_channel_that_shows_nothing_of_a_motion_can_be_compared_with_it():
    x = np.zeros((40, 3))
    x[-1] = [0.1, 0.02, 0.3]
    assert np.isfinite(residuals(x, np.zeros((40, 3)))).all()


@pytest.mark.first_case
@pytest.mark.parametrize("seed", [3, 0, 14])
def test_robots_that_rest_most_of_the_time_have_no_fault(seed):
    runs = [two_wheels.drive(seed + 100 * k, 20.0, moves=0.1, **REST) for k in range(3)]
    assert not [finding for finding in check(two_wheels.model(), runs).findings if not finding.is_bearable]
