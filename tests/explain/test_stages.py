"""Small parts of the stages of `explain`, by numbers that a reader can check."""

import re
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import chi2

from drake_ispace.effects.library import library
from drake_ispace.explain.answer.explanation import Explanation
from drake_ispace.explain.decide.decision import LEAST_FURTHER, least_further
from drake_ispace.explain.decide.proposals.detect import Detection, detect
from drake_ispace.explain.decide.survey.screen import minus_log10_p_of_gain
from drake_ispace.explain.fit.candidates import Candidate, candidates, coordinate, probes, value_of
from stand_ins.tried import OMNI, candidate

ROOM = Path(__file__).parents[2] / "src" / "drake_ispace" / "explain"


def test_a_limit_is_fitted_as_its_reciprocal():
    limit = candidate("torque_saturation").parameters[0]
    assert coordinate(limit, np.inf) == 0.0 and value_of(limit, 0.0) == np.inf
    assert value_of(limit, coordinate(limit, 0.05)) == pytest.approx(0.05)


def test_a_choice_of_wheel_makes_a_candidate_of_each():
    every = candidates({"weak_motor": library()["weak_motor"]}, OMNI)
    assert [c.label for c in every] == [f"weak_motor[{i}]" for i in range(1, 5)]
    assert every[1].values([0.2]) == {"wheel": 2, "loss": 0.2}


def test_a_further_effect_must_be_as_improbable_however_much_was_tried_for_it():
    slope, patch = candidate("floor_tilt"), candidates({"soft_patch": library()["soft_patch"]}, OMNI)[0]
    of_wheel = candidates({"weak_motor": library()["weak_motor"]}, OMNI)[0]
    for one in (slope, patch, of_wheel):
        by_chance = one.among * chi2.sf(least_further(one), len(one.parameters))
        assert by_chance == pytest.approx(chi2.sf(LEAST_FURTHER, 1))


def test_probes_stay_within_bounds_and_leave_the_neutral_value():
    for effect in library().values():
        if not effect.applies_to(OMNI):
            continue
        probed = Candidate(effect, (), effect.parameters_of(OMNI))
        for z in probes(probed, {"torque": 0.02, "speed": 8.0}):
            assert z != probed.neutral
            assert all(low <= at <= high for at, (low, high) in zip(z, probed.bounds, strict=True))


def test_the_p_value_is_one_where_noise_reaches_as_much():
    largest = np.random.default_rng(0).exponential(0.5, 400)
    assert detect(0.1, largest).p_value > 0.5
    assert detect(12.0, largest).p_value < 1e-6
    assert not detect(float(np.median(largest)), largest).found


def test_the_threshold_is_where_the_p_value_is_the_false_alarm_rate():
    largest = np.random.default_rng(1).exponential(0.5, 400)
    threshold = detect(1.0, largest).threshold
    assert detect(threshold, largest).p_value == pytest.approx(0.01, rel=1e-6)


@pytest.mark.parametrize("parameters", [1, 2, 9])
def test_minus_log10_p_is_that_of_chi_square_and_goes_on_below_the_smallest_float(parameters):
    gains = np.array([0.0, 1.0, 40.0, 900.0])
    exact = -chi2.logsf(gains, parameters) / np.log(10.0)
    assert minus_log10_p_of_gain(gains, parameters) == pytest.approx(exact)
    nearer, farther = minus_log10_p_of_gain(np.array([999.999, 1000.001]), parameters)
    assert farther == pytest.approx(nearer, abs=2e-3)
    assert 1070.0 < minus_log10_p_of_gain(5000.0, parameters) < 1088.0


def test_an_explanation_without_effects_says_so_and_is_plain_data():
    answer = Explanation("none", [], Detection(0.4, np.float64(1.2), 3.1), [], [])
    data = answer.to_data()
    assert data["verdict"] == "none" and data["gap"] == [] and data["closed"] is None
    assert type(data["detection"]["minus_log10_p"]) is float and "lacks nothing that these runs" in str(answer)


def test_a_stage_uses_only_stages_before_it():
    stages = ["check", "predict", "fit", "decide", "prove", "answer"]
    for file in ROOM.rglob("*.py"):
        own = file.relative_to(ROOM).parts[0]
        used = re.findall(r"from drake_ispace\.explain\.(\w+)", file.read_text(encoding="utf-8"))
        if own in stages:
            assert all(stages.index(stage) <= stages.index(own) for stage in used if stage in stages), file
