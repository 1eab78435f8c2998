"""A robot under commanded velocity in another physics engine, whose contacts creep and skid."""

import pytest

import drake_ispace as di
from drake_ispace.explain.check.check import check
from hidden import two_wheels

pytest.importorskip("mujoco", reason="MuJoCo is not installed (pip install 'drake_ispace[physics]')")
from hidden.mujoco_rover import Truth, drive


def told(truth):
    runs = [drive(40 + i, 30.0, truth) for i in range(5)]
    return di.explain(two_wheels.model(), runs[:3], runs[3:])


def test_four_tyres_skid():
    runs = [drive(10 + i, 15.0, Truth(four=True)) for i in range(2)]
    (finding,) = check(two_wheels.model(), runs).findings
    assert finding.fault == "effective_track"


@pytest.mark.slow
def test_a_larger_wheel_and_a_late_camera_are_both_named():
    late, wheel = told(Truth(left_share=-0.02, late_s=0.08)).effects
    assert "camera_latency" in {late.name, *late.equivalents}
    assert "single_wheel_radius_error" in {wheel.name, *wheel.equivalents}


@pytest.mark.slow
def test_a_drive_that_turns_wheels_too_fast_is_named():
    found = told(Truth(gain_share=0.06))
    gain = found.effects[0]
    assert found.verdict in ("named", "set") and not found.remainders
    assert gain.name == "velocity_gain" and gain.parameters["share_x"].estimate == pytest.approx(0.06, abs=0.005)
