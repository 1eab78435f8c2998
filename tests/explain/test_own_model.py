"""A user's own plant: followed, explained, replayed open loop."""

import json
from dataclasses import replace

import numpy as np
import pytest

import drake_ispace as di
from drake_ispace.blocks.block import Block, Output, Spec
from drake_ispace.blocks.errors import InputError
from drake_ispace.blocks.kernels import kernel
from drake_ispace.explain.own_model import OwnModel
from drake_ispace.explain.predict.own_replay import own_replay, own_track
from drake_ispace.explain.predict.prediction import predict
from drake_ispace.explain.prove.own.ahead import Ahead
from drake_ispace.files.recording import Channel, Recording
from stand_ins.one_wheel import angle, rate

INERTIA = 0.02


@kernel
def accelerate(xc, drive, inertia, out):
    out[0] = xc[1]
    out[1] = drive[0] / inertia


@kernel
def follow(xc, drive, out):
    out[0] = drive[0] - xc[0]


def wheel():
    return Block(Spec(
        inputs={"drive": 1}, outputs={"position": Output(1, angle), "speed": Output(1, rate)},
        parameters={"inertia": INERTIA}, continuous_state=np.zeros(2), derivatives=accelerate,
    ))


MODEL = OwnModel(wheel(), torque="drive", wheel_angle="position", wheel_rate="speed")
EFFECTS = [di.effects()[name] for name in ("viscous_friction", "coulomb_friction", "torque_gain_error", "motor_lag")]


def measured(viscous, seconds=20.0, seed=0, start_rad=0.3):
    """A run at 1 kHz of a wheel with viscous friction and a little force noise."""
    generator, h = np.random.default_rng(seed), 1e-3
    t = np.arange(0.0, seconds, h)
    drive = 0.2 * np.sign(np.sin(2.1 * t)) * (0.5 + 0.5 * np.sin(0.37 * t)) + 0.05 * np.sin(7.0 * t)
    theta, omega, angles, push = start_rad, 0.0, [], 0.0
    for tau in drive:
        angles.append(theta)
        push += h / 0.05 * (-push) + 0.002 * np.sqrt(2.0 * h / 0.05) * generator.standard_normal()
        omega += h * (tau + push - viscous * omega) / INERTIA
        theta += h * omega
    return Recording("wheel", channels={
        "torque": Channel(t, ("tau_1",), drive[:, None], {}, h),
        "encoder": Channel(t, ("theta_1",), 1e-4 * np.round(np.array(angles)[:, None] / 1e-4), {}, h),
    })


@pytest.fixture(scope="module")
def rubbing():
    track = own_track(measured(0.01), MODEL, "run")
    return track, own_replay(MODEL, [track], EFFECTS)


def test_the_follower_holds_the_plant_on_its_measurements(rubbing):
    track, replay = rubbing
    residuals = predict(replay, [track]).residuals({})
    assert residuals[0]["room"].shape[0] == 0
    assert np.std(residuals[0]["motion"]) < 0.01


def test_open_loop_the_right_friction_is_right(rubbing):
    track, replay = rubbing
    found = replay.simulated(track, {"viscous_friction": {"coefficient_n_m_s": 0.01}})
    wrong = replay.simulated(track, {})
    truth = track.measured[: track.ticks + 1]
    assert found[0] == pytest.approx(0.3, abs=1e-4)
    assert np.std(found - truth) < 0.1 * np.std(wrong - truth)


def test_open_loop_encoders_show_what_they_would_of_the_robot():
    track = own_track(measured(0.01, 5.0), MODEL, "run")
    lost = {"encoder_lost_counts": {"wheel": 1, "share": 0.1}}
    replay = own_replay(MODEL, [track], [di.effects()[name] for name in lost])
    all_shown, shown = replay.simulated(track, {}), replay.simulated(track, lost)
    assert shown[0] == pytest.approx(track.measured[0])
    assert shown - shown[0] == pytest.approx(0.9 * (all_shown - all_shown[0]), rel=1e-9)


@pytest.mark.parametrize("logged, free, may", [
    ("angle", {}, True), ("speed", {}, False), ("angle", {"inertia": 1.0}, False),
])
def test_the_next_sample_is_judged_where_it_was_measured_and_all_of_the_plant_is_known(rubbing, logged, free, may):
    """Angles that are sums of noisy speeds err by more than any sample of theirs does."""
    assert Ahead.may_judge(replace(rubbing[1], logged=logged, free=free)) == may


def test_known_effects_are_in_the_model():
    known = OwnModel(
        wheel(), torque="drive", wheel_angle="position", wheel_rate="speed",
        effects={"viscous_friction": {"coefficient_n_m_s": 0.01}},
    )
    track = own_track(measured(0.01), known, "run")
    truth = track.measured[: track.ticks + 1]
    assert np.std(own_replay(known, [track], EFFECTS).simulated(track, {}) - truth) < 0.1 * np.std(truth)


def test_torque_faster_than_the_clock_counts_with_its_mean():
    t = np.arange(0.0, 1.0, 1e-3)
    ramp = Recording("wheel", channels={
        "torque": Channel(t, ("tau_1",), t[:, None].copy(), {}, 1e-3),
        "encoder": Channel(t, ("theta_1",), np.zeros((1000, 1)), {}, 1e-3),
    })
    assert own_track(ramp, MODEL, "ramp").command[10, 0] == pytest.approx(0.052, abs=1e-9)


def test_a_run_without_torque_is_refused():
    t = np.arange(0.0, 1.0, 0.005)
    run = Recording("wheel", channels={"encoder": Channel(t, ("theta_1",), np.zeros((200, 1)), {}, 0.005)})
    with pytest.raises(InputError, match="no channel torque"):
        own_track(run, MODEL, "run")


def test_a_plant_that_no_torque_accelerates_is_refused():
    lagging = Block(Spec(
        inputs={"drive": 1}, outputs={"position": Output(1, angle)}, continuous_state=np.zeros(1), derivatives=follow,
    ))
    with pytest.raises(InputError, match="does not accelerate"):
        OwnModel(lagging, torque="drive", wheel_angle="position").linearised()


@pytest.fixture(scope="module")
def explained():
    runs = [measured(0.004, seed=seed) for seed in (1, 2)]
    return di.explain(MODEL, runs, {"third": measured(0.004, seed=3)}, EFFECTS[:2])


def test_the_missing_friction_is_named_with_its_size(explained):
    (effect,) = explained.effects
    size = effect.parameters["coefficient_n_m_s"]
    assert explained.verdict == "named" and effect.name == "viscous_friction" and not effect.equivalents
    assert size.estimate == pytest.approx(0.004, rel=0.1) and size.least_squares == pytest.approx(0.004, rel=0.1)
    assert size.ci90[0] < size.estimate < size.ci90[1] and size.unit == "N*m*s/rad"
    assert 0.9 < effect.share <= 1.0


def test_the_gap_of_the_held_out_run_closes(explained):
    assert explained.closed > 0.9 and explained.headline.kind == "third" and explained.headline.unit == "rad"


def test_an_answer_comes_with_simulations_of_whole_runs(explained):
    errors = {(row.runs, row.unit): row.after / row.before for row in explained.gap if row.metric == "ATE"}
    assert set(errors) == {("training", "rad"), ("training", "1"), ("held_out", "rad"), ("held_out", "1")}
    assert max(errors.values()) < 0.2


def test_an_explanation_of_an_own_model_prints_and_becomes_json(explained):
    json.dumps(explained.to_data(), allow_nan=False)
    assert "third: simulated wheel angle" in str(explained) and explained.model is None


@pytest.mark.parametrize("change, said", [
    ({"logged": "torque"}, "wheel: logged is 'torque', expected 'angle' or 'speed'"),
    ({"free": ("inertia_kg",)}, "wheel: the plant has no parameter 'inertia_kg', did you mean 'inertia'?"),
])
def test_a_model_that_cannot_be_is_refused(change, said):
    with pytest.raises(InputError) as error:
        OwnModel(wheel(), torque="drive", wheel_angle="position", wheel_rate="speed", name="wheel", **change)
    assert str(error.value) == said
