"""Commands in a scale that is no unit: percent or shares of a largest speed."""

import numpy as np
import pytest

from drake_ispace.explain.check.check import check
from drake_ispace.explain.check.compare.links import base_of
from drake_ispace.explain.check.compare.scale import ratios, scales
from drake_ispace.faults.repair import Mixed
from drake_ispace.robots.library import robots
from hidden import three_wheels, two_wheels

UNITS = {"cm/s": 0.01, "km/h": 1.0 / 3.6}


@pytest.fixture(scope="module")
def runs():
    return [three_wheels.drive(70 + i, 12.0) for i in range(2)]


def scaled(runs, way, turn):
    """The runs with other numbers for the same command."""
    factors = ((way, 0.0, 0.0), (0.0, way, 0.0), (0.0, 0.0, turn))
    return [Mixed("command", ("vx", "vy", "wz"), factors).apply(run) for run in runs]


@pytest.mark.parametrize(("measured", "found"), [
    ([1.0, 1.05], [""]), ([1.0 / 0.6, 3.0], [""]), ([1.0 / 1.4], [""]), ([100.0, 90.0], ["", "in cm/s"]),
    ([3.6], ["", "in km/h"]), ([None], ["", "in cm/s", "in km/h"]), ([1.0, 100.0], ["", "in cm/s"]),
])
def test_a_unit_is_one_that_the_ratio_allows_and_a_drive_that_does_less_is_in_none(measured, found):
    assert [scale.what for scale in scales(measured, "m/s", UNITS)] == found


@pytest.mark.parametrize(("ratio", "may_be"), [
    (150.0, "(cm/s if the drive does 67% of it)"), (0.5, "(m/s if the drive does 200% of it)"), (5e4, "the wheels say"),
])
def test_a_ratio_that_no_unit_explains_is_a_scale_by_itself(ratio, may_be):
    _, scale = scales([ratio, 1.01 * ratio, ratio], "m/s", UNITS)
    assert f"about {ratio:g} times as large as the wheels say" in scale.what and may_be in scale.what
    assert scale.factor == pytest.approx(1.0 / ratio) and scale.advice


@pytest.mark.parametrize("lag_s", [0.0, 0.5])
def test_wheels_that_follow_slowly_do_not_change_the_ratio(lag_s):
    run = two_wheels.drive(80, 15.0, left_share=0.0, late_s=0.1, lag_s=lag_s, in_step=True)
    base = base_of(run, robots()["rover"], two_wheels.model().rover)
    assert np.allclose(ratios([run], [base]), 1.0, atol=0.05)


@pytest.mark.first_case
@pytest.mark.parametrize(("way", "turn"), [(150.0, 150.0), (200.0, 50.0), (1.0, 1.0 / 1.6)])
def test_a_command_in_no_unit_is_told_as_it_is_measured(runs, way, turn):
    checked = check(three_wheels.model(), scaled(runs, way, turn))
    (finding,) = checked.findings
    assert (finding.fault, finding.channel, finding.runs) == ("wrong_unit", "command", (0, 1))
    assert "times as large as the wheels say" in finding.what and not finding.repairs and "gain" in finding.repair


@pytest.mark.parametrize("share", [0.6, pytest.param(0.9, marks=pytest.mark.slow)])
def test_a_drive_that_does_less_than_told_accuses_nobody(runs, share):
    assert check(three_wheels.model(), scaled(runs, 1.0 / share, 1.0 / share)).findings == []


def test_a_unit_is_told_beside_a_small_gain(runs):
    (finding,) = check(three_wheels.model(), scaled(runs, 107.0, 1.0)).findings
    assert finding.what == "vx, vy in cm/s" and finding.repairs
