"""Which effects are named, and which rivals stay, on residuals that are linear in the sizes of effects.

There every size and every gain can be checked.
"""

import importlib
from dataclasses import replace
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import lfilter

from drake_ispace.effects.card import Parameter
from drake_ispace.explain.decide.decide import decide
from drake_ispace.explain.decide.decision import LEAST_FURTHER, MARGIN, Decision, margin
from drake_ispace.explain.decide.left_over import left_over
from drake_ispace.explain.decide.prune import pruned
from drake_ispace.explain.decide.rivals import with_rivals
from drake_ispace.explain.decide.shown import shown_at
from drake_ispace.explain.decide.survey.survey import survey
from drake_ispace.explain.fit.likelihood import fit
from stand_ins.linear import ROWS, RUNS, Linear, generics_of, made, no_generics, noise, pattern, streams, wave

module = importlib.import_module("drake_ispace.explain.decide.decide")
rivals_module = importlib.import_module("drake_ispace.explain.decide.rivals")
SHAPES = {"tilt": pattern(3), "drag": pattern(5), "lag": pattern(8), "slip": pattern(13)}


def decided(measured, shapes=SHAPES, low=-100.0, generics=no_generics, offsets=()) -> Decision:
    return decide(Linear(measured, shapes, offsets), made(*shapes, low=low), 0, generics=generics)


def sizes(decision):
    return {} if decision.named is None else {c.name: z[0] for c, z in decision.named.point.items()}


def rivals(decision, name):
    return [r.candidate.name for c, others in decision.rivals.items() if c.name == name for r in others]


def gains(decision):
    return {c.name: gain for c, gain in decision.gains.items()}


# ----------------------------------------------------------------------------------------------- effects that are named


def test_an_effect_that_is_there_is_named_with_its_size():
    decision = decided(noise() + 0.8 * SHAPES["tilt"])
    assert sizes(decision) == {"tilt": pytest.approx(0.8, abs=3.0 / np.sqrt(RUNS * ROWS))}
    assert decision.detection.found and decision.unknown is None and decision.left_over is None


def test_a_gain_is_the_square_of_the_whitened_signature_times_the_size():
    decision = decided(noise() + 0.8 * SHAPES["tilt"])
    likelihood = decision.end.likelihood
    signature = likelihood.whitening(streams(SHAPES["tilt"]))
    length2 = signature @ likelihood.marginalised(signature)
    assert length2 == pytest.approx(RUNS * ROWS, rel=0.1)
    assert gains(decision)["tilt"] == pytest.approx(sizes(decision)["tilt"] ** 2 * length2, rel=1e-3)
    assert decision.total_gain == gains(decision)["tilt"]


def test_two_effects_are_both_named():
    decision = decided(noise() + 0.8 * SHAPES["tilt"] - 0.6 * SHAPES["lag"])
    assert sizes(decision) == {"tilt": pytest.approx(0.8, abs=0.15), "lag": pytest.approx(-0.6, abs=0.15)}
    assert gains(decision)["tilt"] > gains(decision)["lag"] > 50.0


def test_a_further_effect_is_named_although_the_first_one_looks_alike():
    shapes = SHAPES | {"scale": 0.95 * SHAPES["tilt"] + 0.3 * pattern(7)}
    decision = decided(noise() + 0.8 * shapes["tilt"] + 0.8 * shapes["scale"], shapes)
    assert sizes(decision) == {"tilt": pytest.approx(0.8, abs=0.4), "scale": pytest.approx(0.8, abs=0.4)}


def test_what_is_left_over_can_be_named_too():
    decision = decided(noise() + 0.8 * SHAPES["tilt"] + 0.14 * SHAPES["lag"])
    assert set(sizes(decision)) == {"tilt"} and decision.left_over.candidate.name == "lag"
    further = decision.with_effects(decision.further[0])
    assert sizes(further) == {"tilt": pytest.approx(0.8, abs=0.1), "lag": pytest.approx(0.14, abs=0.1)}
    assert 0.0 < gains(further)["lag"] < LEAST_FURTHER and further.left_over is None


def test_a_further_effect_that_the_runs_contradict_is_not_named():
    measured = noise() + 0.8 * SHAPES["tilt"]
    assert set(sizes(decided(measured + 0.25 * SHAPES["lag"]))) == {"tilt", "lag"}
    assert set(sizes(decided(measured + [[0.9], [-0.2]] * SHAPES["lag"]))) == {"tilt"}


def test_every_step_is_told():
    messages = []
    decide(Linear(noise() + SHAPES["lag"], SHAPES), made(*SHAPES), 0, messages.append, no_generics)
    assert messages == [
        "looking at every effect", "fitting the leaders", "looking again with lag",
        "fitting the leaders for what is left",
    ]


def test_the_noise_of_few_numbers_has_nothing_of_nuisances():
    """More effects than half of the numbers explain all of them; nuisances must then be taken away by themselves."""
    few, shift = slice(0, 12), np.arange(12.0) - 5.5
    shapes = {str(i): pattern(i)[:, few] for i in range(14)}
    offsets = tuple((run, 50.0 * shift) for run in range(RUNS))
    runs = Linear(noise()[:, few] + 30.0 * shift, shapes, offsets)
    current = survey(runs, {}, made(*shapes), generics=no_generics)
    assert abs(current.noise.reshape(RUNS, -1) @ shift).max() < 0.1 * np.linalg.norm(current.w) * np.linalg.norm(shift)


# --------------------------------------------------------------------------------------------- noise and the impossible


@pytest.mark.parametrize("seed", range(10))
def test_nothing_is_named_in_noise(seed):
    decision = decided(noise(seed), generics=generics_of("time", pattern(21)))
    assert not decision.detection.found and decision.named is None and decision.unknown is None


@pytest.mark.parametrize("seed", range(5))
def test_nothing_is_named_in_slow_noise(seed):
    waves = {"tilt": wave(3), "drag": wave(5), "lag": wave(8)}
    assert decided(lfilter([0.3], [1.0, -0.95], noise(seed)), waves).named is None


def test_an_effect_is_not_named_for_its_opposite():
    opposite = noise() - 0.8 * SHAPES["tilt"]
    assert list(sizes(decided(opposite))) == ["tilt"]
    decision = decided(opposite, low=0.0)
    assert sizes(decision) == {} and decision.start.minus_log10_p[0] < 0.5


def test_an_offset_of_single_runs_is_no_effect():
    own = np.vstack([SHAPES["tilt"][0], np.zeros(ROWS)])
    assert list(sizes(decided(noise() + own))) == ["tilt"]
    offsets = tuple((run, 3.0 * SHAPES["tilt"][run]) for run in range(RUNS))
    assert not decided(noise() + own, offsets=offsets).detection.found


# --------------------------------------------------------------------------------------------------------------- rivals


@pytest.mark.parametrize("size, other", [(0.8, 0.1), (0.3, 0.25)])
def test_a_look_alike_stands_beside_the_name(size, other):
    like = SHAPES["tilt"] + other * pattern(7)
    decision = decided(noise() + size * SHAPES["tilt"], SHAPES | {"scale": like})
    ((name, _),) = sizes(decision).items()
    assert {name, *rivals(decision, name)} == {"tilt", "scale"}


def test_a_rival_says_how_far_behind_it_is():
    like = SHAPES["tilt"] + 0.1 * pattern(7)
    decision = decided(noise() + 0.8 * SHAPES["tilt"], SHAPES | {"scale": like})
    ((effect, (rival,)),) = decision.rivals.items()
    other = fit(decision.end.likelihood, {rival.candidate: decision.named.point[effect]})
    assert rival.behind == pytest.approx(other.deviance - decision.named.deviance, abs=0.05)


def test_a_look_alike_that_is_clearly_worse_is_ruled_out():
    like = SHAPES["tilt"] + 0.4 * pattern(7)
    decision = decided(noise() + 0.8 * SHAPES["tilt"], SHAPES | {"scale": like})
    assert list(sizes(decision)) == ["tilt"] and rivals(decision, "tilt") == []


@pytest.mark.parametrize("apart, own, names", [
    (0.16, -10.9, ["scale"]), (0.16, 10.9, []), (0.16, None, []), (0.18, -100.0, []),
])
def test_a_look_alike_just_ruled_out_counts_under_the_noise_that_it_leaves_itself_too(monkeypatch, apart, own, names):
    """It is 10.9 behind under the noise that was learned with the named effect, or 13.9, more than twice the margin.

    own: how far behind under its own noise, None: as it is.
    """
    if own is not None:
        monkeypatch.setattr(rivals_module, "_behind_under_its_noise", lambda decision, rival: own)
    decision = decided(noise() + 0.8 * SHAPES["tilt"], SHAPES | {"scale": SHAPES["tilt"] + apart * pattern(7)})
    assert list(sizes(decision)) == ["tilt"] and rivals(decision, "tilt") == names


def test_look_alikes_share_the_level_at_which_they_are_ruled_out():
    """Of noise alone the best of ten look-alikes gains the margin of ten as rarely as one gains that of one."""
    assert margin(1) == MARGIN
    gains = np.random.default_rng(0).standard_normal((40_000, 10)) ** 2
    assert np.mean(gains.max(axis=1) > margin(10)) == pytest.approx(0.01, abs=0.002)
    assert np.mean(gains[:, 0] > margin(1)) == pytest.approx(0.01, abs=0.002)


def test_a_look_alike_that_one_of_two_runs_prefers_is_not_ruled_out():
    apart = 0.4 * pattern(7)
    runs_differ = np.array([[-0.6], [0.8]]) * apart  # how far each run lies from the tilt towards the scale
    decision = decided(noise() + 0.8 * (SHAPES["tilt"] + runs_differ), SHAPES | {"scale": SHAPES["tilt"] + apart})
    assert list(sizes(decision)) == ["tilt"] and rivals(decision, "tilt") == ["scale"]


def test_of_two_that_do_as_well_the_one_whose_size_makes_sense_is_named_alone():
    shapes = {"tilt": SHAPES["tilt"], "scale": SHAPES["tilt"] + 0.05 * pattern(7)}
    for sensible in shapes:
        tried = [
            replace(c, parameters=tuple(replace(p, sensible=(-0.1, 9.0 * (c.name == sensible))) for p in c.parameters))
            for c in made(*shapes)
        ]
        decision = decide(Linear(noise() + 0.8 * SHAPES["tilt"], shapes), tried, 0, generics=no_generics)
        assert list(sizes(decision)) == [sensible] and rivals(decision, sensible) == []
        assert gains(decision) == {sensible: pytest.approx(decision.total_gain, rel=0.05)}


def test_of_two_that_do_as_well_the_one_with_fewer_parameters_is_named():
    shapes = {"tilt": SHAPES["tilt"], "scale": SHAPES["tilt"]}
    tilt, scale = made(*shapes)
    where = Parameter("where", "", low=0.0, high=1.0, probes=(0.5,), shape=True)
    scale = replace(scale, parameters=(*scale.parameters, where))
    survey_at = partial(survey, Linear(noise() + 0.8 * SHAPES["tilt"], shapes), candidates=[tilt, scale])
    start, end = survey_at({}, generics=no_generics), survey_at({scale: [0.8, 0.3]}, generics=no_generics)
    named = Decision(None, start, start).with_named(end, fit(end.likelihood, {scale: [0.8, 0.3]}))
    named.gains = {scale: named.total_gain}
    decision = with_rivals(named)
    assert list(sizes(decision)) == ["tilt"] and rivals(decision, "tilt") == ["scale"]
    assert gains(decision) == {"tilt": named.total_gain}
    assert list(sizes(with_rivals(replace(named, kept={scale: None})))) == ["scale"]


@pytest.mark.parametrize("most, equals", [(0.75, ["tilt"]), (0.3, [])])
def test_an_effect_displaced_for_its_size_stays_a_rival_if_a_size_that_makes_sense_is_near(most, equals):
    shapes = {"tilt": SHAPES["tilt"], "scale": SHAPES["tilt"] + 0.05 * pattern(7)}
    ends = {"tilt": most, "scale": 9.0}
    tried = [
        replace(c, parameters=tuple(replace(p, sensible=(-0.1, ends[c.name])) for p in c.parameters))
        for c in made(*shapes)
    ]
    decision = decide(Linear(noise() + 0.8 * SHAPES["tilt"], shapes), tried, 0, generics=no_generics)
    assert list(sizes(decision)) == ["scale"] and rivals(decision, "scale") == equals


@pytest.mark.parametrize("most", [0.75, 0.3])
def test_no_effect_takes_a_name_at_a_size_that_is_not_its_best(most):
    shapes = {"tilt": SHAPES["tilt"], "scale": SHAPES["tilt"] + 0.05 * pattern(7)}
    tried = [
        replace(c, parameters=tuple(replace(p, sensible=(-0.1, most)) for p in c.parameters)) for c in made(*shapes)
    ]
    decision = decide(Linear(noise() + 0.8 * SHAPES["tilt"], shapes), tried, 0, generics=no_generics)
    ((name, size),) = sizes(decision).items()
    assert size == pytest.approx(0.8, abs=0.02) and {name, *rivals(decision, name)} == {"tilt", "scale"}


def test_each_of_two_named_effects_has_its_own_rivals():
    like = SHAPES["lag"] + 0.1 * pattern(7)
    decision = decided(noise() + 0.8 * SHAPES["tilt"] + 0.8 * SHAPES["lag"], SHAPES | {"delay": like})
    (late,) = set(sizes(decision)) - {"tilt"}
    assert rivals(decision, "tilt") == [] and {late, *rivals(decision, late)} == {"lag", "delay"}


def test_a_look_alike_of_a_small_effect_is_ruled_out_whatever_a_large_one_explains():
    like = SHAPES["lag"] + 0.4 * pattern(7)
    decision = decided(noise() + 20.0 * SHAPES["tilt"] + 0.8 * SHAPES["lag"], SHAPES | {"delay": like})
    assert sizes(decision).keys() == {"tilt", "lag"} and rivals(decision, "lag") == []


# ------------------------------------------------------------------------------------------------ generic disagreements


def test_a_generic_disagreement_that_explains_more_makes_the_verdict_unknown():
    nearest = pattern(21) + 0.7 * pattern(7)
    generics = generics_of("time", pattern(21))
    decision = decided(noise() + 0.8 * pattern(21), SHAPES | {"near": nearest}, generics=generics)
    assert decision.named is None and decision.unknown[0].driver == "time" and decision.unknown[1] > 100.0
    assert decision.nearest[0].name == "near" and decision.nearest[1] < decision.unknown[1]
    instead = decision.with_effects(decision.further[0])  # as if the disagreement did not matter
    assert list(sizes(instead)) == ["near"] and instead.unknown is None and instead.left_over.is_more


def test_a_generic_disagreement_that_explains_no_more_leaves_the_name():
    decision = decided(noise() + 0.8 * SHAPES["tilt"], generics=generics_of("time", SHAPES["tilt"]))
    assert list(sizes(decision)) == ["tilt"] and decision.unknown is None


@pytest.mark.parametrize("size", [0.25, 0.6])
def test_a_generic_disagreement_beside_a_named_effect_is_left_over(size):
    decision = decided(noise() + 0.8 * SHAPES["tilt"] + size * pattern(21), generics=generics_of("time", pattern(21)))
    assert list(sizes(decision)) == ["tilt"] and decision.unknown is None
    assert decision.left_over.candidate.name == "time" and decision.left_over.p_value < 0.01
    assert decision.left_over.is_more


def test_a_generic_disagreement_that_is_a_flaw_of_the_named_effect_is_no_more():
    flaw = SHAPES["tilt"] * SHAPES["lag"]
    runs = Linear(noise() + 20.0 * SHAPES["tilt"] + 0.6 * flaw, {"tilt": SHAPES["tilt"]})
    object.__setattr__(runs, "modulations", lambda: [streams(SHAPES["lag"])])
    decision = decide(runs, made("tilt"), 0, generics=generics_of("time", flaw))
    assert decision.left_over.candidate.name == "time" and not decision.left_over.is_more


def test_several_effects_resolve_a_disagreement_that_each_of_them_explains_less_well():
    both = SHAPES["tilt"] + SHAPES["lag"]
    decision = decided(noise() + 0.8 * both, generics=generics_of("time", both + 0.2 * pattern(17)))
    assert set(sizes(decision)) == {"tilt", "lag"} and decision.unknown is None
    assert decision.otherwise.named is None and decision.otherwise.unknown[0].driver == "time"


def test_effects_that_only_come_near_together_leave_it_unknown():
    truth = pattern(21) + 0.7 * SHAPES["tilt"] + 0.5 * SHAPES["lag"]
    decision = decided(noise() + 0.8 * truth, generics=generics_of("time", truth))
    assert decision.named is None and decision.unknown[0].driver == "time"


def test_a_rival_may_look_alike_only_beside_another_effect_of_another_size():
    camera, track = 0.3 * SHAPES["tilt"], SHAPES["lag"]
    shapes = {"camera": camera, "track": track, "radius": camera + track}
    survey_at, before = forced(noise() + 3.0 * camera + 1.5 * track, ("camera", "track"), shapes)
    decision = with_rivals(pruned(survey_at, before))
    assert sizes(decision).keys() == {"camera", "track"} and rivals(decision, "camera") == ["radius"]


# ------------------------------------------------------------------------------- what is left over, what is superfluous

GREAT, SMALL = 4.0 * SHAPES["tilt"], 0.6 * SHAPES["lag"]


def test_an_effect_that_is_small_beside_the_first_is_named():
    assert set(sizes(decided(noise() + GREAT + SMALL))) == {"tilt", "lag"}


def test_an_effect_that_is_too_small_to_be_named_is_left_over():
    decision = decided(noise() + 0.8 * SHAPES["tilt"] + 0.14 * SHAPES["lag"])
    assert list(sizes(decision)) == ["tilt"] and decision.left_over.gain < LEAST_FURTHER
    assert decision.left_over.candidate.name == "lag" and not decision.left_over.is_more


def test_a_flaw_of_its_form_is_no_further_effect():
    """What goes with the first effect times another signal is a few per cent of it, or an effect of its own."""
    flawed = SimpleNamespace(by=SHAPES["tilt"] * SHAPES["lag"])  # times tilt: lag
    for size, named in ((0.3, ["tilt"]), (1.5, ["tilt", "lag"])):
        runs = Linear(noise() + 10.0 * SHAPES["tilt"] + size * SHAPES["lag"], SHAPES)
        object.__setattr__(runs, "modulations", lambda: [streams(flawed.by)])
        assert list(sizes(decide(runs, made(*SHAPES), 0, generics=no_generics))) == named


def test_noise_is_not_left_over():
    decision = decided(noise() + GREAT)
    assert left_over(decision, 0, shown_at(decision.end, 0)) is None


def forced(measured, names, shapes):
    """`pruned`'s arguments, for a Decision that names these effects whether or not they are needed."""
    survey_at = partial(survey, Linear(measured, shapes), candidates=made(*shapes), generics=no_generics)
    start = survey_at({})
    point = {c: [0.1] for c in start.screen.candidates if c.name in names}
    end = survey_at(point, near=True)
    return partial(survey_at, near=True), Decision(None, start, end, fit(end.likelihood, point))


def test_an_effect_that_later_ones_make_superfluous_is_taken_away():
    mixed, messages = SHAPES["tilt"] + SHAPES["lag"] + 0.7 * pattern(17), []
    shapes = SHAPES | {"mixed": mixed}
    runs = Linear(noise() + SHAPES["tilt"] + 0.8 * SHAPES["lag"], shapes)
    decision = decide(runs, made(*shapes), 0, messages.append, no_generics)
    assert any("mixed, tilt, lag" in message for message in messages)
    assert sizes(decision) == {"tilt": pytest.approx(1.0, abs=0.1), "lag": pytest.approx(0.8, abs=0.1)}
    assert set(gains(decision)) == {"tilt", "lag"}


def test_one_effect_that_does_as_well_as_all_named_takes_their_place():
    mixed = SHAPES["tilt"] + SHAPES["lag"]
    decision = pruned(*forced(noise() + 0.8 * mixed, ("tilt", "lag"), SHAPES | {"mixed": mixed}))
    assert sizes(decision) == {"mixed": pytest.approx(0.8, abs=0.15)}
    assert gains(decision) == {"mixed": decision.total_gain}


def test_what_is_left_beside_fewer_effects_is_measured_from_their_fit():
    mixed = SHAPES["tilt"] + SHAPES["lag"]
    decision = pruned(*forced(noise() + 0.8 * mixed, ("tilt", "lag"), SHAPES | {"mixed": mixed}))
    assert decision.end.point == decision.named.point
    assert decision.end.likelihood.deviance(decision.end.w) == pytest.approx(decision.named.deviance, rel=1e-12)


def test_two_effects_that_do_as_well_as_three_take_their_place():
    gain, track, one, other = SHAPES["tilt"], SHAPES["lag"], pattern(17), pattern(19)
    shapes = {"gain": gain, "track": track, "a": gain + one, "b": track + other, "c": -one - other}
    decision = pruned(*forced(noise() + 0.8 * (gain + track), ("a", "b", "c"), shapes))
    assert sizes(decision) == {"gain": pytest.approx(0.8, abs=0.15), "track": pytest.approx(0.8, abs=0.15)}


def test_effects_that_are_all_needed_stay():
    measured = noise() + SHAPES["tilt"] + 0.7 * SHAPES["lag"]
    survey_at, before = forced(measured, ("tilt", "lag"), SHAPES)
    assert sizes(pruned(survey_at, before)) == sizes(before)


def test_the_only_effect_stays_however_small():
    decision = decided(noise() + 0.12 * SHAPES["tilt"] + 0.08 * SHAPES["tilt"])
    small = next(d for d in (decided(noise() + size * SHAPES["tilt"]) for size in (0.14, 0.16, 0.18, 0.2)) if d.named)
    assert small.total_gain < LEAST_FURTHER < decision.total_gain and sizes(small).keys() == {"tilt"}


def test_an_effect_that_explains_nothing_under_the_noise_that_it_leaves_is_not_named():
    decision = decided(noise() + 0.8 * SHAPES["tilt"])
    decision.total_gain = 1.9  # as where the first alarm came from noise that it had swallowed
    assert pruned(None, decision).named is None
    decision.total_gain = 2.1
    assert sizes(pruned(None, decision)).keys() == {"tilt"}


@pytest.mark.parametrize(("deviance", "names"), [(50.0, ["leader", "near"]), (5.0, ["leader", "small", "near"])])
def test_only_what_comes_near_in_gain_or_fits_better_is_followed(monkeypatch, deviance, names):
    def proposal(name, gain, deviance):
        fitted = SimpleNamespace(point=name, deviance=deviance)
        return SimpleNamespace(penalised_gain=gain, candidate=made(name)[0], fit=fitted)

    leader, near = proposal("leader", 100.0, 10.0), proposal("near", 60.0, 20.0)
    small = proposal("small", 20.0, deviance)
    followed = []

    def settled(view, point):
        followed.append(point)
        return None, SimpleNamespace(point=point)

    monkeypatch.setattr(module, "fit_with_noise", settled)
    monkeypatch.setattr(module, "fit", lambda likelihood, point, iterations: SimpleNamespace(deviance=len(point)))
    best = module._best_near(SimpleNamespace(view=None), [small, near, leader], leader)
    assert followed == names and best.point == "near"
