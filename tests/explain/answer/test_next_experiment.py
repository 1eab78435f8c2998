"""The next experiment is one that can be done."""

from types import SimpleNamespace

import pytest

from drake_ispace.explain.answer.next_experiment import next_experiment


@pytest.mark.parametrize("driver, expected", [
    ("speed", "drive so that speed changes"), ("time", "repeat one motion several times"),
    ("nothing", "repeat one motion tilted or loaded otherwise"),
])
def test_what_goes_with_nothing_is_changed_by_another_way_to_set_it_up(driver, expected):
    said = next_experiment([], SimpleNamespace(driver=driver, nearest="none"), [])
    assert said.startswith(expected) and "nothing changes" not in said
