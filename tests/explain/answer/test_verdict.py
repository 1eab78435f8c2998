"""The verdict follows from what an answer leaves on unseen runs."""

from dataclasses import replace
from itertools import permutations
from types import SimpleNamespace

import numpy as np
import pytest

import answers
from drake_ispace.effects.library import library
from drake_ispace.explain.answer.explanation import Estimate, Explanation, Unknown
from drake_ispace.explain.answer.verdict import (
    add_chance,
    add_parts,
    add_proof,
    lacks_little,
    led_away,
    left_out,
    nonsense,
)
from drake_ispace.explain.decide.each_part import OfAPart, SizeIn
from drake_ispace.explain.decide.proposals import detect
from drake_ispace.explain.decide.proposals.detect import Detection
from drake_ispace.explain.decide.survey.view import scales_of
from drake_ispace.explain.explain import explain
from drake_ispace.explain.fit.candidates import Candidate
from drake_ispace.explain.predict.case import prepare
from drake_ispace.explain.prove.noise.noise import ProcessNoise
from drake_ispace.explain.prove.proof import Proof
from drake_ispace.robots.library import robots
from drake_ispace.scenario import load_scenario
from hidden.generator import generate

MODEL = load_scenario("omni_multirate")
WORSE = replace(answers.GAP[1], before=0.006, after=0.02, worse=True)


def judged(answer, rows=answers.GAP, remainders=()):
    """The answer, after a proof with these rows and remainders."""
    add_proof(answer, None, Proof("held-out runs", list(rows), list(remainders), None, {}, None))
    return answer


def on_bound(answer):
    """The answer with its size on a bound."""
    (effect,) = answer.effects
    return replace(answer, effects=[
        replace(effect, parameters={"torque_n_m": Estimate(0.01, (0.008, 0.01), "N*m", on_bound=True)})
    ])


@pytest.mark.parametrize(("left", "change", "little"), [
    (20.0, lambda answer: answer, True), (200.0, lambda answer: answer, False), (20.0, on_bound, False),
    (20.0, lambda answer: replace(answer, remainders=[answers.LEFT]), False),
    (20.0, lambda answer: replace(answer, gap=[*answers.GAP, WORSE]), False),
], ids=["little", "much", "bound", "remainder", "worse"])
def test_a_disagreement_smaller_than_every_effect_takes_no_name_away(left, change, little):
    decision = SimpleNamespace(left_over=SimpleNamespace(gain=left), gains={"coulomb_friction": 100.0})
    assert lacks_little(change(answers.named(MODEL, verdict="incomplete")), decision) == little


def test_a_title_does_not_say_that_an_effect_is_missing_where_none_shows():
    shows, hidden = (Detection(p_value, 2.0, 3.0) for p_value in (0.001, 0.2))
    assert "lacks something" in Explanation("unknown", [], shows, [], []).title
    assert "No effect shows" in Explanation("unknown", [], hidden, [], []).title
    assert "lacks nothing" in Explanation("none", [], hidden, [], []).title


@pytest.mark.parametrize(("equivalents", "faults", "said"), [
    ([], [], "coulomb friction: "), (["soft_floor"], [], "either coulomb friction or soft floor: "),
    (["a", "b", "c"], [], "either coulomb friction or a or one of 2 others: "),
    ([], ["coulomb_friction"], "either coulomb friction or a fault of the data: "),
    ([], ["wrong_unit"], "either coulomb friction or wrong unit (a fault of the data): "),
])
def test_a_title_of_a_set_says_what_is_in_doubt(equivalents, faults, said):
    (effect,) = answers.named(MODEL).effects
    answer = Explanation("set", [replace(effect, equivalents=equivalents, faults=faults)], None, [], [])
    assert answer.title == f"The model lacks {said}these runs do not tell which"


def test_a_title_says_first_what_is_sure():
    (effect,) = answers.named(MODEL).effects
    doubtful = replace(effect, name="velocity_delay", faults=["clock_offset"])
    answer = Explanation("set", [doubtful, effect], None, [], [])
    said = "coulomb friction, and either velocity delay or clock offset (a fault of the data)"
    assert answer.title == f"The model lacks {said}: these runs do not tell which"


@pytest.mark.parametrize(("after", "driven_by", "said"), [
    (0.03, "wheels", ["slip at random"]), (0.03, "command", ["a drive that errs at random"]), (0.01, "command", []),
    (0.03, "torque", []),
])
@pytest.mark.parametrize("lacks", [answers.nothing, lambda: answers.named(MODEL)], ids=["none", "named"])
def test_errors_that_pass_as_chance_are_told_beside_what_sensors_leave(after, driven_by, said, lacks):
    of = {"metric": "RPE", "horizon": "5s", "driven_by": driven_by}
    row = replace(answers.GAP[1], before=after, after=after, sensors=0.005, chance=after, **of)
    answer = judged(lacks(), [row])
    add_chance(answer)
    assert [warning.split("such as ")[1] for warning in answer.warnings] == said
    assert all(("still" in warning) == bool(answer.effects) for warning in answer.warnings)


def test_whole_runs_on_the_command_are_led_astray_by_any_drive():
    row = replace(answers.GAP[1], metric="ATE", horizon="run", driven_by="command", after=0.3, sensors=0.005)
    answer = judged(answers.nothing(), [row])
    add_chance(answer)
    assert not answer.warnings


def test_an_answer_that_does_not_suffice_leaves_more_than_chance():
    answer = answers.named(MODEL, verdict="incomplete", gap=[replace(answers.GAP[1], after=0.3, sensors=0.005)])
    add_chance(answer)
    assert not answer.warnings


@pytest.mark.parametrize("strengths, said", [
    ({"force 1": 3.0, "jolt 1": 4.0, "force 3": 2.0}, "0.75 N and 0.04 N m pass as noise, where 0.15 N and 0.02 N m"),
    ({"force 1": 1.0, "slip": 5.0}, ""),
])
def test_forces_that_pass_as_noise_are_told_where_they_are_stronger_than_assumed(strengths, said):
    case = SimpleNamespace(replay=SimpleNamespace(body=SimpleNamespace(robot=robots()["omni"])))
    answer = answers.nothing()
    add_proof(answer, case, Proof("held-out runs", [], [], ProcessNoise(strengths, {}), {}, None))
    add_chance(answer)
    assert [said in warning for warning in answer.warnings] == [True] * bool(said)


def test_a_title_does_not_say_that_nothing_shows_where_a_trace_is_detectable():
    shows = Detection(0.001, 2.0, 3.0)
    assert Explanation("none", [], shows, [], []).title.startswith("Something is detectable")


def free_runs(after_m, driven_by="command", before_m=0.3):
    """The rows of free runs with such an error, where sensors leave 10 mm and process noise as much as there is."""
    return [
        replace(row, driven_by=driven_by, before=before_m, after=after_m, sensors=0.01, chance=after_m)
        for row in answers.GAP[:2]
    ]


@pytest.mark.parametrize(("rows", "remainders", "suffices"), [
    (free_runs(0.012), [], True), (free_runs(0.04), [], False), (free_runs(0.012), [answers.LEFT], False),
    (free_runs(0.012, "torque"), [], False), ([], [], False),
], ids=["as told", "astray", "remainder", "torque", "no run"])
def test_what_is_detectable_does_not_matter_where_a_robot_moves_as_told(rows, remainders, suffices):
    """Noise of its drive would hide whatever is wrong with it: only sensors count."""
    incomplete = answers.named(MODEL, verdict="incomplete")
    assert judged(incomplete, rows, remainders).verdict == ("named" if suffices else "incomplete")
    driver = Unknown("force", "speed", 1.0, "alike in both directions", "none", "from the start", "none", 0.0)
    unknown = judged(Explanation("unknown", [], None, [], [], unknown=driver), rows, remainders)
    assert unknown.verdict == ("none" if suffices else "unknown") and bool(unknown.warnings) == suffices


def test_effects_without_which_a_robot_moves_as_told_as_well_stay_incomplete():
    incomplete = answers.named(MODEL, verdict="incomplete")
    assert judged(incomplete, free_runs(0.012, before_m=0.013)).verdict == "incomplete"


def test_effects_that_leave_noise_keep_their_verdict():
    assert judged(answers.named(MODEL)).verdict == "named"
    assert judged(answers.named(MODEL, verdict="set")).verdict == "set"


@pytest.mark.parametrize("verdict", ["named", "set"])
@pytest.mark.parametrize("change, rows, remainders", [
    (on_bound, answers.GAP, ()), (lambda answer: answer, [*answers.GAP, WORSE], ()),
    (lambda answer: answer, answers.GAP, [answers.LEFT]),
    (lambda answer: replace(answer, drifts=["torque_n_m of coulomb_friction drifts"]), answers.GAP, ()),
], ids=["bound", "worse", "remainder", "drift"])
def test_what_does_not_suffice_is_incomplete(verdict, change, rows, remainders):
    assert judged(change(answers.named(MODEL, verdict=verdict)), rows, remainders).verdict == "incomplete"


def test_the_reasons_are_warnings():
    answer = judged(on_bound(answers.named(MODEL)), [WORSE])
    assert "torque_n_m of coulomb_friction is 0.01 N*m" in answer.warnings[0]
    assert answer.warnings[1].startswith("position (wheels, run) got worse on unseen runs: 0.006 -> 0.02 m")


@pytest.mark.parametrize("change, rows, left_out", [
    (on_bound, [WORSE], {"coulomb_friction"}), (on_bound, answers.GAP, set()),
    (lambda answer: answer, [WORSE], {"coulomb_friction"}), (lambda answer: answer, [WORSE, answers.GAP[0]], set()),
    (lambda answer: answer, [WORSE, replace(WORSE, after=0.001, driven_by="torque", closed=0.9, worse=False)], set()),
    (lambda answer: answer, [replace(WORSE, metric="RPE", horizon="5s")], {"coulomb_friction"}),
    (on_bound, [replace(WORSE, metric="prediction")], set()),
], ids=["both", "bound", "worse", "nearer soon", "nearer otherwise", "worse soon", "sensors"])
def test_what_makes_no_sense_and_leads_further_away_is_nonsense(change, rows, left_out):
    names, why = nonsense(judged(change(answers.named(MODEL)), rows))
    assert names == left_out and (not names or "led further away" in why)


@pytest.mark.parametrize("second, remainders, left_out", [
    (True, [answers.LEFT], {"coulomb_friction", "soft_floor"}), (False, [answers.LEFT], set()), (True, [], set()),
], ids=["all", "one of two", "nothing left"])
def test_several_that_all_make_no_sense_stand_in_for_something_else(second, remainders, left_out):
    answer = on_bound(answers.named(MODEL))
    size = replace(answer.effects[0].parameters["torque_n_m"], on_bound=second)
    answer.effects = [*answer.effects, replace(answer.effects[0], name="soft_floor", parameters={"force_n": size})]
    assert nonsense(judged(answer, remainders=remainders)) == (left_out, "no size of it is plausible")


def test_it_is_said_what_nonsense_is_not_named():
    assert left_out(answers.nothing(), answers.named(MODEL), "why") == (
        "coulomb_friction (torque_n_m 0.01 N*m) explains most from one sample to the next, but why"
    )
    both = answers.named(MODEL)
    both.effects = [*both.effects, replace(both.effects[0], name="soft_floor")]
    assert left_out(answers.named(MODEL), both, "").startswith("soft_floor (torque_n_m 0.01 N*m) explains some ")


def test_nothing_detected_but_more_than_noise_left_is_unknown():
    answer = judged(answers.nothing(), remainders=[answers.LEFT])
    assert answer.verdict == "unknown" and answer.unknown is None and "encoder: wheel 2" in str(answer)


def test_nothing_detected_and_noise_left_is_none():
    assert judged(answers.nothing()).verdict == "none"


def test_an_answer_has_the_rows_of_its_proof():
    answer = judged(answers.named(MODEL), remainders=[answers.LEFT])
    assert (answer.gap, answer.proof, answer.remainders) == (answers.GAP, "held-out runs", [answers.LEFT])


def test_an_effect_of_one_run_is_told_with_the_run_and_one_of_several_with_each_ones_size():
    effect = library()["camera_latency"]
    late = Candidate(effect, (), effect.parameters)
    (parameter,) = late.parameters
    sizes = tuple(SizeIn(f"run {i + 1}", parameter, 0.13 - 0.05 * i, i < 2) for i in range(3))
    one, same = (OfAPart(run, late, [0.12], p, [], sizes) for run, p in (("run 2", 1e-9), ("run 1", 1e-7)))
    alone, several = answers.nothing(), answers.nothing()
    add_parts(alone, [replace(one, sizes=())])
    add_parts(several, [one, same])
    assert alone.drifts == [
        "run 2 by itself is explained best by camera_latency (latency_s 0.12 s; p = 1e-09), and other runs "
        "contradict it: explain it by itself"
    ]
    assert several.drifts == [
        "camera_latency shows in run 1 (latency_s 0.13 s; p = 1e-07) and run 2 (latency_s 0.08 s; p = 1e-09), not for "
        "certain in run 3 (latency_s 0.03 s): its size differs from run to run, something else goes with it"
    ]
    assert alone.verdict == several.verdict == "unknown"


def test_two_names_of_what_several_runs_show_are_told_once():
    late, behind = (
        Candidate(library()[name], (), library()[name].parameters) for name in ("camera_latency", "clock_offset")
    )

    def shown(run, name, *others):
        sizes = tuple(SizeIn(f"run {i}", name.parameters[0], 0.1, True) for i in (1, 2))
        return OfAPart(run, name, [0.1], 1e-9, list(others), sizes)

    for parts in permutations([shown("run 1", late), shown("run 2", behind, late)]):
        answer = answers.nothing()
        add_parts(answer, parts)
        (told,) = answer.drifts
        assert {"camera_latency", "clock_offset"} == set(told.split(" shows in ")[0].split(" or "))
        assert told.count("p = 1e-09") == 2 and "run 1 (" in told and "run 2 (" in told


@pytest.mark.slow
def test_a_size_that_differs_from_run_to_run_is_told():
    sizes = {"square": 0.006, "eight": 0.014}
    runs = [
        generate("omni", motion, {"coulomb_friction": {"torque_n_m": size}}, 10.0, 60 + i)
        for i, (motion, size) in enumerate(sizes.items())
    ]
    answer = explain("omni_multirate", runs, effects=[library()["coulomb_friction"]])
    assert answer.verdict == "incomplete" and "drifts between runs" in answer.drifts[0], answer


@pytest.mark.slow
def test_a_size_that_fades_in_every_run_is_told():
    runs = [
        generate("omni", motion, {}, 12.0, 60 + i, unknown=("motor_warm_up", 0.02))
        for i, motion in enumerate(("square", "eight", "circle"))
    ]
    answer = explain("omni_multirate", runs, effects=[library()["coulomb_friction"]])
    assert answer.verdict == "incomplete" and "drifts between the halves of runs" in answer.drifts[0], answer


@pytest.mark.slow
@pytest.mark.parametrize("drag, verdict", [(1.5e-5, "none"), pytest.param(1.5e-4, "named", marks=pytest.mark.slow)],
                         ids=["trace", "effect"])
def test_an_alarm_in_doubt_must_show_on_unseen_runs(monkeypatch, drag, verdict):
    monkeypatch.setattr(detect, "CLEAR_MINUS_LOG10_P", np.inf)  # every alarm is in doubt
    runs = [
        generate("omni", motion, {"wheel_drag": {"coefficient_n_m_s2": drag}}, 9.0, 60 + i)
        for i, motion in enumerate(("square", "eight", "circle"))
    ]
    answer = explain("omni_multirate", runs, effects=[library()["wheel_drag"]])
    assert answer.detection.p_value < 1e-3
    assert answer.verdict == verdict
    assert any("trace of wheel_drag" in warning for warning in answer.warnings) == (verdict == "none")


@pytest.mark.parametrize(("tolerances", "verdict"), [(0.9, "incomplete"), (1.5, "named")])
def test_a_size_that_a_sound_robot_may_have_is_not_what_was_detected(tolerances, verdict):
    friction, run = library()["coulomb_friction"], generate("omni", "square", {}, 4.0, 5)
    case = prepare(MODEL, [run], effects=[friction])
    (size, *_) = friction.parameters_of(case.replay.body)
    one = tolerances * size.tolerance * scales_of(case.prediction)["torque"]
    answer = proved(case, friction, one, (0.5 * one, 1.5 * one))
    assert answer.verdict == verdict and ("sound robot" in " ".join(answer.warnings)) == (verdict == "incomplete")


@pytest.mark.parametrize(("name", "least", "least_squares", "verdict"), [
    ("coulomb_friction", -0.001, 0.02, "incomplete"), ("coulomb_friction", 0.001, 0.02, "named"),
    ("coulomb_friction", 0.001, -0.01, "named"), ("wheel_radius_error", 0.001, -0.01, "incomplete"),
])
def test_an_effect_that_may_have_no_size_is_not_what_was_detected(name, least, least_squares, verdict):
    """The path tells the size of a wheel, and says nothing of a friction."""
    case = prepare(MODEL, [generate("omni", "square", {}, 4.0, 5)], effects=[library()[name]])
    answer = proved(case, library()[name], 0.02, (least, 0.05), least_squares)
    assert answer.verdict == verdict and ("may be none" in " ".join(answer.warnings)) == (verdict == "incomplete")


def proved(case, one, size, ci90, least_squares=None):
    """The answer that names an effect of that size and interval, and leaves nothing."""
    answer = answers.named(MODEL)
    (effect,) = answer.effects
    name = one.parameters_of(case.replay.body)[0].name
    estimate = Estimate(size, ci90, "N*m", least_squares=least_squares)
    answer.effects = [replace(effect, name=one.card.name, parameters={name: estimate})]
    add_proof(answer, case, Proof("held-out runs", answers.GAP, [], None, {one: [size]}, None))
    return answer


def whole_runs(runs, before, after, least_squares):
    """A row of simulations of whole runs."""
    row = replace(answers.GAP[1], runs=runs, unit="rad", before=before)
    return replace(row, after=after, least_squares=least_squares)


@pytest.mark.parametrize(("rows", "away"), [
    ([whole_runs("held_out", 6.0, 12.0, 12.0), whole_runs("training", 8.5, 27.5, 27.5)], True),
    ([whole_runs("held_out", 6.0, 12.0, 12.0), whole_runs("training", 8.5, 7.5, 27.5)], False),
    ([whole_runs("held_out", 6.0, 12.0, 5.0), whole_runs("training", 8.5, 27.5, 27.5)], False),
    ([whole_runs("held_out", 6.0, 12.0, 12.0)], False),
], ids=["all", "seen ones nearer", "by least squares nearer", "no others"])
def test_an_own_plant_is_led_away_if_no_whole_run_comes_nearer(rows, away):
    assert ("12 rad instead of 6 rad" in led_away(rows)) == away
