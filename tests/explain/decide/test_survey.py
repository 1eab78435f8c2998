"""Score tests by hand, of signatures of two numbers, and shapes of generic disagreements on made-up motions."""

import importlib
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.stats import chi2

from drake_ispace.blocks.rates import TICK_S
from drake_ispace.effects.card import Parameter
from drake_ispace.explain.decide.proposals.detect import detect, trials
from drake_ispace.explain.decide.survey.generic import Motion, _cells, _is_motion, _losses, _travelled, motion_of
from drake_ispace.explain.decide.survey.screen import Screen
from drake_ispace.explain.decide.survey.signatures import Signature, difference, is_finite, signatures
from drake_ispace.explain.decide.survey.survey import (
    blocks_of,
    expected_to_stay,
    fit_with_noise,
    survey,
    with_memory_marginalised,
    with_noise_of_nothing_more,
    with_past_speeds,
)
from drake_ispace.explain.decide.survey.view import _changes_by_sizes, scales_of
from drake_ispace.explain.fit.candidates import Candidate
from drake_ispace.explain.predict.prediction import past_speeds
from drake_ispace.plants.wheels import differential, omni3
from stand_ins.linear import ROWS, RUNS, Linear, made, no_generics, noise, pattern, streams, wave

WHEELS = omni3(0.05, 0.2)


def screen_of(candidate, *changes, at=(), one_sided=()):
    """A Screen of whitened changes (rows,) by the parameters `at` of one candidate, and the products with `w`."""
    at, one_sided = at or [0] * len(changes), one_sided or [False] * len(changes)
    found = [
        Signature(candidate, [1.0] * len(candidate.parameters), i, only, change)
        for change, i, only in zip(changes, at, one_sided, strict=True)
    ]
    changes = np.array(changes)
    return Screen(found, changes @ changes.T), lambda *w: changes @ np.array(w)


def two_parameters():
    (one,) = made("slip")
    return Candidate(one.effect, (), (*one.parameters, Parameter("more", "", low=-100.0, high=100.0, probes=(1.0,))))


# -- Scores


def test_two_parameters_that_are_both_there_say_more_together():
    screen, products = screen_of(two_parameters(), [3.0, 0.0], [0.0, 3.0], at=[0, 1])
    both = screen.minus_log10_p(products(5.0, 5.0))
    assert both == pytest.approx([-chi2.logsf(50.0, 2) / np.log(10.0)])
    one = screen.minus_log10_p(products(5.0, 0.0))
    assert one == pytest.approx([-chi2.logsf(25.0, 1) / np.log(10.0)])


def test_what_two_parameters_can_make_together_is_alike():
    candidate = two_parameters()
    other = Candidate(candidate.effect, (("wheel", 2),), candidate.parameters[:1])
    found = [Signature(candidate, [1.0, 1.0], i, False, None) for i in (0, 1)]
    changes = np.array([[3.0, 0.0, 0.0], [0.0, 3.0, 0.0], [2.0, 2.0, 1.0]])
    screen = Screen([*found, Signature(other, [1.0], 0, False, None)], changes @ changes.T)
    assert screen.alike(candidate, other) == screen.alike(other, candidate) == pytest.approx(np.sqrt(8.0 / 9.0))


def test_what_a_third_effect_of_another_size_makes_up_for_is_alike():
    camera, track, radius = made("camera", "track", "radius")
    changes = np.array([[3.0, 0.0], [0.0, 9.0], [3.0, 9.0]])
    screen = Screen([Signature(c, [1.0], 0, False, None) for c in (camera, track, radius)], changes @ changes.T)
    assert screen.alike(camera, radius) == pytest.approx(np.sqrt(0.1))
    assert screen.alike(camera, radius, [track]) == pytest.approx(1.0)
    assert screen.alike(camera, track, [radius]) == pytest.approx(1.0)
    assert screen.alike(camera, track, [camera]) == 0.0


def test_how_far_a_third_effect_is_from_linear_makes_up_for_nothing():
    marker, camera, slip = made("marker", "camera", "slip")
    found = [Signature(marker, [z], 0, False, None) for z in (1.0, -1.0)]
    found += [Signature(c, [1.0], 0, False, None) for c in (camera, slip)]
    changes = np.array([[9.0, 0.0, 0.0], [-9.0, 0.3, 0.0], [0.0, 3.0, 0.3], [0.0, 3.0, 0.0]])
    screen = Screen(found, changes @ changes.T)
    assert screen.alike(camera, slip, [marker]) == pytest.approx(1.0, abs=0.01)


def test_the_sets_that_explain_most_together_come_first():
    one, two, three = candidates = made("one", "two", "three")
    changes = np.array([[5.0, 0.0, 0.0], [0.0, 5.0, 0.0], [4.0, 4.0, 1.0]])
    screen = Screen([Signature(c, [1.0], 0, False, None) for c in candidates], changes @ changes.T)
    products = changes @ np.array([1.0, 1.0, 0.0])
    assert screen.sets_of(candidates, 1, products)[0] == [three]
    assert screen.sets_of(candidates, 2, products)[0] == [one, two]
    assert {frozenset(some) for some in screen.sets_of(candidates, 2, products)} == {
        frozenset(some) for some in ([one, two], [one, three], [two, three])
    }
    assert screen.sets_of(candidates, 4, products) == []


def test_the_largest_over_all_candidates_is_that_of_the_one_that_has_it():
    candidate, products = two_parameters(), np.array([[5.0, 0.0, 1.0], [5.0, 4.0, -1.0], [2.0, 6.0, 0.5]])
    other = Candidate(candidate.effect, (("wheel", 2),), candidate.parameters[:1])
    found = [Signature(candidate, [1.0, 1.0], i, False, None) for i in (0, 1)]
    screen = Screen([*found, Signature(other, [1.0], 0, False, None)], np.eye(3))
    np.testing.assert_allclose(screen.largest(products), screen.minus_log10_p(products).max(axis=0), rtol=1e-12)


def test_what_only_shapes_an_effect_has_no_signature():
    (cause,) = made("slip")
    shape = Parameter("where", "m", low=-1.0, high=1.0, probes=(0.1,), shape=True)
    local = Candidate(cause.effect, (), (*cause.parameters, shape))
    prediction = Linear(pattern(0), {"slip": pattern(1)})
    (found,) = signatures(prediction, {}, [local], {}, prediction.residuals({}))
    assert found.at == 0 and found.z == [1.0, 0.0]


def test_two_probes_of_one_parameter_are_no_two_parameters():
    (candidate,) = made("slip")
    screen, products = screen_of(candidate, [3.0, 0.0], [0.0, 3.0])
    assert screen.minus_log10_p(products(5.0, 5.0)) == pytest.approx([-chi2.logsf(25.0, 1) / np.log(10.0)])


def test_a_signature_that_the_runs_do_not_show_gains_nothing():
    (candidate,) = made("slip")
    screen, products = screen_of(candidate, [0.5, 0.0], [0.0, 2.0])
    assert list(screen.gains(products(5.0, 5.0))) == [0.0, 25.0]
    amounts, changes = screen.use_of(candidate.effect, products(5.0, 5.0))
    assert amounts == pytest.approx([2.5]) and changes == [screen.signatures[1].change]


def test_neither_does_one_of_the_impossible_sign():
    (candidate,) = made("slip")
    screen, products = screen_of(candidate, [2.0, 0.0], [0.5, 0.0], [0.0, 2.0], one_sided=[True, True, True])
    assert list(screen.gains(products(-5.0, 5.0))) == [0.0, 0.0, 25.0]


# -- Changes around a point


def test_scales_are_those_of_torques_and_of_the_speed_of_the_wheels():
    angles = TICK_S * np.cumsum(np.repeat([1.0, -7.0], 200))[:, None]
    track = SimpleNamespace(ticks=400, command=np.full((400, 1), 0.3), measured=angles)
    prediction = SimpleNamespace(replay=SimpleNamespace(body=SimpleNamespace(wheels=1)), tracks=[track])
    assert scales_of(prediction) == {
        "torque": pytest.approx(0.3), "1/torque": pytest.approx(1 / 0.3), "speed": pytest.approx(5.0, rel=0.02),
        "torque/speed": pytest.approx(0.06, rel=0.02), "top speed": pytest.approx(7.0),
    }


@pytest.mark.parametrize("at, tried", [(10.0, 12.0), (95.0, 76.0), (100.0, 80.0), (-100.0, -80.0)])
def test_a_size_is_changed_within_its_bounds(at, tried):
    (candidate,), asked = made("slip"), []

    def residuals(values):
        asked.append(values["slip"]["size"])
        return streams(np.zeros((RUNS, ROWS)))

    base = streams(np.ones((RUNS, ROWS)))
    _changes_by_sizes(SimpleNamespace(residuals=residuals), {candidate: [at]}, {candidate: [1.0]}, base)
    assert asked == [pytest.approx(tried)]


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("far", [1e50, np.inf, np.nan])
def test_a_model_that_runs_away_changes_nothing_that_could_be_tested(far):
    base, away = streams(np.zeros((RUNS, ROWS))), streams(np.full((RUNS, ROWS), far))
    assert not is_finite(difference(base, away)) and is_finite(difference(base, base))


def test_the_memory_of_the_noise_is_marginalised_near_the_best_point():
    slow = lfilter([1.0], [1.0, -0.9], np.random.default_rng(1).standard_normal((RUNS, ROWS)))
    far = survey(Linear(slow, {"slip": pattern(3)}), {}, made("slip"), generics=no_generics)
    assert not far.likelihood.memory and with_memory_marginalised(far).likelihood.memory


def test_past_speeds_choose_the_moments_and_leave_all_else():
    asked = []

    class Watched(Linear):
        def classes(self, values, speeds=None):
            asked.append(speeds)
            return super().classes(values, speeds)

    noise = np.random.default_rng(1).standard_normal((RUNS, ROWS))
    far = survey(Watched(noise, {"slip": pattern(3)}), {}, made("slip"), generics=no_generics)
    again, own = with_past_speeds(far), with_noise_of_nothing_more(far)
    assert asked == [None, past_speeds, None] and not again.likelihood.memory
    assert again.minus_log10_p == pytest.approx(own.minus_log10_p)  # here all moments are scored, whatever the speeds


def test_slow_noise_that_effects_together_explain_is_noise_if_nothing_is_missing():
    slow = lfilter([1.0], [1.0, -0.97], np.random.default_rng(1).standard_normal((RUNS, ROWS)))
    of_run = [wave(0.5 * cycles) * (np.arange(RUNS) == run)[:, None] for run in range(RUNS) for cycles in range(1, 30)]
    shapes = {f"wave_{i}": shape for i, shape in enumerate(of_run)}
    far = survey(Linear(slow, shapes), {}, made(*shapes), generics=no_generics)
    own = with_noise_of_nothing_more(far)
    gains, own_gains = (one.screen.gains(one.products).mean() for one in (far, own))
    assert gains > 2.0 and own_gains == pytest.approx(1.0, abs=0.5)


# -- Generic disagreements


def motion(x, y, speed=0.0):
    n = len(x)
    return Motion(
        np.column_stack([np.full(n, speed), np.zeros(n), np.zeros(n)]), np.column_stack([x, y, np.zeros(n)]),
        np.arange(n) * TICK_S, *np.zeros((3, n, 2)),
    )


@pytest.mark.parametrize(("axes", "moves"), [(slice(2), True), (slice(2, 3), False)])
def test_rounding_of_encoders_is_no_motion(axes, moves):
    """Two wheels that turn alike, each rounded by itself: the robot goes straight on."""
    count, t = 0.01, np.arange(4000) * TICK_S
    angles = count * np.floor((2.0 + np.sin(t)).cumsum()[:, None] * TICK_S / count + [0.0, 0.37])
    plant = SimpleNamespace(geometry=differential(0.05, 0.15))
    track = SimpleNamespace(turned=angles, fix_t=[], since_s=0.0, command=None)
    prediction = SimpleNamespace(replay=SimpleNamespace(body=SimpleNamespace(wheels=2, plant=plant)), tracks=[track])
    past, around = motion_of(prediction, track, past_speeds), motion_of(prediction, track)
    assert _is_motion([past], [around], axes) == moves


@pytest.mark.parametrize(("told", "resisted"), [((0.0, 0.0, 1.0), "drag_of_spin"), ((0.4, 0.0, 0.0), "drag_of_speed")])
def test_a_drive_that_errs_sideways_of_what_it_was_told_meets_no_resistance_there(monkeypatch, told, resisted):
    shapes = importlib.import_module("drake_ispace.explain.decide.survey.generic")
    told = np.tile(told, (4000, 1))
    errs = replace(motion(told[:, 0], told[:, 2]), body=told + 0.01, command=told)
    robot = SimpleNamespace(
        driven=shapes.COMMAND, in_room=True, force_of_command=lambda plant: np.ones(3), ground_force=np.array,
    )
    prediction = SimpleNamespace(tracks=[errs], replay=SimpleNamespace(body=SimpleNamespace(robot=robot, plant=None)))
    monkeypatch.setattr(shapes, "motion_of", lambda prediction, track: track)
    found = [generic.name for generic, _ in shapes._forces(prediction, [errs])]
    assert [name for name in found if name.startswith("drag")] == [f"{resisted}_squared"]


def test_the_visited_area_is_parted_into_nine_equal_cells():
    x, y = (a.ravel() for a in np.meshgrid(np.linspace(-1.0, 2.0, 60), np.linspace(0.0, 1.0, 60)))
    cells = np.array([cell[0] for cell in _cells([motion(x, y)])])
    assert cells.shape == (9, 3600) and (cells.sum(axis=0) == 1.0).all() and (cells.sum(axis=1) == 400).all()
    left_below = (x < -0.01) & (y < 0.33)
    assert (cells[0] == left_below).mean() > 0.99


def test_a_run_whose_place_nobody_knows_is_in_no_cell_and_moves_no_border_of_one():
    x, y = (a.ravel() for a in np.meshgrid(np.linspace(1.0, 4.0, 60), np.linspace(2.0, 3.0, 60)))
    anywhere = replace(motion(np.zeros(3600), np.zeros(3600)), is_placed=False)
    cells = np.array(_cells([motion(x, y), anywhere]))
    assert not cells[:, 1].any() and (cells[:, 0].sum(axis=1) == 400).all()


def test_slip_of_a_patch_turns_nothing_and_stops_outside_of_it():
    x, y = (a.ravel() for a in np.meshgrid(np.linspace(0.0, 3.0, 60), np.linspace(0.0, 1.0, 60)))
    losses = _losses(WHEELS, [motion(x, y, 0.5)])
    patches = next(columns for generic, columns in losses if generic.name == "slip_of_a_patch")
    cell = _cells([motion(x, y)])[0][0]
    displaced = patches[0][0]
    assert not displaced[:, 1:].any()
    moves = np.diff(displaced[:, 0], prepend=0.0)
    assert moves == pytest.approx(-0.05 * 0.5 * TICK_S * cell, abs=1e-12)


def test_a_way_that_is_turned_is_that_of_a_robot_that_turns_otherwise():
    """Also by a large angle: the model's way is the true one less what is added."""
    t = np.arange(4000) * TICK_S
    body = np.column_stack([0.4 + 0.2 * np.sin(t), 0.1 * np.cos(2.0 * t), 0.8 * np.sin(0.7 * t)])
    extra = 0.1 * np.cos(t)  # rad/s

    def way(turning):
        phi = np.cumsum(turning) * TICK_S
        c, s = np.cos(phi), np.sin(phi)
        velocity = np.column_stack([c * body[:, 0] - s * body[:, 1], s * body[:, 0] + c * body[:, 1]])
        return np.column_stack([np.cumsum(velocity, axis=0) * TICK_S, phi])

    true = way(body[:, 2] + extra)
    added = _travelled(Motion(body, true, t, *np.zeros((3, 4000, 2))), 0.0, 0.0, extra)
    assert np.abs(added[:, 2]).max() > 0.09 and np.abs(added[:, :2]).max() > 0.1
    np.testing.assert_allclose(true - added, way(body[:, 2]), atol=1e-9)


def test_only_a_robot_that_moves_sideways_may_slip_by_the_direction():
    def has(wheels):
        still = np.zeros((3, 400, len(wheels.wheels)))
        driven = replace(motion(np.zeros(400), np.zeros(400), 0.5), angles=still[0], rates=still[1], command=still[2])
        return {generic.name for generic, _ in _losses(wheels, [driven])}

    more = {f"radius_of_wheel_{i}_in_time" for i in range(3, len(WHEELS.wheels) + 1)}
    assert has(WHEELS) - has(differential(0.05, 0.2)) == {"slip_of_direction", *more}


def test_a_wheel_whose_radius_shrinks_turns_the_robot_the_more_the_later():
    wheels, t = differential(0.05, 0.2), np.arange(4000) * TICK_S
    rates = np.column_stack([np.full(4000, 4.0), np.full(4000, 4.0)])
    straight = Motion(rates @ wheels.forward.T, np.zeros((4000, 3)), t, rates * t[:, None], rates, rates)
    found = {generic.name: (generic, columns) for generic, columns in _losses(wheels, [straight])}
    shrinking, columns = found["radius_of_wheel_1_in_time"]
    amounts = np.array([-0.02, -0.02, 0.0, 0.0, 0.0, 0.0]) / shrinking.share  # nothing at the begin, 4 % at the end
    turned = sum(amount * column[0][:, 2] for amount, column in zip(amounts, columns, strict=True))
    assert turned == pytest.approx(np.cumsum(-0.04 * t / t[-1] * 4.0 * wheels.forward[2, 0]) * TICK_S)
    assert shrinking.is_in_time and shrinking.is_local
    at_s, shares, stds = zip(*shrinking.course(amounts, 0.01 * np.eye(6)), strict=True)
    assert shares == pytest.approx(np.linspace(0.0, -0.04, 6)) and at_s[-1] == pytest.approx(t[-1]) and min(stds) > 0.0


def test_wheels_in_time_are_larger_by_shares_that_add_up():
    """Also where they turn the robot round several times: of twice the share the way is turned twice as far."""
    wheels, t = differential(0.05, 0.2), np.arange(4000) * TICK_S
    rates = np.column_stack([4.0 + 4.0 * np.sin(0.4 * t), np.full(4000, -2.0)])
    turning = Motion(rates @ wheels.forward.T, np.zeros((4000, 3)), t, rates * t[:, None], rates, rates)
    found = {generic.name: (generic, columns) for generic, columns in _losses(wheels, [turning])}
    generic, columns = found["radius_of_wheel_1_in_time"]
    twice = _travelled(turning, *np.outer(wheels.forward[:, 0], 2.0 * generic.share * rates[:, 0]))
    assert np.abs(twice - 2.0 * columns[0][0]).max() < 0.1 * np.abs(twice).max()


def test_understeer_loses_of_a_turn_what_grows_with_the_square_of_the_speed():
    x = np.zeros(400)
    lost = []
    for speed in (0.5, 1.0):
        turning = motion(x, x, speed)
        turning.body[:, 2] = 0.8
        both = [turning, motion(x, x, speed)]
        of_turning, of_straight = next(c for generic, c in _losses(WHEELS, both) if generic.name == "understeer")[0]
        assert not of_straight.any()
        lost.append(of_turning[-1, 2])
    assert lost[1] == pytest.approx(4.0 * lost[0]) and lost[0] < 0.0


@pytest.mark.parametrize(("count", "ticks"), [(0.1, 20), (0.01, 8)])
def test_speeds_know_nothing_of_later_counts(count, ticks):
    turned = np.cumsum(np.full((200, 2), 0.025), axis=0) + np.array([0.0, 0.013])
    angles = count * np.floor(turned / count)
    later_steps = np.diff(angles, axis=0)[100:][::-1]
    changed = np.vstack([angles[:101], angles[100] + np.cumsum(later_steps, axis=0)])
    speeds = past_speeds(angles)
    assert np.array_equal(speeds[:101], past_speeds(changed)[:101]) and not np.array_equal(changed, angles)
    assert not speeds[0].any()
    assert speeds[150] == pytest.approx((angles[150] - angles[150 - ticks]) / (ticks * TICK_S))


# -- Sizes and noise in turn


def test_a_turn_goes_on_where_the_last_one_ended():
    assert expected_to_stay([[1.0, 2.0]], [[3.0, 5.0]]).tolist() == [3.0, 5.0]


@pytest.mark.parametrize("slope", [-1.0, -2.0, 0.5, 0.9])
def test_turns_that_go_to_and_fro_or_crawl_meet_at_the_size_that_stays(slope):
    ended = [[4.0 + slope * (begun - 4.0)] for begun in (1.0, 4.0 - 3.0 * slope)]
    assert expected_to_stay([[1.0], [4.0 - 3.0 * slope]], ended) == pytest.approx([4.0])


def test_of_several_sizes_as_many_turns_and_one_suffice():
    slopes, stays, begun, ended = np.array([[-0.9, 0.4], [0.3, 0.6]]), np.array([2.0, -1.0]), [[0.0, 0.0]], []
    for _ in range(3):
        ended.append(stays + slopes @ (begun[-1] - stays))
        begun.append(expected_to_stay(begun, ended))
    assert begun[-1] == pytest.approx(stays)


def test_where_the_model_would_run_away_a_turn_goes_on_from_the_last_fit(monkeypatch):
    class Unstable(Linear):
        def residuals(self, values):
            found = super().residuals(values)
            if any(abs(parameters["size"]) > 50.0 for parameters in values.values()):
                found[0]["room"][:] = np.nan
            return found

    module = importlib.import_module("drake_ispace.explain.decide.survey.survey")
    monkeypatch.setattr(module, "expected_to_stay", lambda begun, ended: ended[-1] + 1e3)
    (tilt,) = made("tilt")
    measured = 2.0 * pattern(3) + noise()
    view = survey(Unstable(measured, {"tilt": pattern(3)}), {}, [tilt], generics=no_generics).view
    _, best = fit_with_noise(view, {tilt: [1.0]})
    assert best.point[tilt] == pytest.approx([2.0], abs=0.1)


@pytest.mark.parametrize("size", [0.0, 2.0])
def test_few_numbers_that_all_effects_together_could_explain_are_tested_all_the_same(size):
    noise, *others = np.random.default_rng(1).standard_normal((49, RUNS, 25))
    shapes = {f"cause {i}": shape for i, shape in enumerate(others)}
    measured = noise + size * shapes["cause 2"]
    found = survey(Linear(measured, shapes), {}, made(*shapes), generics=no_generics)
    detection = detect(found.minus_log10_p.max(), trials(found.screen, found.by_instant, seed=0))
    assert detection.found == (size > 0.0)
    assert 1.2 < detection.threshold < 5.0


@pytest.mark.parametrize("every, together", [(19, 10), (3, 66), (300, 1)])
def test_as_many_fixes_are_a_block_as_come_in_a_second(every, together):
    prediction = SimpleNamespace(row_ticks=1, tracks=[SimpleNamespace(fix_ticks=every * np.arange(200))])
    whitening = SimpleNamespace(instants=lambda residuals, together: together)
    assert blocks_of(prediction, whitening, None) == {"motion": 200, "room": together}
