"""Drives of users: in units of their own, logged at rates and with clocks of their own, pushed by unknown torques."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

import drake_ispace as di
from drake_ispace.blocks.block import Block, Output, Spec
from drake_ispace.blocks.kernels import kernel
from drake_ispace.explain.decide.clocks.clocks_set import with_clocks_set
from drake_ispace.explain.fit.free_run import errors
from drake_ispace.explain.own_model import OwnModel
from drake_ispace.explain.predict.case import prepare
from drake_ispace.explain.predict.own_replay import own_track
from drake_ispace.explain.predict.prediction import predict
from drake_ispace.explain.predict.stretches import equal_parts
from drake_ispace.faults.repair import Clock
from drake_ispace.files.recording import Channel, Recording
from stand_ins.one_wheel import angle, rate

STEP_S = 1e-3


@kernel
def accelerate(xc, torque, inertia, viscous, coulomb, out):
    out[0] = xc[1]
    out[1] = (torque[0] - viscous * xc[1] - coulomb * np.tanh(xc[1] / 0.01)) / inertia


def model(inertia, viscous=0.0, coulomb=0.0):
    return OwnModel(Block(Spec(
        inputs={"torque": 1}, outputs={"wheel_angle": Output(1, angle), "wheel_rate": Output(1, rate)},
        parameters={"inertia": inertia, "viscous": viscous, "coulomb": coulomb},
        continuous_state=np.zeros(2), derivatives=accelerate,
    )), name="drive")


def wished(generator, seconds):
    """Times [s], phases [rad] of three sines, and their sum."""
    t, phases = STEP_S * np.arange(round(seconds / STEP_S)), generator.uniform(0.0, 6.0, 3)
    sines = (np.sin(2.0 * np.pi * f * t + phase) for f, phase in zip((0.2, 0.5, 0.9), phases, strict=True))
    return t, phases, sum(sines)


def unknown(generator, n):
    """(n,) what pushes a drive, of unit variance, for 0.05 s or so."""
    keep = np.exp(-STEP_S / 0.05)
    return lfilter([np.sqrt(1.0 - keep**2)], [1.0, -keep], generator.standard_normal(n))


def logged(generator, t, told, angles, count, every):
    """The recording of every so many ms, angles in counts [rad]."""
    at, period = slice(None, None, every), every * STEP_S
    counted = count * np.floor(angles / count + generator.uniform())
    return Recording("drive", channels={
        "torque": Channel(t[at], ("tau_1",), told[at, None], {}, period),
        "encoder": Channel(t[at], ("theta_1",), counted[at, None], {}, period),
    })


def run(seed, inertia, viscous=0.0, sag_per_s=0.0, push=0.0, seconds=12.0, every=5, most_rad_s2=1.0):
    """A drive that is told to go to and fro; push: unknown torque as a share of the command; every: ms of its log."""
    generator = np.random.default_rng(seed)
    t, _, wish = wished(generator, seconds)
    told = most_rad_s2 * inertia * np.repeat(wish[::every], every)[: len(t)]
    torque = (1.0 - sag_per_s * t) * told + push * told.std() * unknown(generator, len(t))
    speed = lfilter([STEP_S / inertia], [1.0, viscous * STEP_S / inertia - 1.0], np.concatenate([[0.0], torque[:-1]]))
    return logged(generator, t, told, np.concatenate([[0.0], np.cumsum(speed[:-1] * STEP_S)]), 1e-4, every)


def loose_run(seed, inertia, play_rad, seconds=12.0):
    """A drive with two fifths of its inertia behind a gear that has play."""
    generator = np.random.default_rng(seed)
    t, _, wish = wished(generator, seconds)
    told = 10.0 * inertia * np.repeat(wish[::5], 5)[: len(t)]
    angle, speed, load, load_speed, angles = 0.0, 0.0, 0.0, 0.0, []
    for torque in told:
        angles.append(angle)
        twist = angle - load
        touching = abs(twist) > play_rad
        passed = 200.0 * (twist - np.sign(twist) * play_rad) + 0.5 * (speed - load_speed) if touching else 0.0
        speed, load_speed = (
            speed + STEP_S * (torque - passed) / (0.6 * inertia), load_speed + STEP_S * passed / (0.4 * inertia),
        )
        angle, load = angle + STEP_S * speed, load + STEP_S * load_speed
    return logged(generator, t, told, np.array(angles), 1e-4, 5)


def told_apart(*names):
    return [di.effects()[name] for name in names]


def test_the_friction_of_a_heavy_drive_is_seen():
    """A size of 1 N m s/rad, a thousand times those of small robots."""
    found = di.explain(model(3.0), [run(k, 3.0, viscous=1.0) for k in (1, 2)], effects=told_apart("viscous_friction"))
    assert [effect.name for effect in found.effects] == ["viscous_friction"]
    assert found.effects[0].parameters["coefficient_n_m_s"].estimate == pytest.approx(1.0, rel=0.05)


def test_what_unknown_torques_add_up_to_is_not_taken_for_the_effect():
    """Least squares of a free run is off by half of the size or more; the filter is not."""
    runs = [run(5, 0.02, sag_per_s=0.012, push=0.03)]
    found = di.explain(model(0.02), runs, effects=told_apart("battery_sag_time"))
    size = found.effects[0].parameters["rate_per_s"]
    assert size.estimate == pytest.approx(0.012, rel=0.25)
    assert abs(size.least_squares - 0.012) > 0.5 * 0.012


@pytest.mark.slow
def test_runs_that_come_nearer_by_chance_do_not_decide_the_size():
    """Each of the two is simulated better with least squares of the other, whose size is a tenth too small."""
    found = di.explain(
        model(0.02), [run(k, 0.02, viscous=0.004, push=0.03) for k in (7, 8)], effects=told_apart("viscous_friction"),
    )
    size = found.effects[0].parameters["coefficient_n_m_s"]
    assert size.estimate == pytest.approx(0.004, rel=0.05)
    assert abs(size.least_squares - 0.004) > 0.1 * 0.004


@pytest.mark.slow
def test_an_encoder_that_is_read_rarely_shows_no_delay_that_is_not_there():
    runs = [run(k, 0.02, push=0.03, every=20) for k in (1, 2, 3)]
    found = di.explain(model(0.02), runs, effects=told_apart("command_delay", "motor_lag", "torque_slew_limit"))
    assert found.verdict == "none"
    assert "training runs, ATE run, simulated wheel angle, relative (torque): 0." in str(found)


@pytest.mark.first_case
@pytest.mark.parametrize("play_rad, verdict", [(0.0, "none"), (0.1, "unknown")])
def test_play_in_a_gear_adds_nothing_up_and_is_not_passed_for_noise(play_rad, verdict):
    runs = [loose_run(k, 0.02, play_rad) for k in (1, 2)]
    found = di.explain(model(0.02), runs, effects=told_apart("motor_lag", "viscous_friction"))
    assert found.verdict == verdict
    assert [remainder.channel for remainder in found.remainders] == ["encoder: wheel angle"] * (verdict == "unknown")


@pytest.mark.parametrize("start_s", [0.0, 0.5, 1234.0, -3.0])
def test_torque_is_that_of_the_same_moment_on_any_clock(start_s):
    recorded = run(1, 0.02, every=2)
    shifted = replace(recorded, channels={
        name: replace(channel, t=channel.t + start_s) for name, channel in recorded.channels.items()
    })
    expected = own_track(recorded, model(0.02), "run").command[:2000]
    assert own_track(shifted, model(0.02), "run").command[:2000] == pytest.approx(expected, abs=1e-9)


def begun_later(run, since_s):
    return replace(run, channels={
        name: replace(channel, t=channel.t[channel.t > since_s], values=channel.values[channel.t > since_s])
        for name, channel in run.channels.items()
    })


@pytest.mark.parametrize("since_s", [pytest.param(2.1, marks=pytest.mark.slow), 3.0])
def test_a_log_that_begins_in_motion_lacks_nothing(since_s):
    runs = [begun_later(run(k, 0.02, push=0.03), since_s) for k in (1, 2, 3)]
    case = prepare(model(0.02), runs)
    assert all(one.unscored_ticks > 0 for one in case.prediction.tracks)
    assert all(np.sqrt(np.mean(errors(case.replay, one, {}) ** 2)) < 0.1 for one in case.prediction.tracks)
    few = told_apart("viscous_friction", "coulomb_friction", "torque_gain_error")
    assert di.explain(model(0.02), runs, effects=few).verdict == "none"


@pytest.mark.parametrize("friction", [{}, {"viscous": 0.03}, {"coulomb": 0.2}, {"viscous": 0.03, "coulomb": 0.2}])
def test_no_effect_may_take_away_more_friction_than_the_plant_has(friction):
    plant = model(0.02, **friction).settings.plant
    assert plant.friction["viscous_n_m_s"] == pytest.approx(friction.get("viscous", 0.0), abs=3e-4)
    assert plant.friction["coulomb_n_m"] == pytest.approx(friction.get("coulomb", 0.0), abs=1e-3)


def rubbed(seed, growing=0.0, inertia=0.02, viscous=0.006, coulomb=0.06, seconds=12.0):
    """A run of a drive with friction; growing: share by which dry friction grows in a radian."""
    generator = np.random.default_rng(seed)
    t, phases, wish = wished(generator, seconds)
    told = np.repeat((10.0 * inertia * wish + coulomb * np.sign(np.sin(0.4 * np.pi * t + phases[0])))[::5], 5)
    torques = told + 0.005 * told.std() * unknown(generator, len(t))
    angles, speed = np.zeros(len(t)), 0.0
    for i, torque in enumerate(torques[:-1]):
        dry = coulomb * max(1.0 + growing * angles[i], 0.0) * np.tanh(speed / 0.005)
        speed += STEP_S * (torque - viscous * speed - dry) / inertia
        angles[i + 1] = angles[i] + STEP_S * speed
    return logged(generator, t, told, angles, 1e-3, 5)


@pytest.mark.slow
def test_two_frictions_that_stay_as_they_are_drift_nowhere():
    found = di.explain(model(0.02), [rubbed(k, seconds=8.0) for k in (30, 31, 32)])
    assert sorted(effect.name for effect in found.effects) == ["coulomb_friction", "viscous_friction"]
    assert found.verdict == "named" and not found.drifts


@pytest.mark.slow
@pytest.mark.parametrize("effects", [
    told_apart("coulomb_friction", "viscous_friction"), pytest.param(None, marks=pytest.mark.slow),
], ids=["some", "all"])
def test_a_friction_that_grows_with_the_place_is_not_said_to_be_all(effects):
    found = di.explain(model(0.02), [rubbed(k, growing=0.01) for k in (1, 2, 3)], effects=effects)
    said = " ".join([*found.warnings, found.unknown.driver if found.unknown else ""])
    assert found.verdict in ("incomplete", "unknown") and "place and direction" in said


def test_a_model_with_dry_friction_is_held_on_the_motion():
    """Its friction is steep about rest: a filter for that slope leaves a moving model to itself."""
    case = prepare(model(0.02, 0.006, 0.06), [rubbed(k) for k in (1, 2)])
    for one in case.prediction.residuals({}):
        assert np.sqrt(np.mean(one["motion"] ** 2)) < 4.0 * case.replay.angle_std


@pytest.mark.parametrize("friction", [{}, {"viscous": 0.1}, {"coulomb": 0.2}])
def test_dry_friction_is_as_steep_as_at_the_usual_speed(friction):
    """A tanh of 0.01 rad/s is whole at 2 rad/s, and at rest 200 times as steep as from there to there."""
    braking = model(0.5, **friction).in_motion(np.array([2.0]))[1, 1]
    assert braking == pytest.approx(-(friction.get("viscous", 0.0) + friction.get("coulomb", 0.0) / 2.0) / 0.5)
    assert np.array_equal(model(0.5, **friction).in_motion(np.zeros(1)), model(0.5, **friction).linearised()[0])


@pytest.mark.first_case
@pytest.mark.parametrize(("every", "late_s"), [(5, 0.005), (5, 0.02), (1, 0.01), (20, 0.04)])
def test_torques_that_are_stamped_late_are_set_to_the_tick(every, late_s):
    runs = [Clock("torque", 1.0, late_s).apply(run(k, 0.02, push=0.01, every=every)) for k in (1, 2)]
    found = di.explain(model(0.02), runs, effects=told_apart("viscous_friction", "command_delay", "motor_lag"))
    assert found.verdict == "none"
    assert [(one.fault, one.channel, one.repairs[0].offset_s) for one in found.data] == [
        ("clock_offset", "torque", pytest.approx(-late_s))
    ]


@pytest.mark.slow
def test_an_encoder_that_is_stamped_late_may_be_its_clock_or_a_delay_of_the_command():
    runs = [Clock("encoder", 1.0, 0.03).apply(run(k, 0.02, push=0.01)) for k in (1, 2)]
    found = di.explain(model(0.02), runs, effects=told_apart("command_delay", "motor_lag", "viscous_friction"))
    (effect,) = found.effects
    assert found.verdict == "set" and (effect.name, effect.faults) == ("command_delay", ["clock_offset"])
    assert effect.parameters["delay_s"].estimate == pytest.approx(0.03, abs=0.001)


@pytest.mark.first_case
@pytest.mark.parametrize("every", [1, 5, 20])
@pytest.mark.parametrize("effects", [None, ["command_delay", "motor_lag"]])
@pytest.mark.parametrize("lacking", [{}, {"viscous": 0.01}, {"sag_per_s": 0.012}], ids=str)
def test_whatever_a_drive_lacks_its_torques_are_not_late(lacking, effects, every):
    runs = [run(k, 0.02, push=0.03, every=every, **lacking) for k in (1, 2)]
    case = prepare(model(0.02), runs, effects=effects and told_apart(*effects))
    assert with_clocks_set(case, ["a", "b"]) == (case, [])


def test_a_drive_that_lacks_dry_friction_has_torques_that_are_not_late():
    case = prepare(model(0.02), [rubbed(k, viscous=0.0) for k in (1, 2)])
    assert with_clocks_set(case, ["a", "b"]) == (case, [])


def test_a_run_that_is_too_short_to_tell_hides_no_lateness():
    runs = [Clock("torque", 1.0, 0.02).apply(run(k, 0.02, push=0.01, seconds=s)) for k, s in ((1, 12.0), (2, 0.3))]
    (finding,) = with_clocks_set(prepare(model(0.02), runs), ["a", "b"])[1]
    assert finding.repairs[0].offset_s == pytest.approx(-0.02)


@pytest.mark.slow
@pytest.mark.parametrize("count", [6, pytest.param(24, marks=pytest.mark.slow)])
def test_torques_that_are_as_strong_as_assumed_are_noise_of_a_sound_drive(count):
    """One run in eight is off by more than twice what they leave on the average."""
    few = told_apart("viscous_friction")
    answers = [di.explain(model(0.033, 0.0033), run(k, 0.033, 0.0033, push=0.05), effects=few) for k in range(count)]
    assert sum(answer.verdict != "none" for answer in answers) <= count // 24


@pytest.mark.parametrize(("every", "warned"), [(1, False), (4, True)])
def test_torques_that_were_logged_more_rarely_than_the_encoder_are_said_to_be_held(every, warned):
    whole = run(1, 0.02)
    torque = whole.channels["torque"]
    rare = replace(torque, t=torque.t[::every], values=torque.values[::every])
    found = prepare(model(0.02), replace(whole, channels=whole.channels | {"torque": rare}))
    assert found.warning.startswith("torque was logged every 20 ms, the encoder every 5 ms") == warned
    assert bool(found.warning) == warned


@pytest.mark.slow
def test_a_run_may_be_logged_more_rarely_than_those_to_train_on():
    training = [run(40 + i, 0.02, viscous=0.01, most_rad_s2=30.0) for i in range(2)]
    seldom = run(42, 0.02, viscous=0.01, most_rad_s2=30.0, every=20)
    answer = di.explain(model(0.02), training, [seldom], told_apart("viscous_friction"))
    assert answer.verdict == "named" and [effect.name for effect in answer.effects] == ["viscous_friction"]


@pytest.mark.slow
def test_a_delay_adds_nothing_up_over_a_run_and_is_that_of_the_filter():
    runs = [Clock("encoder", 1.0, 0.03).apply(run(1, 0.02, push=0.01))]
    (effect,) = di.explain(model(0.02), runs, effects=told_apart("command_delay", "viscous_friction")).effects
    delay = effect.parameters["delay_s"]
    assert effect.name == "command_delay" and delay.least_squares is None
    assert delay.estimate == pytest.approx(0.03, abs=0.002)


def test_the_second_half_of_a_run_goes_on_where_the_first_ended():
    """A supply that sags has sagged by then."""
    case = prepare(model(0.02), [run(1, 0.02, sag_per_s=0.012)])
    (whole,), sag = case.prediction.tracks, {"battery_sag_time": {"rate_per_s": 0.012}}
    later = equal_parts(whole, 2, case.replay.settling_ticks)[1]
    (part,), (every,) = (predict(case.replay, [one], tune=False).residuals(sag) for one in (later, whole))
    rows = len(part["motion"])
    assert np.std(part["motion"]) == pytest.approx(np.std(every["motion"][-rows:]), rel=0.02)
