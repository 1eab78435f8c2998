"""The gap and what is left of it, as a reader is told."""

from dataclasses import replace

import pytest

import answers
from drake_ispace.explain.answer.explanation import Estimate
from drake_ispace.explain.answer.sentences import gap_sentence, p_in_words, sentence_of, short
from drake_ispace.explain.prove.left.remainder import amount
from drake_ispace.scenario import load_scenario

ROW = answers.GAP[0]


@pytest.mark.parametrize("value, unit, said", [
    (0.0042, "m", "4.2 mm"), (1.25, "m", "1.25 m"), (0.0042, "rad", "0.0042 rad"), (0.11, "1", "0.11"),
])
def test_metres_below_one_are_millimetres_and_a_share_has_no_unit(value, unit, said):
    assert amount(value, unit) == said


def test_a_probability_is_never_zero():
    assert [p_in_words(p) for p in (0.0123, 0.0)] == ["p = 0.012", "p < 2e-308"]


def test_the_headline_says_how_it_was_proven_and_what_noise_may_be():
    assert gap_sentence(ROW, "held-out runs", True) == (
        "held-out runs: position simulated on the recorded torque over 5 s was off by 300 mm, is off by 40 mm, "
        "of which noise may be 33.5 mm: 98 % of the gap closed"
    )


def test_a_model_that_lacks_nothing_has_one_error():
    assert gap_sentence(ROW, "", False).endswith("over 5 s is off by 300 mm")


@pytest.mark.parametrize("proof, has_effects, said", [
    ("held-out runs", True, "the gap in metres is small beside what noise may leave"),
    ("", True, "no run was held out to prove it on"),
    ("held-out runs", False, ""),
])
def test_without_a_headline_it_says_why(proof, has_effects, said):
    assert gap_sentence(None, proof, has_effects) == said


def test_noise_in_which_something_is_unexplained_is_no_excuse_and_no_share_is_told():
    assert gap_sentence(replace(ROW, closed=None), "held-out runs", True, holds_unexplained=True).endswith(
        "was off by 300 mm, is off by 40 mm, of which noise may be 33.5 mm, with what is still unexplained in it"
    )


@pytest.mark.parametrize("verdict, is_fitted, is_small", [
    ("incomplete", True, False), ("named", True, True), ("incomplete", False, True),
])
def test_a_gap_is_not_small_beside_noise_that_the_unexplained_made_large(verdict, is_fitted, is_small):
    rows = [replace(ROW, chance=0.4, closed=None)]
    answer = answers.named(load_scenario("omni_multirate"), verdict=verdict, gap=rows, noise_is_fitted=is_fitted)
    (said,) = answer.headlines_in_words()
    assert ("is small beside" in said) == is_small and ("was off by 300 mm, is off by 40 mm" in said) != is_small
    assert answer.headline is None and answer.closed is None


def test_an_estimate_says_what_it_is_of():
    size = Estimate(0.05, (0.04, 0.06), "1", called="of length and width together")
    answer = answers.named(load_scenario("omni_multirate"))
    answer.effects = [replace(answer.effects[0], parameters={"share": size})]
    assert "    share (of length and width together) = 0.05 [0.04, 0.06] 1" in str(answer)


def test_a_simulated_channel_is_not_called_simulated_twice():
    row = replace(ROW, channel="simulated wheel angle", unit="rad", horizon="run")
    assert "simulated wheel angle over whole runs was off" in gap_sentence(row, "held-out runs", True)


def test_a_row_tells_only_what_is_known():
    row = replace(ROW, sensors=None, chance=None, least_squares=None)
    assert short(row) == "RPE 5s, position (torque): 300 mm -> 40 mm"


def test_what_is_left_names_channel_size_variable_and_runs_without_their_folders():
    said = sentence_of(replace(answers.LEFT, runs=["/far/away/circular/run-07.csv"]))
    assert said == (
        "encoder: wheel 2: 0.07 rad over 0.2 s, goes with speed, from the start of a run (41 % goes with speed); "
        "most in circular/run-07.csv"
    )


def test_every_verdict_prints():
    model = load_scenario("omni_multirate")
    every = [answers.named(model), answers.one_of_a_set(model), answers.incomplete(model), answers.nothing(),
             answers.unknown()]
    assert len({str(answer).splitlines()[0] for answer in every}) == 5
