"""What `explain` and `check` are given as runs."""

import pytest

from drake_ispace.blocks.errors import InputError
from drake_ispace.explain.check.check import check
from drake_ispace.explain.check.runs import by_kind
from drake_ispace.explain.explain import explain


@pytest.mark.parametrize("ask", [check, explain])
@pytest.mark.parametrize("runs", [None, [], {}])
def test_no_run_is_refused(ask, runs):
    with pytest.raises(InputError, match="runs: there is none, expected at least one"):
        ask("omni_multirate", runs)


@pytest.mark.parametrize("ask", [check, explain])
@pytest.mark.parametrize("runs", [5, [5], {"square": 5}])
def test_what_is_no_run_is_refused_by_its_type(ask, runs):
    with pytest.raises(InputError, match="runs: expected recordings or folders of runs, got int 5"):
        ask("omni_multirate", runs)


def test_no_held_out_runs_may_be_given_as_none():
    assert by_kind(None) == by_kind(()) == {"held out": []}
