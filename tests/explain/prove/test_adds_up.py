"""Do errors of wheels that add up follow from what they were told?"""

import numpy as np
import pytest

from drake_ispace.effects.library import library
from drake_ispace.explain.predict.case import prepare
from drake_ispace.explain.prove.errors.free_run import errors, measures_of, windows_of
from drake_ispace.explain.prove.left.by_command import errors_that_add_up, is_chance, together
from hidden import two_wheels


def test_commands_together_are_these_and_their_products():
    command = np.array([[0.2, 0.5], [-0.1, 0.3]])
    assert together(command).tolist() == [
        [0.2, 0.5, pytest.approx(0.1), pytest.approx(0.1), pytest.approx(0.1)],
        [-0.1, 0.3, pytest.approx(-0.03), pytest.approx(0.03), pytest.approx(-0.03)],
    ]


@pytest.mark.parametrize(("share", "chance"), [(1.0, False), (0.0, True)])
def test_what_a_variable_tells_at_any_other_time_is_chance(share, chance):
    random = np.random.default_rng(3)
    told = np.repeat(random.standard_normal((3, 10, 2)), 2, axis=1)  # held for two windows
    noise = 0.3 * random.standard_normal((3, 20, 1))
    assert is_chance([(x, share * x[:, :1] + e) for x, e in zip(told, noise, strict=True)]) == chance


def test_of_runs_of_two_windows_nothing_tells_chance():
    assert is_chance([(np.ones((2, 1)), np.ones((2, 1)))] * 3)


def found(hidden, seconds, rates=((-1.0, 1.0),) * 3):
    """The drivers of errors of a drive that add up over 1 s."""
    drives = [
        two_wheels.drive(840 + i, seconds, 0.0, 0.0, 0.0, others=hidden, rates_rad_s=own) for i, own in enumerate(rates)
    ]
    prediction = prepare(two_wheels.model(), drives, effects=[library()["velocity_lag"]]).prediction
    windows = [windows_of(prediction, i, {}) for i in range(len(drives))]
    after = [errors(prediction, i, own, {}) for i, own in enumerate(windows)]
    sensors = dict.fromkeys(measures_of(after), 2.0 * np.pi / two_wheels.COUNTS)
    return {remainder.driver for remainder in errors_that_add_up(prediction, windows, after, sensors, "1s")}


@pytest.mark.parametrize(("share", "told"), [(0.02, True), (0.0005, False), (0.0, False)])
def test_a_drive_that_is_a_little_fast_all_the_while_errs_by_what_it_is_told(share, told):
    drivers = found({"gain_share": share, "errs_m_s": 0.002}, 20.0)
    assert bool(drivers) == told and all("command" in driver for driver in drivers)


def test_a_drive_that_errs_at_random_does_not_err_by_what_it_is_told():
    assert not found({"errs_m_s": 0.01}, 16.0)


def test_runs_may_use_other_axes_of_the_command():
    straight, turning = (0.0, 0.0), (-1.0, 1.0)
    assert found({"gain_share": 0.03}, 16.0, (straight, turning, straight))
