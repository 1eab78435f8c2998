"""What an answer says of stamps that no effect can have made."""

import pytest

import answers
from drake_ispace.explain.answer.contradiction import add_findings
from drake_ispace.explain.answer.explanation import Estimate, NamedEffect
from drake_ispace.explain.check.examine import Examined
from drake_ispace.scenario import load_scenario


def told(**times_s):
    """The first warning of an answer with these effects, each off by a time of +- 3 ms."""
    names = {"clock_offset": "offset_s", "command_delay": "delay_s"}
    answer = answers.named(load_scenario("omni_multirate"))
    answer.effects = [
        NamedEffect(name, "link", [], {names[name]: Estimate(t, (t - 0.003, t + 0.003), "s")}, 0.5)
        for name, t in times_s.items()
    ]
    add_findings(answer, Examined(["a"], 1, [], [], [], {}))
    return next((warning for warning in answer.warnings if "no camera" in warning), None)


def test_a_camera_that_is_early_has_other_stamps_or_the_encoders_have():
    assert "0.05 s before" in told(clock_offset=-0.05) and "encoders'" in told(clock_offset=-0.05)


@pytest.mark.parametrize(("delay_s", "alike"), [(0.052, True), (0.08, False)])
def test_a_delay_as_long_besides_says_which(delay_s, alike):
    assert ("besides" in told(clock_offset=-0.05, command_delay=delay_s)) == alike


@pytest.mark.parametrize("offset_s", [0.05, -0.002])
def test_nothing_is_said_of_a_camera_that_may_be_late(offset_s):
    assert told(clock_offset=offset_s) is None


@pytest.mark.parametrize(("shares", "faults"), [
    ((0.08, -0.1), []), ((-0.4, 0.0), ["wrong_unit"]), ((0.0, 0.3), ["wrong_unit"]),
])
def test_a_large_gain_may_be_another_scale_of_the_command(shares, faults):
    answer = answers.named(load_scenario("velocity_base"))
    estimates = [Estimate(share, (share - 0.01, share + 0.01), "1") for share in shares]
    found = dict(zip(("share_x", "share_yaw"), estimates, strict=True))
    answer.effects = [NamedEffect("velocity_gain", "actuator", [], found, 0.5)]
    add_findings(answer, Examined(["a"], 1, [], [], [], {}))
    assert answer.effects[0].faults == faults
