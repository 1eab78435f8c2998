"""Whole runs that nothing corrects: dead reckoning, simulations, sizes fitted to them, choice by validation."""

from dataclasses import replace

import numpy as np
import pytest

import drake_ispace as di
from drake_ispace.blocks.block import Block, Output, Spec
from drake_ispace.blocks.errors import InputError
from drake_ispace.blocks.kernels import kernel
from drake_ispace.blocks.rates import TICK_S
from drake_ispace.effects.places.transmission import ViscousFriction
from drake_ispace.explain.decide.validate import validated_choice
from drake_ispace.explain.fit.candidates import candidates
from drake_ispace.explain.fit.free_run import error_of, fitted
from drake_ispace.explain.own_model import OwnModel
from drake_ispace.explain.predict.case import prepare
from drake_ispace.explain.predict.replay import applicable
from drake_ispace.explain.prove.errors.free_run import ATE, Measure, Simulation, errors, rms, windows_of
from drake_ispace.explain.prove.errors.paths import absolute_errors, aligned, chained, compose
from drake_ispace.files.recording import Channel, Recording
from drake_ispace.plants.wheels import omni4
from stand_ins.one_wheel import angle, rate

LAG_S, VISCOUS, COULOMB = 0.08, 0.03, 0.2


@kernel
def accelerate(xc, torque, gain, lag_s, out):
    out[0] = xc[1]
    out[1] = (gain * torque[0] - xc[1]) / lag_s


def motor(gain=10.0, lag_s=LAG_S / 2.0, **changes):
    """A motor of gain 10 rad/s/V whose time constant, believed to be half of LAG_S, is free."""
    block = Block(Spec(
        inputs={"torque": 1}, outputs={"wheel_angle": Output(1, angle), "wheel_rate": Output(1, rate)},
        parameters={"gain": gain, "lag_s": lag_s}, continuous_state=np.zeros(2), derivatives=accelerate,
    ))
    return OwnModel(block, **{"logged": "speed", "free": ("lag_s",), **changes})


def step(volts, viscous=VISCOUS, coulomb=0.0, rest_s=0.0, noise=0.0, seed=0):
    """A run of 0.5 s from rest under constant voltage, speed with noise [rad/s], after a rest of `rest_s`."""
    h, t = 1e-3, 1e-3 * np.arange(int((0.5 + rest_s) / 1e-3))
    driven, w, speeds = np.where(t < rest_s, 0.0, volts), 0.0, []
    for tau in driven:
        speeds.append(w)
        friction = viscous * w + coulomb * np.tanh(w / 0.05)
        w += h * (10.0 * (tau - friction) - w) / LAG_S
    speeds = np.array(speeds) + noise * np.random.default_rng(seed).standard_normal(len(t))
    return Recording("motor", channels={
        "torque": Channel(t, ("tau_1",), driven[:, None], {}, h),
        "encoder": Channel(t, ("theta_1",), np.cumsum(speeds * h)[:, None], {}, h),
    })


FRICTIONS = [di.effects()[name] for name in ("viscous_friction", "coulomb_friction")]
STEPS = [step(volts, noise=0.05, seed=i) for i, volts in enumerate((1.0, 2.0, 3.0, -1.5))]


def test_sizes_and_a_free_parameter_are_found_together():
    case = prepare(motor(), STEPS, effects=FRICTIONS)
    (viscous, _) = candidates(case.replay.effects, case.replay.body)
    found = fitted(case.replay, case.prediction.tracks, {viscous: [0.001]})
    assert found.point[viscous][0] == pytest.approx(VISCOUS, rel=0.03)
    assert found.plant["lag_s"] == pytest.approx(LAG_S, rel=0.03)


def test_a_free_parameter_below_zero_is_found_and_stays_there():
    other_sense = [
        replace(run, channels=run.channels | {"torque": replace(torque, values=-torque.values)})
        for run in STEPS for torque in [run.channels["torque"]]
    ]
    case = prepare(motor(gain=-6.0, lag_s=LAG_S, free=("gain",)), other_sense, effects=FRICTIONS)
    (viscous, _) = candidates(case.replay.effects, case.replay.body)
    gain = fitted(case.replay, case.prediction.tracks, {viscous: [VISCOUS]}).plant["gain"]
    assert gain == pytest.approx(-10.0, rel=0.03)
    case = prepare(motor(gain=-6.0, lag_s=LAG_S, free=("gain",)), STEPS, effects=FRICTIONS)
    assert fitted(case.replay, case.prediction.tracks, {}).plant["gain"] <= 0.0


def test_a_delay_is_found_in_short_runs():
    late = []
    for run in (step(volts, rest_s=0.2, noise=0.05, seed=i) for i, volts in enumerate((1.0, 2.0, 3.0, -1.5))):
        torque = run.channels["torque"]
        early = replace(torque, values=np.vstack([torque.values[7:], np.repeat(torque.values[-1:], 7, axis=0)]))
        late.append(replace(run, channels=run.channels | {"torque": early}))
    case = prepare(motor(), late, effects=[FRICTIONS[0], di.effects()["command_delay"]])
    delay, viscous = sorted(candidates(case.replay.effects, case.replay.body), key=lambda candidate: candidate.name)
    found = fitted(case.replay, case.prediction.tracks, {viscous: [VISCOUS], delay: [0.02]})
    assert found.point[delay][0] == pytest.approx(0.007, abs=0.0005)
    assert found.plant["lag_s"] == pytest.approx(LAG_S, rel=0.03)


def test_the_spread_of_the_runs_is_the_uncertainty():
    sizes = np.array([0.02, 0.03, 0.04, 0.03, 0.025, 0.035])
    case = prepare(motor(), [step(2.0, viscous=size) for size in sizes], effects=FRICTIONS[:1])
    (viscous,) = candidates(case.replay.effects, case.replay.body)
    found = fitted(case.replay, case.prediction.tracks, {viscous: [0.001]})
    assert found.stds[viscous, 0] == pytest.approx(np.std(sizes, ddof=1) / np.sqrt(6), rel=0.3)


def test_two_runs_are_uncertain_by_half_their_difference():
    case = prepare(motor(), [step(2.0, viscous=size) for size in (0.02, 0.03)], effects=FRICTIONS[:1])
    (viscous,) = candidates(case.replay.effects, case.replay.body)
    found = fitted(case.replay, case.prediction.tracks, {viscous: [0.001]})
    assert found.stds[viscous, 0] == pytest.approx(0.005, rel=0.15)


def test_a_rest_before_the_first_torque_does_not_dilute_the_error():
    errors = []
    for rest_s in (0.1, 0.5):
        case = prepare(motor(), [step(2.0, rest_s=rest_s)], effects=FRICTIONS)
        errors.append(error_of(case.replay, case.prediction.tracks, fitted(case.replay, case.prediction.tracks, {})))
    assert errors[0] == pytest.approx(errors[1], rel=0.02)


def test_what_was_logged_is_what_is_compared():
    case = prepare(motor(logged="angle", free=()), [step(2.0)], effects=FRICTIONS)
    track = case.prediction.tracks[0]
    off = case.replay.simulated(track, {}) - track.measured[: track.ticks + 1]
    none = fitted(case.replay, [track], {})
    assert error_of(case.replay, [track], none) == pytest.approx(np.sqrt(np.mean(off**2)))
    assert error_of(replace(case.replay, logged="speed"), [track], none) == pytest.approx(
        np.sqrt(np.mean(((off[2:] - off[:-2]) / (2.0 * TICK_S)) ** 2))
    )


@pytest.mark.slow
def test_validation_leaves_out_what_does_not_help():
    answer = di.explain(motor(), STEPS, [step(2.5), step(-2.5)], FRICTIONS)
    assert [effect.name for effect in answer.effects] == ["viscous_friction"] and answer.verdict == "named"
    assert answer.closed > 0.95 and answer.detection is None
    errors = {tuple(row.effects): row.error for row in answer.validated}
    assert len(errors) == 4 and errors["viscous_friction",] < 0.2 * errors[()]
    (lag,) = answer.plant
    assert lag.name == "lag_s" and lag.after == pytest.approx(LAG_S, rel=0.03) and abs(lag.before - LAG_S) > 0.005


def test_validation_names_both_where_both_are_missing():
    runs = [step(volts, coulomb=COULOMB, noise=0.05, seed=i) for i, volts in enumerate((1.0, 2.0, 3.0, -1.5))]
    answer = di.explain(motor(), runs, effects=FRICTIONS)
    sizes = {effect.name: next(iter(effect.parameters.values())).estimate for effect in answer.effects}
    assert sizes == {
        "viscous_friction": pytest.approx(VISCOUS, rel=0.1), "coulomb_friction": pytest.approx(COULOMB, rel=0.1)
    }


@pytest.mark.slow
def test_validation_finds_nothing_in_a_motor_that_lacks_nothing():
    runs = [step(volts, viscous=0.0, noise=0.05, seed=i) for i, volts in enumerate((1.0, 2.0, 3.0, -1.5))]
    answer = di.explain(motor(), runs, [step(2.5, viscous=0.0)], FRICTIONS)
    assert answer.verdict == "none" and answer.effects == [] and answer.closed is None


class Twin(ViscousFriction):
    """The same friction by another name."""

    card = replace(ViscousFriction.card, name="twin")


@pytest.mark.slow
def test_effects_that_validate_alike_are_a_set():
    answer = di.explain(motor(), STEPS, effects=[FRICTIONS[0], Twin()])
    (effect,) = answer.effects
    assert answer.verdict == "set" and {effect.name, *effect.equivalents} == {"viscous_friction", "twin"}


@pytest.mark.parametrize("runs, effects, said", [
    (STEPS[:1], FRICTIONS, "is the only run, expected two at least"),
    (STEPS, None, "expected fewer effects"),
], ids=["one run", "the whole library"])
def test_what_cannot_be_validated_is_refused(runs, effects, said):
    case = prepare(motor(), runs, effects=FRICTIONS)
    with pytest.raises(InputError, match=said):
        validated_choice(case.prediction, candidates(applicable(effects, case.replay.body), case.replay.body))



@pytest.fixture(scope="module")
def wide():
    """An omni robot whose wheels are 3 % larger than believed."""
    hidden = {"wheel_radius_error": {"share": 0.03}}
    (run,) = di.hide("omni_multirate", "omni", hidden, ["circle"], seconds=8.0).values()
    return prepare("omni_multirate", [run], effects=[di.effects()["wheel_radius_error"]]).prediction, hidden


def dead_reckoned(prediction, values):
    """Measure -> root mean square error of the first run."""
    windows = windows_of(prediction, 0, {})
    return {m: rms([e]) for m, e in errors(prediction, 0, windows, values).items() if m.metric == ATE}


def by_hand(track, radius_m):
    """Root mean square distance between camera and plain odometry of four wheels, both begun at the first second."""
    geometry = omni4(radius_m, 0.36)
    steps = np.diff(track.measured[: track.ticks + 1], axis=0) @ geometry.forward.T
    path = chained(np.zeros(3), steps)
    seen = path[track.fix_ticks]
    first = track.fix_t <= track.fix_t[0] + 1.0
    off = absolute_errors(compose(aligned(seen[first], track.poses[first]), seen), track.poses)
    return np.sqrt(np.mean(off[:, 0] ** 2 + off[:, 1] ** 2))


def test_dead_reckoning_is_off_by_what_the_wheels_are(wide):
    prediction, hidden = wide
    position = Measure("ATE", "run", "position", "m", "wheels")
    before, after = dead_reckoned(prediction, {})[position], dead_reckoned(prediction, hidden)[position]
    (track,) = prediction.tracks
    assert before == pytest.approx(by_hand(track, 0.024), rel=0.1)
    assert after == pytest.approx(by_hand(track, 1.03 * 0.024), abs=2e-3) and after < 0.5 * before


def test_unknown_forces_do_not_move_dead_reckoning(wide):
    prediction, _ = wide
    pushed = replace(prediction, tracks=[
        prediction.replay.pushed(track, np.full((len(track.command), 3), 0.5)) for track in prediction.tracks
    ])
    position = Measure("ATE", "run", "position", "m", "wheels")
    assert dead_reckoned(pushed, {})[position] == pytest.approx(dead_reckoned(prediction, {})[position], rel=0.05)


def test_without_a_camera_nothing_is_dead_reckoned(wide):
    prediction, _ = wide
    blind = replace(prediction, replay=replace(prediction.replay, feeds=frozenset({"encoder", "torque"})))
    assert not any(m.driven_by == "wheels" for m in dead_reckoned(blind, {}))


def test_a_free_run_begins_where_the_model_is_held(wide):
    prediction, hidden = wide
    (track,) = prediction.tracks
    simulation = Simulation(prediction.replay, track, prediction.starts[0], hidden, [400])
    logs = simulation.free(400, 200)
    assert np.allclose(logs["pose"][400], simulation.poses[400])
    assert not np.allclose(logs["pose"][600], simulation.poses[600], atol=1e-6)
