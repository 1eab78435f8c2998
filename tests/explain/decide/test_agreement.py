"""How much leads of one fit over another scatter, on residuals that are white already."""

from types import SimpleNamespace

import numpy as np
import pytest

from drake_ispace.explain.decide.agreement import scatter

APART = np.array([6.0, 8.0])  # of the two fits, one row a run


def scattered(position, driven="torque"):
    """The scatter if the robot lies there between the better fit (0) and the other one (1) in each run."""
    body = SimpleNamespace(robot=SimpleNamespace(driven=driven, in_room=True))
    view = SimpleNamespace(prediction=SimpleNamespace(replay=SimpleNamespace(body=body)))
    likelihood = SimpleNamespace(marginalised=lambda w: w, parts=lambda w: w * w)
    survey = SimpleNamespace(view=view, likelihood=likelihood, runs=np.array([0, 1]))
    better = -np.array(position) * APART
    return scatter(survey, SimpleNamespace(w=better), SimpleNamespace(w=better + APART))


def test_it_is_one_where_the_better_fit_is_right():
    assert scattered([0.0, 0.0]) == 1.0


def test_it_is_one_where_the_robot_is_off_by_no_more_than_noise():
    assert scattered([0.1, -0.1]) == 1.0


def test_it_grows_where_runs_prefer_different_fits():
    # leads 180 and -64 for 36 and 64: excess 144 and -128, over 4 * 100
    assert scattered([-2.0, 1.0]) == pytest.approx((144.0**2 + 128.0**2) / 400.0)


def test_it_grows_where_the_robot_lies_between_the_fits_in_all_runs():
    assert scattered([0.4, 0.4]) == pytest.approx((0.8 * 100.0) ** 2 / 400.0)


def test_it_is_one_where_velocity_is_commanded():
    assert scattered([-2.0, 1.0], "command") == 1.0
