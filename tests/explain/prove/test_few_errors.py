"""A random walk is as strong as most errors say, and not as a few of them do."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import drake_ispace as di
from drake_ispace.explain.predict.case import prepare
from drake_ispace.explain.prove.noise.noise import most_of_most_errors
from drake_ispace.explain.prove.prove import prove
from hidden import two_wheels

DRAWS, SENSORS, LIMIT = 4, 0.5, 1000.0


def made(seed, strength, count=60):
    """Errors (count, 1) of a walk of this strength and of sensors, then what sensors, and a walk of 1, leave anew."""
    random = np.random.default_rng(seed)
    found = SENSORS * random.standard_normal((count, 1)) + strength * random.standard_normal((count, 1))
    noise, walk = random.standard_normal((2, DRAWS * count, 1))
    return found, SENSORS * noise, walk


@pytest.mark.parametrize("strength", [0.5, 2.0, 20.0])
def test_a_walk_may_be_as_strong_as_it_is(strength):
    most = [most_of_most_errors(*made(seed, strength), LIMIT) for seed in range(40)]
    assert min(most) > strength and max(most) < 5.0 * strength


def test_a_few_large_errors_make_no_strong_walk():
    found, *noise = made(1, 1.0)
    found[::15] = 40.0
    assert most_of_most_errors(found, *noise, LIMIT) < 4.0 < np.sqrt(np.mean(found**2))


def test_of_a_few_errors_nobody_can_say():
    assert most_of_most_errors(*made(1, 1.0, count=8), LIMIT) == np.inf
    assert most_of_most_errors(*(np.zeros((0, 1)),) * 3, LIMIT) == np.inf


def test_errors_that_sensors_do_not_leave_allow_no_walk():
    found, *noise = made(1, 0.0)
    assert most_of_most_errors(0.1 * found, *noise, LIMIT) == 0.0


def test_a_camera_that_is_too_slow_for_the_shortest_while_is_no_error():
    """Of a fix every 2.5 s no two are a second apart."""
    runs = [two_wheels.drive(680 + i, 30.0, 0.0, 0.0, 0.0, camera_hz=0.4, in_step=True) for i in range(2)]
    assert prove(prepare(two_wheels.model(), runs), SimpleNamespace(named=None, rivals={}), 0).rows


def kicked(run, angle_rad, times_s):
    """The run, as if somebody had turned the robot on the spot at some times, to and fro."""
    kinect = run.channels["kinect"]
    values = kinect.values.copy()
    for i, time_s in enumerate(times_s):
        row, angle = np.searchsorted(kinect.t, time_s), angle_rad * (-1.0) ** (i // 2)
        c, s, middle = np.cos(angle), np.sin(angle), values[row, :2].copy()
        values[row:, :2] = middle + (values[row:, :2] - middle) @ np.array([[c, s], [-s, c]])
        values[row:, 2] += angle
    return replace(run, channels=run.channels | {"kinect": replace(kinect, values=values)})


@pytest.mark.slow
def test_a_robot_that_is_kicked_now_and_then_is_not_sound():
    sound = {"left_share": 0.0, "late_s": 0.0, "lag_s": 0.0, "in_step": True}
    runs = [kicked(two_wheels.drive(660 + i, 22.0, **sound), 0.05, [5.3 + i, 9.1, 13.7 - i, 18.2]) for i in range(3)]
    few = [di.effects()[name] for name in ("track_error", "marker_offset")]
    found = di.explain(two_wheels.model(), runs[:2], runs[2:], few)
    assert found.verdict == "unknown" and found.remainders
