"""What a single run of a user's own plant shows by itself, beside unknown torques as strong as the model assumes."""

import pytest
from test_own_asked import INERTIA, VISCOUS, run
from test_own_drives import model, told_apart

from drake_ispace.explain.decide.each_part import shown_by_run
from drake_ispace.explain.fit.candidates import candidates
from drake_ispace.explain.predict.case import prepare


@pytest.mark.parametrize("offset, found", [(0.015, []), (0.1, ["motor_offset"])])
def test_a_mean_that_unknown_torques_may_have_is_no_effect_of_a_single_run(offset, found):
    """In 8 s those of 5 %, 0.06 N m, have one of 0.007 N m."""
    runs = [run(k, offset=offset * (k == 2), push=0.0) for k in (1, 2, 3)]
    case = prepare(model(INERTIA, VISCOUS), runs, effects=told_apart("motor_offset"))
    tried = candidates(case.effects_to_try, case.replay.body)
    assert [one.candidate.name for one in shown_by_run(case.prediction, {}, tried, 0)] == found
