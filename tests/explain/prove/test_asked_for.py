"""An effect is asked for if it leads nearer to runs that it was not fitted to."""

from types import SimpleNamespace

import pytest

from drake_ispace.explain.fit.candidates import candidates
from drake_ispace.explain.predict.case import prepare
from drake_ispace.explain.prove.asked_for import asked_for
from drake_ispace.explain.prove.errors.free_run import RPE, WHEELS, Measure, errors, windows_of
from drake_ispace.explain.prove.errors.least_squares import plain_fit
from drake_ispace.explain.prove.prove import _alone_tells
from hidden import two_wheels

RADIUS, RADII, TRACK = "wheel_radius_error", "wheel_radius_errors", "track_error"


def asked(further, name=RADIUS, straight=(), alone=(), **hidden):
    """What is asked for where an effect is named, radii of both wheels are its rival, and `further` stands by.

    straight: numbers of runs without a bend. alone: as of `asked_for`.
    """
    exact = {"left_share": hidden.pop("left_share", 0.0), "late_s": 0.0, "lag_s": 0.0}
    runs = [
        two_wheels.drive(40 + i, 10.0, **exact, others=hidden, rates_rad_s=(0.0, 0.0) if i in straight else (-1.0, 1.0))
        for i in range(3)
    ]
    case = prepare(two_wheels.model(), runs)
    known = {c.name: c for c in candidates(case.effects_to_try, case.replay.body)}
    named, sizes = {known[name]: [0.01]}, {c: [0.01] * len(c.parameters) for c in known.values()}
    decision = SimpleNamespace(
        named=SimpleNamespace(point=named), rivals={known[name]: [SimpleNamespace(candidate=known[RADII])]},
        end=SimpleNamespace(likelihood=SimpleNamespace(sizes=sizes)),
        further=[named | {known[further]: known[further].neutral}],
    )
    windows = [windows_of(case.prediction, i, {}) for i in range(3)]
    floors = dict.fromkeys(errors(case.prediction, 0, windows[0], {}), 1e-3)
    fitted = plain_fit(case.prediction, windows, named, sizes, floors)
    found = asked_for(case.prediction, windows, decision, fitted, floors, alone)
    return found and (found.effect, found.point)


@pytest.mark.slow
def test_wheels_that_differ_take_the_place_of_a_common_radius():
    effect, point = asked(TRACK, left_share=0.02)
    assert effect.name == RADII and [c.name for c in point] == [RADII]
    assert point[effect] == pytest.approx([0.0, 0.02], abs=3e-3)


def test_a_further_effect_stands_beside_the_named_ones():
    effect, point = asked(TRACK, radius_share=0.02, track_share=0.03)
    assert effect.name == TRACK and [c.name for c in point] == [RADIUS, TRACK]


@pytest.mark.slow
def test_a_run_that_alone_tells_a_size_is_passed_over():
    """Of three runs one turns, without which nobody knows the track."""
    effect, point = asked(RADIUS, TRACK, straight=(1, 2), alone=(0,), radius_share=0.02, track_share=0.03)
    assert effect.name == RADIUS and [c.name for c in point] == [TRACK, RADIUS]


def test_no_run_is_passed_over_where_more_is_left_than_sizes_are_unsure_of():
    """However little the sensors leave."""
    measure = Measure(RPE, "5s", "position", "m", WHEELS)
    judged = SimpleNamespace(part=lambda runs, strengths: ({measure: 1e-3}, {measure: 0.01 * strengths["slip"]}))
    told = [_alone_tells(judged, 0, {measure: 0.03}, {"slip": strength}) for strength in (1.0, 10.0)]
    assert told == [True, False]


@pytest.mark.slow
def test_nothing_is_asked_for_where_the_named_effect_is_the_right_one():
    assert asked(TRACK, radius_share=0.02) is None
