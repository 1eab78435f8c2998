"""What is named, and what stands beside it, where residuals are linear and every size and gain can be checked."""

from functools import partial

import numpy as np
import pytest
from linear import ROWS, RUNS, Linear, made, noise, nothing_unnamed, pattern, streams, unnamed, wave
from scipy.signal import lfilter

from drake_ispace.explain.decide.decide import Decision, decide, left_over, pruned
from drake_ispace.explain.decide.joint import decide_jointly
from drake_ispace.explain.decide.survey import survey
from drake_ispace.explain.fit.likelihood import fit

SHAPES = {"tilt": pattern(3), "drag": pattern(5), "lag": pattern(8), "slip": pattern(13)}
BOTH = pytest.mark.parametrize("how", [decide, decide_jointly])


def decided(measured, shapes=SHAPES, how=decide, low=-100.0, others=nothing_unnamed, offsets=()) -> Decision:
    return how(Linear(measured, shapes, offsets), made(*shapes, low=low), 0, None, unnamed=others)


def sizes(decision):
    return {} if decision.named is None else {c.name: z[0] for c, z in decision.named.point.items()}


def rivals(decision, name):
    return [r.candidate.name for c, found in decision.rivals.items() if c.name == name for r in found]


def gains(decision):
    return {c.name: gain for c, gain in decision.gains.items()}


# ------------------------------------------------------------------------------------------------------------ what is


@BOTH
def test_an_effect_that_is_there_is_named_with_its_size(how):
    found = decided(noise() + 0.8 * SHAPES["tilt"], how=how)
    assert sizes(found) == {"tilt": pytest.approx(0.8, abs=3.0 / np.sqrt(RUNS * ROWS))}
    assert found.detection.found and found.unknown is None and found.left_over is None


def test_it_gains_the_square_of_its_whitened_signature():
    found = decided(noise() + 0.8 * SHAPES["tilt"])
    likelihood = found.end.likelihood
    signature = likelihood.whitening(streams(SHAPES["tilt"]))
    length2 = signature @ likelihood.marginalised(signature)
    assert length2 == pytest.approx(RUNS * ROWS, rel=0.1)
    assert gains(found)["tilt"] == pytest.approx(sizes(found)["tilt"] ** 2 * length2, rel=1e-3)
    assert found.total_gain == gains(found)["tilt"]


@BOTH
def test_two_effects_are_both_named(how):
    found = decided(noise() + 0.8 * SHAPES["tilt"] - 0.6 * SHAPES["lag"], how=how)
    assert sizes(found) == {"tilt": pytest.approx(0.8, abs=0.15), "lag": pytest.approx(-0.6, abs=0.15)}
    assert gains(found)["tilt"] > gains(found)["lag"] > 50.0


def test_a_stage_is_told_for_every_look():
    told = []
    decide(Linear(noise() + SHAPES["lag"], SHAPES), made(*SHAPES), 0, None, told.append, nothing_unnamed)
    assert told == [
        "looking at every effect", "fitting the leaders", "looking again with lag",
        "fitting the leaders for what is left",
    ]


# --------------------------------------------------------------------------------------------------------- what is not


@BOTH
@pytest.mark.parametrize("seed", range(10))
def test_nothing_is_named_in_noise(how, seed):
    found = decided(noise(seed), how=how, others=unnamed("time", pattern(21)))
    assert not found.detection.found and found.named is None and found.unknown is None


@pytest.mark.parametrize("seed", range(5))
def test_nothing_is_named_in_slow_noise(seed):
    waves = {"tilt": wave(3), "drag": wave(5), "lag": wave(8)}
    assert decided(lfilter([0.3], [1.0, -0.95], noise(seed)), waves).named is None


def test_an_effect_is_not_named_for_its_opposite():
    opposite = noise() - 0.8 * SHAPES["tilt"]
    assert list(sizes(decided(opposite))) == ["tilt"]
    found = decided(opposite, low=0.0)
    assert sizes(found) == {} and found.start.minus_log10_p[0] < 0.5


def test_what_a_run_may_be_off_by_itself_is_no_effect():
    own = np.vstack([SHAPES["tilt"][0], np.zeros(ROWS)])
    assert list(sizes(decided(noise() + own))) == ["tilt"]
    offsets = tuple((run, 3.0 * SHAPES["tilt"][run]) for run in range(RUNS))
    assert not decided(noise() + own, offsets=offsets).detection.found


# ------------------------------------------------------------------------------------------------------- what rivals it


@BOTH
@pytest.mark.parametrize("size, other", [(0.8, 0.1), (0.3, 0.25)])
def test_a_look_alike_stands_beside_the_name(how, size, other):
    like = SHAPES["tilt"] + other * pattern(7)
    found = decided(noise() + size * SHAPES["tilt"], SHAPES | {"scale": like}, how)
    ((name, _),) = sizes(found).items()
    assert {name, *rivals(found, name)} == {"tilt", "scale"}


def test_a_rival_says_how_far_behind_it_is():
    like = SHAPES["tilt"] + 0.1 * pattern(7)
    found = decided(noise() + 0.8 * SHAPES["tilt"], SHAPES | {"scale": like})
    (of, (rival,)), = found.rivals.items()
    other = fit(found.end.likelihood, {rival.candidate: found.named.point[of]})
    assert rival.behind == pytest.approx(other.deviance - found.named.deviance, abs=0.05)


@BOTH
def test_what_is_clearly_worse_is_ruled_out(how):
    like = SHAPES["tilt"] + 0.4 * pattern(7)
    found = decided(noise() + 0.8 * SHAPES["tilt"], SHAPES | {"scale": like}, how)
    assert list(sizes(found)) == ["tilt"] and rivals(found, "tilt") == []


def test_of_two_named_effects_each_has_its_own_rivals():
    like = SHAPES["lag"] + 0.1 * pattern(7)
    found = decided(noise() + 0.8 * SHAPES["tilt"] + 0.8 * SHAPES["lag"], SHAPES | {"delay": like})
    (late,) = set(sizes(found)) - {"tilt"}
    assert rivals(found, "tilt") == [] and {late, *rivals(found, late)} == {"lag", "delay"}


# ------------------------------------------------------------------------------------------------- what has no name


def test_a_disagreement_without_a_name_that_explains_more_is_unknown():
    nearest = pattern(21) + 0.7 * pattern(7)
    found = decided(noise() + 0.8 * pattern(21), SHAPES | {"near": nearest}, others=unnamed("time", pattern(21)))
    assert found.named is None and found.unknown[0].driver == "time" and found.unknown[1] > 100.0
    assert found.nearest[0].name == "near" and found.nearest[1] < found.unknown[1]


def test_one_that_explains_no_more_leaves_the_name():
    found = decided(noise() + 0.8 * SHAPES["tilt"], others=unnamed("time", SHAPES["tilt"]))
    assert list(sizes(found)) == ["tilt"] and found.unknown is None


def test_one_beside_a_named_effect_leaves_its_name_and_is_unknown():
    found = decided(noise() + 0.8 * SHAPES["tilt"] + 0.6 * pattern(21), others=unnamed("time", pattern(21)))
    assert list(sizes(found)) == ["tilt"] and found.unknown[0].driver == "time"


def test_a_small_one_beside_a_named_effect_is_left_over():
    found = decided(noise() + 0.8 * SHAPES["tilt"] + 0.25 * pattern(21), others=unnamed("time", pattern(21)))
    assert found.unknown is None and found.left_over.candidate.name == "time" and found.left_over.p_value < 0.01


# ----------------------------------------------------------------------------------- what is left, what is too much

GREAT, SMALL = 4.0 * SHAPES["tilt"], 0.6 * SHAPES["lag"]


def test_what_is_small_beside_the_first_is_left_over_and_not_named():
    found = decided(noise() + GREAT + SMALL)
    assert list(sizes(found)) == ["tilt"] and found.left_over.candidate.name == "lag"
    assert found.left_over.gain < found.least


def test_jointly_it_is_named():
    assert set(sizes(decided(noise() + GREAT + SMALL, how=decide_jointly))) == {"tilt", "lag"}


def test_nothing_is_left_over_of_noise():
    assert left_over(decided(noise() + GREAT), 0) is None


def held(measured, names, shapes):
    """(look, Decision) with these effects named, whether or not they are needed."""
    look = partial(survey, Linear(measured, shapes), tried=made(*shapes), pool=None, unnamed=nothing_unnamed)
    start = look({})
    point = {c: [0.1] for c in start.screen.candidates if c.name in names}
    end = look(point, near=True)
    return look, Decision(None, start, end, fit(end.likelihood, point))


@BOTH
def test_an_effect_that_later_ones_make_superfluous_is_taken_away(how):
    mixed, told = SHAPES["tilt"] + SHAPES["lag"] + 0.7 * pattern(17), []
    shapes = SHAPES | {"mixed": mixed}
    runs = Linear(noise() + SHAPES["tilt"] + 0.8 * SHAPES["lag"], shapes)
    found = how(runs, made(*shapes), 0, None, told.append, nothing_unnamed)
    assert any("mixed, tilt, lag" in stage for stage in told)
    assert sizes(found) == {"tilt": pytest.approx(1.0, abs=0.1), "lag": pytest.approx(0.8, abs=0.1)}
    assert set(gains(found)) == {"tilt", "lag"}


def test_one_effect_that_does_as_well_as_all_named_takes_their_place():
    mixed = SHAPES["tilt"] + SHAPES["lag"]
    found = pruned(*held(noise() + 0.8 * mixed, ("tilt", "lag"), SHAPES | {"mixed": mixed}))
    assert sizes(found) == {"mixed": pytest.approx(0.8, abs=0.15)}
    assert gains(found) == {"mixed": found.total_gain}


def test_effects_that_are_all_needed_stay():
    measured = noise() + SHAPES["tilt"] + 0.7 * SHAPES["lag"]
    look, before = held(measured, ("tilt", "lag"), SHAPES)
    assert sizes(pruned(look, before)) == sizes(before)
