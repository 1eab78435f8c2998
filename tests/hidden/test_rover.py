"""A two-wheeled robot under commanded velocity, whose truth is plain numpy."""

from dataclasses import replace

import numpy as np
import pytest

import drake_ispace as di
from drake_ispace.explain.predict.case import prepare
from drake_ispace.faults.repair import rows
from hidden import two_wheels
from hidden.rover_campaign import Case, answer, judged


def told(sizes, effects=None):
    case = Case(sizes, 700)
    return case, answer(case, 9.0, effects and [di.effects()[name] for name in effects])


@pytest.mark.slow
def test_a_robot_that_does_as_it_is_told_lacks_nothing():
    _, found = told({})
    assert found.verdict == "none", found


def test_neither_does_one_that_turns_on_the_spot_and_whose_drive_errs_by_itself():
    still = {"left_share": 0.0, "late_s": 0.0, "lag_s": 0.0, "in_step": True, "speeds_m_s": (0.0, 0.0)}
    runs = [two_wheels.drive(700 + i, 10.0, others={"errs_m_s": 0.002}, **still) for i in range(2)]
    assert di.explain(two_wheels.model(), runs, effects=[di.effects()["track_error"]]).verdict == "none"


@pytest.mark.slow
def test_of_two_that_explain_as_much_the_one_that_makes_sense_is_named():
    """A camera that shows the room 1.5 % larger looks like wheels that slip by less than nothing."""
    case, found = told({"camera_share": 0.015}, ["constant_slip", "camera_scale", "track_error"])
    assert judged(case, found) == "exact" and found.verdict == "named" and not found.effects[0].equivalents
    assert found.effects[0].parameters["share"].estimate == pytest.approx(0.015, abs=0.002)


@pytest.mark.slow
def test_a_room_far_too_small_may_be_slip_and_neither_makes_sense():
    _, found = told({"camera_share": -0.3}, ["constant_slip", "camera_scale", "track_error"])
    (effect,) = found.effects
    assert found.verdict == "incomplete" and {effect.name, *effect.equivalents} == {"constant_slip", "camera_scale"}


@pytest.mark.slow
def test_a_drive_may_be_half_a_second_late():
    runs = [two_wheels.drive(720 + i, 9.0, 0.0, 0.0, 0.0, others={"delay_s": 0.5}, in_step=True) for i in range(3)]
    found = di.explain(two_wheels.model(), runs, (), [di.effects()[n] for n in ("velocity_delay", "velocity_lag")])
    (effect,) = found.effects
    assert found.verdict == "set" and (effect.name, effect.faults) == ("velocity_delay", ["clock_offset"])
    assert effect.parameters["delay_s"].estimate == pytest.approx(0.5, abs=0.003)


@pytest.mark.slow
def test_a_drive_that_speeds_up_slowly_is_no_drive_that_lags_or_goes_too_slowly():
    """Of its two limits neither alone lowers the deviance."""
    case, found = told({"ramp_s2_m": 4.0}, ["velocity_slew_limit", "velocity_lag", "velocity_gain"])
    assert judged(case, found) == "exact" and found.verdict == "named"
    assert found.effects[0].parameters["limit_m_s2"].estimate == pytest.approx(0.25, rel=0.01)
    assert found.effects[0].parameters["limit_rad_s2"].estimate == pytest.approx(1.0, rel=0.01)


@pytest.mark.slow
@pytest.mark.parametrize(("hidden", "name", "size"), [
    pytest.param(
        {"brake_s2_m": 0.5}, "velocity_braking_limit", {"limit_m_s2": 2.0, "limit_rad_s2": 8.0},
        marks=pytest.mark.slow,
    ),
    ({"dead_rad_s": 0.2}, "velocity_dead_zone", {"width_rad_s": 0.2}),
    pytest.param(
        {"swing_s2": 0.003}, "velocity_overshoot", {"time_constant_s": 0.0548, "damping": 0.333},
        marks=pytest.mark.slow,
    ),
])
def test_a_drive_that_is_no_lag_has_a_name(hidden, name, size):
    """It brakes slowly, does not move for small commands, or overshoots."""
    rivals = ["velocity_braking_limit", "velocity_dead_zone", "velocity_overshoot", "velocity_lag", "velocity_delay"]
    case, found = told(hidden, rivals)
    assert judged(case, found) == "exact" and found.verdict == "named"
    assert {n: p.estimate for n, p in found.effects[0].parameters.items()} == pytest.approx(size, rel=0.05)


@pytest.mark.slow
@pytest.mark.parametrize(("hidden", "name", "size"), [
    ("clipped_s_rad", "wheel_speed_limit", 8.0),
    pytest.param("slowed_s_rad", "wheel_speed_desaturation", 8.0, marks=pytest.mark.slow),
    pytest.param("turns_s_rad", "velocity_saturation", 0.5, marks=pytest.mark.slow),
])
def test_a_limit_is_one_of_each_wheel_of_all_together_or_of_the_robot(hidden, name, size):
    rivals = ["wheel_speed_limit", "wheel_speed_desaturation", "velocity_saturation", "velocity_gain", "velocity_lag"]
    case = Case({hidden: 1.0 / size}, 700)
    found = answer(case, 18.0, [di.effects()[rival] for rival in rivals])
    assert judged(case, found) == "exact" and found.verdict == "named" and not found.effects[0].equivalents
    assert found.effects[0].name == name
    assert found.effects[0].parameters["limit_rad_s"].estimate == pytest.approx(size, rel=0.02)


@pytest.mark.slow
def test_one_wheel_that_is_much_larger_is_no_camera_of_another_run():
    _, found = told({"left_share": 0.2}, ["single_wheel_radius_error", "track_error", "camera_scale"])
    (effect,) = found.effects
    assert found.verdict == "incomplete" and effect.name == "single_wheel_radius_error" and not found.data
    assert effect.parameters["share"].estimate == pytest.approx(0.2, abs=0.002)


def test_wheels_without_a_command_cannot_tell_a_larger_wheel_from_an_encoder_that_shows_less():
    run = two_wheels.drive(3, 6.0, left_share=0.0, late_s=0.0, lag_s=0.0)
    run = replace(run, channels={c: run.channels[c] for c in ("encoder", "kinect")})
    prediction = prepare(two_wheels.model(), run).prediction
    ((larger, shows_less),) = zip(
        prediction.residuals({"single_wheel_radius_error": {"wheel": 2, "share": 1.0 / 0.98 - 1.0}}),
        prediction.residuals({"encoder_lost_counts": {"wheel": 2, "share": 0.02}}), strict=True,
    )
    np.testing.assert_allclose(larger["room"], shows_less["room"], rtol=0.0, atol=1e-9)


def test_a_trace_is_named_without_which_the_answer_does_not_suffice():
    """A wheel that is 0.6 % larger hardly shows from fix to fix, and turns the robot aside over 10 s."""
    runs = [two_wheels.drive(10 + i, 10.0, left_share=0.006, late_s=0.08, lag_s=0.0) for i in range(2)]
    runs = [replace(run, channels={c: run.channels[c] for c in ("encoder", "kinect")}) for run in runs]
    found = di.explain(two_wheels.model(), runs)
    late, wheel = found.effects
    assert found.verdict == "set" and late.parameters.popitem()[1].estimate == pytest.approx(0.08, abs=0.002)
    assert "single_wheel_radius_error" in {wheel.name, *wheel.equivalents} and not found.remainders


@pytest.mark.slow
@pytest.mark.parametrize("has", [
    ("encoder", "kinect"), pytest.param(("command", "encoder", "kinect"), marks=pytest.mark.slow),
])
def test_a_log_may_begin_while_the_robot_moves(has):
    """What a late camera shows at first, and a drive that lags does, was before the log."""
    runs = [two_wheels.drive(k, 12.0, left_share=0.0, late_s=0.09, lag_s=0.05, in_step=True) for k in (100, 101, 102)]
    channels = [{name: rows(run.channels[name], run.channels[name].t >= 4.0) for name in has} for run in runs]
    found = di.explain(two_wheels.model(), [replace(run, channels=c) for run, c in zip(runs, channels, strict=True)])
    known = {"camera_latency", "clock_offset"} | ({"velocity_lag"} if "command" in has else set())
    assert found.verdict == "set" and {effect.name for effect in found.effects} <= known
    assert len(found.effects) == len(has) - 1


@pytest.mark.slow
def test_what_hardly_shows_from_fix_to_fix_is_named_if_free_runs_need_it():
    """A marker that is 46 mm off, of a robot that turns slowly under a camera at 100 Hz."""
    slow = {"left_share": 0.0, "late_s": 0.0, "lag_s": 0.05, "in_step": True, "ramp_s": 3.0}
    runs = [
        two_wheels.drive(173000 + i, 6.0, camera_hz=100.0, others={"marker_y_m": -0.046}, **slow) for i in range(2)
    ]
    channels = [{name: run.channels[name] for name in ("encoder", "kinect")} for run in runs]
    found = di.explain(two_wheels.model(), [replace(run, channels=c) for run, c in zip(runs, channels, strict=True)])
    assert found.verdict == "named" and found.detection.p_value > 0.01
    (effect,) = found.effects
    assert effect.name == "marker_offset" and effect.parameters["y_m"].estimate == pytest.approx(-0.046, abs=0.005)


@pytest.mark.slow
def test_a_marker_far_from_the_middle_is_named_and_measured():
    found = answer(Case({"marker_x_m": 0.1, "marker_y_m": 0.4}, 50), 10.0)
    (effect,) = found.effects
    assert found.verdict == "named" and effect.name == "marker_offset"
    assert effect.parameters["x_m"].estimate == pytest.approx(0.1, abs=0.005)
    assert effect.parameters["y_m"].estimate == pytest.approx(0.4, abs=0.005)


@pytest.mark.slow
def test_fixes_with_heavy_tails_change_no_name_and_hardly_a_size():
    """Errors of Student's distribution with two degrees of freedom, many of them beyond ten standard deviations."""
    case = Case({"track_share": 0.03}, 700)
    runs = case.recordings(12.0)[:3]
    for i, run in enumerate(runs):
        kinect, random = run.channels["kinect"], np.random.default_rng(i)
        errors = random.standard_t(2.0, kinect.values.shape) * [1e-3, 1e-3, 4e-3]
        runs[i] = replace(run, channels=run.channels | {"kinect": replace(kinect, values=kinect.values + errors)})
    few = ("track_error", "marker_offset", "wheel_radius_errors", "camera_latency", "constant_slip")
    (effect,) = di.explain(two_wheels.model(), runs, effects=[di.effects()[name] for name in few]).effects
    assert effect.name == "track_error" and effect.parameters["share"].estimate == pytest.approx(0.03, abs=0.003)


def with_a_spin(seed, seconds, others, before):
    """What explain says of two runs of the same motion, and one that turns on the spot."""
    exact = {"left_share": 0.0, "late_s": 0.0, "lag_s": 0.0, "in_step": True}
    motions = [before, before, {"speeds_m_s": (0.0, 0.0), "rates_rad_s": (1.0, 1.5)}]
    runs = [two_wheels.drive(seed + i, seconds, others=others, **exact, **how) for i, how in enumerate(motions)]
    few = [di.effects()[name] for name in ("track_error", "constant_slip", "marker_offset")]
    return di.explain(two_wheels.model(), runs, effects=few)


@pytest.mark.slow
def test_a_run_that_alone_shows_a_size_is_not_held_against_it():
    """Two runs straight ahead do not tell the track, with which the third one would have to be predicted."""
    straight = {"rates_rad_s": (0.0, 0.0)}
    found = with_a_spin(5, 10.0, {"track_share": 0.03, "marker_x_m": 0.02}, straight)
    assert found.verdict == "named" and {e.name for e in found.effects} == {"track_error", "marker_offset"}
    assert found.effects[0].parameters["share"].estimate == pytest.approx(0.03, abs=0.001)
    assert not found.drifts and any(said.startswith("run 3: only there") for said in found.warnings)


@pytest.mark.slow
def test_what_is_below_detection_is_named_if_the_answer_does_not_suffice_without_it():
    found = with_a_spin(25, 20.0, {"track_share": 0.002, "slip_share": 0.025}, {})
    sizes = {effect.name: effect.parameters.popitem()[1].estimate for effect in found.effects}
    assert found.verdict == "named" and not found.remainders
    assert sizes == {"constant_slip": pytest.approx(0.025, abs=1e-3), "track_error": pytest.approx(0.002, abs=3e-4)}


@pytest.mark.slow
def test_a_floor_that_moves_has_no_name():
    case, found = told({"belt_m_s": 0.008})
    assert judged(case, found) in ("unknown", "incomplete")


@pytest.mark.slow
@pytest.mark.parametrize("effects", [
    ["track_error", "constant_slip"], pytest.param(None, marks=pytest.mark.slow),
], ids=["some", "all"])
def test_tyres_that_are_pressed_in_bends_are_no_wrong_track(effects):
    """Who turns at one speed cannot tell them apart; the turn that is lost grows with the square of the speed."""
    case, found = told({"lean_s2_m": -0.026}, effects)
    assert judged(case, found) == "unknown" and found.unknown.driver == "speed and turning"


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "others", "seized"), [(840, {"least_rad_s": 1.0}, []), (830, {}, [1])])
def test_a_wheel_that_does_not_turn_as_told_for_a_while_is_no_noise_of_the_drive(seed, others, seized):
    drive = {"left_share": 0.0, "late_s": 0.0, "lag_s": 0.0, "in_step": True, "ramp_s": 0.3, "others": others}
    runs = [two_wheels.drive(seed + i, 18.0, **drive, seized_s=(7.0, 12.0) if i in seized else ()) for i in range(4)]
    library = ("velocity_lag", "velocity_gain", "velocity_coupling", "wheel_radius_errors", "marker_offset")
    found = di.explain(two_wheels.model(), runs[:3], runs[3:], [di.effects()[name] for name in library])
    assert found.verdict == "unknown" and found.remainders


@pytest.mark.slow
def test_a_tyre_that_goes_flat_half_way_is_no_smaller_wheel():
    drive = {"left_share": 0.0, "late_s": 0.0, "lag_s": 0.0, "in_step": True, "others": {"punctured_share": 0.04}}
    runs = [two_wheels.drive(850 + i, 18.0, ramp_s=0.3, **drive) for i in range(4)]
    library = ("velocity_lag", "velocity_coupling", "wheel_radius_errors", "marker_offset", "camera_keystone")
    found = di.explain(two_wheels.model(), runs[:3], runs[3:], [di.effects()[name] for name in library])
    assert found.verdict == "unknown" and found.unknown.driver.startswith("time"), found
    assert "repeat one motion" in found.next_experiment
