"""Do errors of wheels that add up follow from what they were told?"""

import numpy as np
import pytest

from drake_ispace.effects.library import library
from drake_ispace.explain.predict.case import prepare
from drake_ispace.explain.prove.errors.free_run import errors, measures_of, windows_of
from drake_ispace.explain.prove.left.by_command import _is_chance, _of_what_adds_up, _together
from hidden import two_wheels


def test_commands_together_are_those_that_change_and_their_products():
    command = np.array([[0.2, 0.0, 0.5], [-0.1, 0.0, 0.3]])
    assert _together(command).tolist() == [
        [0.2, 0.5, pytest.approx(0.1), pytest.approx(0.1), pytest.approx(0.1)],
        [-0.1, 0.3, pytest.approx(-0.03), pytest.approx(0.03), pytest.approx(-0.03)],
    ]


@pytest.mark.parametrize(("share", "chance"), [(1.0, False), (0.0, True)])
def test_what_a_variable_tells_at_any_other_time_is_chance(share, chance):
    random = np.random.default_rng(3)
    told, noise = random.standard_normal((3, 40, 2)), 0.3 * random.standard_normal((3, 40, 1))
    assert _is_chance([(x, share * x[:, :1] + e) for x, e in zip(told, noise, strict=True)], 5) == chance


@pytest.mark.parametrize(("share", "told"), [(0.01, True), (0.0005, False), (0.0, False)])
def test_a_drive_that_is_a_little_fast_all_the_while_errs_by_what_it_is_told(share, told):
    """Over 0.2 s that hides behind the unknown moments of the command's changes."""
    hidden = {"gain_share": share, "errs_m_s": 0.002}
    drives = [two_wheels.drive(840 + i, 20.0, 0.0, 0.0, 0.0, others=hidden) for i in range(3)]
    prediction = prepare(two_wheels.model(), drives, effects=[library()["velocity_lag"]]).prediction
    windows = [windows_of(prediction, i, {}) for i in range(3)]
    after = [errors(prediction, i, own, {}) for i, own in enumerate(windows)]
    sensors = dict.fromkeys(measures_of(after), 2.0 * np.pi / two_wheels.COUNTS)
    found = _of_what_adds_up(prediction, windows, after, sensors, "5s")
    assert bool(found) == told and all("command" in remainder.driver for remainder in found)
