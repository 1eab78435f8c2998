"""Plain least squares of free runs ends where the errors are least, also where a size lies near its bound."""

import pytest

from drake_ispace.explain.fit.candidates import candidates
from drake_ispace.explain.predict.case import prepare
from drake_ispace.explain.prove.errors.free_run import errors, windows_of
from drake_ispace.explain.prove.errors.least_squares import plain_fit
from hidden import two_wheels


@pytest.mark.first_case
@pytest.mark.parametrize("delay_s", [1e-5, 4e-4, 0.02])
def test_a_size_near_its_bound_does_not_hold_up_the_others(delay_s):
    exact = {"left_share": 0.0, "late_s": 0.0, "lag_s": 0.0, "in_step": True}
    runs = [two_wheels.drive(70 + i, 10.0, **exact, others={"marker_x_m": 0.04}) for i in range(2)]
    case = prepare(two_wheels.model(), runs)
    known = {c.name: c for c in candidates(case.effects_to_try, case.replay.body)}
    marker, delay = known["marker_offset"], known["velocity_delay"]
    windows = [windows_of(case.prediction, i, {}) for i in range(2)]
    floors = dict.fromkeys(errors(case.prediction, 0, windows[0], {}), 1e-3)
    point, sizes = {marker: [0.0] * 3, delay: [delay_s]}, {marker: [1e-3] * 3, delay: [delay_s]}
    found = plain_fit(case.prediction, windows, point, sizes, floors).point
    assert found[marker][0] == pytest.approx(0.04, abs=1e-3) and found[delay][0] < 2e-3


def test_what_free_runs_cannot_show_keeps_its_size_and_is_not_told():
    """Wherever a turned camera says that a run begins, the way from there on is turned alike."""
    runs = [two_wheels.drive(70 + i, 10.0, 0.0, 0.0, 0.0, others={"marker_x_m": 0.04}) for i in range(2)]
    case = prepare(two_wheels.model(), runs)
    known = {c.name: c for c in candidates(case.effects_to_try, case.replay.body)}
    marker, turned = known["marker_offset"], known["camera_rotation"]
    windows = [windows_of(case.prediction, i, {}) for i in range(2)]
    floors = dict.fromkeys(errors(case.prediction, 0, windows[0], {}), 1e-3)
    point, sizes = {marker: [0.0] * 3, turned: [0.08]}, {marker: [1e-3] * 3, turned: [0.01]}
    found = plain_fit(case.prediction, windows, point, sizes, floors)
    assert found.shown[turned] == [None] and found.point[turned] == [0.08]
    assert found.shown[marker][0] == pytest.approx(0.04, abs=1e-3)
