"""An answer is proven on runs that its sizes were not fitted to."""

from dataclasses import replace
from types import SimpleNamespace

import pytest

import drake_ispace as di
from drake_ispace.explain.answer.describe import describe, rule_out_rivals
from drake_ispace.explain.decide.decide import decide
from drake_ispace.explain.decide.decision import Rival
from drake_ispace.explain.explain import explain
from drake_ispace.explain.fit.candidates import candidates
from drake_ispace.explain.predict.case import prepare
from drake_ispace.explain.prove.noise.noise import sensor_noise
from drake_ispace.explain.prove.prove import _judged, _unconfirmed, prove
from drake_ispace.hiding import hide
from drake_ispace.scenario import load_scenario
from hidden import two_wheels

LARGE = {"wheel_radius_error": {"share": 0.04}}


@pytest.fixture(scope="module")
def runs():
    return hide("omni_multirate", "omni", LARGE, ["square", "circle", "figure_eight"], 5, 10.0)


@pytest.fixture(scope="module")
def effects():
    return [di.effects()[name] for name in ("wheel_radius_error", "viscous_friction", "camera_latency")]


@pytest.fixture(scope="module")
def proven(runs, effects):
    *training, held_out = runs.values()
    return explain("omni_multirate", training, [held_out], effects)


def row_of(answer, **wanted):
    (row,) = (row for row in answer.gap if all(getattr(row, name) == value for name, value in wanted.items()))
    return row


@pytest.mark.slow
def test_the_size_is_also_found_by_plain_least_squares(proven):
    (effect,) = proven.effects
    assert effect.name == "wheel_radius_error" and proven.verdict == "named" and proven.remainders == []
    size = effect.parameters["share"]
    assert size.estimate == pytest.approx(0.04, rel=0.1) and size.least_squares == pytest.approx(0.04, rel=0.15)


def test_larger_wheels_dead_reckon_a_longer_path(proven):
    row = row_of(proven, runs="held_out", metric="ATE", channel="position", driven_by="wheels")
    assert row.before > 3.0 * row.after and row.closed > 0.95 and row.unit == "m"
    assert proven.proof == "held-out runs" and proven.headline == row


def test_every_channel_has_a_row(proven):
    channels = {row.channel for row in proven.gap if row.runs == "held_out"}
    assert channels == {"position", "heading", *(f"encoder: wheel {i}" for i in range(1, 5))}


def test_what_noise_leaves_is_what_the_right_answer_leaves(proven):
    for row in proven.gap:
        if row.metric != "prediction" and row.driven_by == "wheels":
            assert row.after < 2.0 * (row.sensors**2 + row.chance**2) ** 0.5


def test_without_a_held_out_run_each_run_is_left_out_in_turn(runs, effects):
    answer = explain("omni_multirate", [runs["square"], runs["figure_eight"]], effects=effects[:1])
    row = row_of(answer, runs="held_out", metric="ATE", channel="position", driven_by="wheels")
    assert answer.proof == "leave-one-run-out" and row.closed > 0.9 and answer.verdict == "named"


@pytest.mark.slow
def test_a_single_run_is_cut_into_blocks(runs, effects):
    answer = explain("omni_multirate", runs["figure_eight"], effects=effects)
    assert answer.proof == "blocks of the run" and any(row.runs == "held_out" for row in answer.gap)


def test_what_the_library_lacks_makes_the_answer_incomplete_or_unknown(effects):
    """Two things are hidden, and only one of them may be named."""
    both = LARGE | {"coulomb_friction": {"torque_n_m": 0.02}}
    training, held_out = hide("omni_multirate", "omni", both, ["square", "figure_eight"], 5, 8.0).values()
    answer = explain("omni_multirate", training, [held_out], [effects[0]])
    assert answer.verdict in ("incomplete", "unknown") and answer.remainders
    assert any("encoder" in left.channel or "force" in left.channel for left in answer.remainders)


def test_a_sound_robot_leaves_nothing(effects):
    scenario = load_scenario("omni_multirate")
    training, held_out = hide(scenario, "omni", {}, ["square", "figure_eight"], 5, 10.0).values()
    answer = explain(scenario, training, [held_out], effects)
    assert answer.verdict == "none" and answer.remainders == [] and answer.closed is None


@pytest.fixture(scope="module")
def decided(runs, effects):
    """The case of these runs, and what is decided of it."""
    case = prepare(load_scenario("omni_multirate"), list(runs.values()), [], effects[::2], 160.0)
    return case, decide(case.prediction, candidates(case.effects_to_try, case.replay.body), 0)


@pytest.mark.slow
def test_a_look_alike_that_leaves_more_than_noise_where_the_answer_does_not_is_none(decided):
    """One that leaves as little stays, and so does one that nobody fitted."""
    case, decision = decided
    ((radius, (size,)),) = decision.named.point.items()
    (late,) = (one for one in candidates(case.effects_to_try, case.replay.body) if one.name == "camera_latency")
    alike, unlike = [Rival(radius, 0.0, {radius: [0.99 * size]}), Rival(late, 0.0)], Rival(late, 0.0, {late: [0.05]})
    may_stand = prove(case, decision, 0).may_stand
    assert [may_stand(rival) for rival in (*alike, unlike)] == [True, True, False]
    answer = describe(case, replace(decision, rivals={radius: [*alike, unlike]}))
    assert answer.verdict == "set"
    rule_out_rivals(answer, replace(decision, rivals={radius: [unlike]}), may_stand)
    assert answer.verdict == "named" and answer.effects[0].equivalents == []


@pytest.mark.slow
def test_sizes_that_leave_more_than_noise_are_those_of_least_squares(decided):
    case, decision = decided
    ((radius, (size,)),) = decision.named.point.items()
    half = replace(decision, named=replace(decision.named, point={radius: [0.5 * size]}))
    assert prove(case, decision, 0).sizes == decision.named.point
    proof = prove(case, half, 0)
    assert proof.sizes[radius] == [pytest.approx(0.04, rel=0.05)] and proof.remainders == []


@pytest.mark.slow
def test_an_effect_with_which_unseen_runs_come_no_nearer_is_not_confirmed(decided):
    """So is one of the wrong sign, and none of half the right size, or that training or unseen runs do not show."""
    case, decision = decided
    (radius,) = decision.named.point
    assert prove(case, decision, 0).unconfirmed == []

    def unconfirmed(share, shown, floor=1e-3):
        values = {"wheel_radius_error": {"share": share}}
        judged = _judged(case.prediction, [values] * 3, sensor_noise(case.scenario, case.prediction, 0), 0)
        floors = dict.fromkeys(judged.after[0], floor)
        return _unconfirmed(judged, [slice(0, 3)], SimpleNamespace(shown={radius: [shown]}), floors)

    assert unconfirmed(-0.04, -0.04) == ["wheel_radius_error"]
    assert unconfirmed(-0.04, None) == unconfirmed(0.02, 0.02) == unconfirmed(-0.04, -0.04, 1e3) == []


@pytest.mark.slow
def test_a_run_that_no_camera_saw_takes_no_place_from_the_others():
    blind, seen, held_out = (two_wheels.drive(700 + i, 10.0, 0.03, 0.05, 0.0, in_step=True) for i in range(3))
    blind.channels.pop("kinect")
    some = [di.effects()[name] for name in ("camera_latency", "single_wheel_radius_error")]
    answer = explain(two_wheels.model(), [blind, seen], [held_out], some)
    assert {effect.name for effect in answer.effects} == {effect.card.name for effect in some}
    assert answer.headline.driven_by == "wheels" and answer.headline.closed > 0.9
    assert "no channel kinect in run 1: it is compared in the other runs only" in answer.warnings


@pytest.mark.slow
def test_the_run_without_the_command_that_no_other_run_can_use_then_is_named():
    untold, told = (two_wheels.drive(700 + i, 10.0, 0.0, 0.0, 0.0, in_step=True) for i in range(2))
    untold.channels.pop("command")
    answer = explain(two_wheels.model(), [told, untold], [], [di.effects()["single_wheel_radius_error"]])
    (warning,) = [said for said in answer.warnings if "channel command" in said]
    assert warning.endswith("leave out run 2 to use it")
