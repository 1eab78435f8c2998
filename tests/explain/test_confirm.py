"""The gap is shown in the channels that the effect moves, in their own units, and nowhere else."""

import pytest

from drake_ispace.explain.explain import explain
from drake_ispace.hiding import hide
from drake_ispace.scenario import load_scenario


@pytest.fixture(scope="module")
def explanation():
    scenario = load_scenario("pendulum_multirate")
    runs = hide(scenario, "pendulum", {"track_error": {"share": 0.04}}, ["square", "circle", "figure_eight"], 5, 8.0)
    *training, held_out = runs.values()
    return explain(scenario, training, [held_out])


def test_a_wider_track_shows_in_the_wheels_not_in_the_accelerometer(explanation):
    assert [effect.name for effect in explanation.effects] == ["track_error"]
    assert {"encoder: wheel 1", "encoder: wheel 2"} <= set(explanation.gap)
    assert not {"imu: ax", "imu: ay", "imu: az", "imu: wy"} & set(explanation.gap)


def test_the_error_falls_to_that_of_the_refitted_effect(explanation):
    gap = explanation.gap["encoder: wheel 1"]
    assert gap.before > 1.5 * gap.after and gap.after == pytest.approx(gap.refitted, rel=0.03) and gap.unit == "rad"
    assert gap.closed == pytest.approx(1.0, abs=0.05) and gap.ci90[0] < gap.closed < gap.ci90[1] + 1e-9
    assert explanation.closed > 0.9
