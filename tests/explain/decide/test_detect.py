"""How improbable a gain is, far into the tail, and at which gain an alarm is raised."""

import numpy as np
import pytest
from scipy.special import gammaincc
from scipy.stats import chi2, norm

from drake_ispace.effects.library import library
from drake_ispace.explain.decide.proposals.detect import FALSE_ALARM_RATE, detect
from drake_ispace.explain.decide.survey.screen import minus_log10_p_of_gain
from drake_ispace.explain.fit.candidates import candidates


@pytest.mark.parametrize("parameters", [1, 2, 3, 6])
@pytest.mark.parametrize("gain", [0.0, 0.5, 3.0, 24.0, 150.0, 900.0])
def test_the_probability_of_a_gain_is_that_of_chi_squared(gain, parameters):
    expected = -chi2.logsf(gain, parameters) / np.log(10.0)
    assert minus_log10_p_of_gain(gain, parameters) == pytest.approx(expected, rel=1e-3, abs=1e-9)


@pytest.mark.parametrize("parameters", [1, 3])
def test_far_out_the_probability_goes_on_evenly(parameters):
    gains = np.linspace(1000.0, 4000.0, 601)
    steps = np.diff(minus_log10_p_of_gain(gains, parameters))
    assert steps == pytest.approx(2.5 / np.log(10.0), rel=5e-3)  # half of five, less a little


def test_one_parameter_far_out_is_the_tail_of_the_normal_distribution():
    gain = 5000.0
    expected = -(norm.logsf(np.sqrt(gain)) + np.log(2.0)) / np.log(10.0)
    assert minus_log10_p_of_gain(gain, 1) == pytest.approx(expected, rel=1e-6)
    assert gammaincc(0.5, gain / 2.0) == 0.0  # no ordinary number is as small


TRIALS = np.max(-np.log10(np.random.default_rng(0).uniform(size=(400, 50))), axis=1)  # fifty independent effects


def test_at_the_threshold_the_rate_of_false_alarms_is_reached():
    threshold = detect(0.0, TRIALS).threshold
    assert detect(threshold, TRIALS).p_value == pytest.approx(FALSE_ALARM_RATE, rel=1e-6)
    assert not detect(threshold - 0.01, TRIALS).found and detect(threshold + 0.01, TRIALS).found
    assert threshold == pytest.approx(np.log10(50.0 / FALSE_ALARM_RATE), abs=0.15)


def test_a_p_value_is_corrected_for_trying_many():
    assert detect(6.0, TRIALS).p_value == pytest.approx(50.0e-6, rel=0.4)
    assert detect(np.quantile(TRIALS, 0.9), TRIALS).p_value == pytest.approx(0.1, rel=1e-6)
    assert detect(0.0, TRIALS).p_value == pytest.approx(1.0, abs=1e-6)


@pytest.mark.parametrize("minus_log10_p, in_doubt", [(3.5, True), (5.99, True), (6.0, False), (300.0, False)])
def test_a_weak_alarm_is_in_doubt(minus_log10_p, in_doubt):
    assert detect(minus_log10_p, TRIALS).in_doubt == in_doubt


class Body:
    """A robot of four wheels in a room, as far as effects that choose a wheel or a place ask."""

    wheels, room_m = 4, (3.0, 6.0)


EDGES = ("x_min_m", "x_max_m", "y_min_m", "y_max_m")


def test_an_effect_on_one_wheel_is_a_candidate_for_each():
    effects = {name: library()[name] for name in ("encoder_lost_counts", "camera_scale")}
    found = candidates(effects, Body())
    assert [c.label for c in found] == [f"encoder_lost_counts[{w}]" for w in (1, 2, 3, 4)] + ["camera_scale"]
    assert [c.among for c in found] == [4, 4, 4, 4, 1]


def test_an_effect_on_a_part_of_the_room_is_a_candidate_for_each_ninth_and_four_of_them():
    found = candidates({"soft_patch": library()["soft_patch"]}, Body())
    assert [c.among for c in found] == [13] * 13 and len(set(found)) == 13
    first, last = found[0].neutral, found[-1].neutral
    assert first == [0.0, -1.5, -0.5, -3.0, -1.0, 0.05] and last == [0.0, -0.5, 1.5, -1.0, 3.0, 0.05]
    assert all(set(c.values(c.neutral)) == {"force_n", *EDGES, "edge_m"} for c in found)


def test_draws_of_noise_may_be_clearer_than_any_number_tells():
    near, far = detect(3.0, TRIALS), detect(403.0, TRIALS + 400.0)
    assert far.p_value == pytest.approx(near.p_value) and far.threshold == pytest.approx(near.threshold + 400.0)
