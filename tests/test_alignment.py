"""From logs to recordings: every sample lands on its own tick, though a log shows the value before each update."""

import dataclasses

import numpy as np
import pytest

from drake_ispace.alignment import to_recording
from drake_ispace.blocks.rates import TICK_S, VISION_TICKS
from drake_ispace.files.recording import load, validate
from drake_ispace.plants.omni import mass_matrix
from drake_ispace.rollout.engine import simulate_compiled
from drake_ispace.scenario import Scenario, load_scenario, read
from drake_ispace.simulation import Run, simulate

TICKS = 60
EXACT = [
    "seconds=1", "space.localizer.whole_pixels=false", "space.localizer.noise_std_pixels=0",
    "omni.trajectory.start_s=0.2", "pendulum.trajectory.start_s=0.2", "omni.encoder.counts_per_turn=0",
    "pendulum.encoder.counts_per_turn=0", "pendulum.imu.accelerometer_noise_density=0",
    "pendulum.imu.gyro_noise_density=0",
]


def at(ticks):
    return np.round(np.asarray(ticks) * TICK_S, 6)


def ticks_of(channel):
    ticks = np.round(channel.t / TICK_S).astype(int)
    assert np.array_equal(channel.t, at(ticks))
    return ticks


# ------------------------------------------------------------------------------------------------- made-up signals


def sampled(period, size):
    """A log (TICKS + 1, 1 + size) of a message: stamp, then 1000 times the stamp; row k shows what tick k - 1 left."""
    log = np.zeros((TICKS + 1, 1 + size))
    log[0, 0] = -1.0
    for row in range(1, TICKS + 1):
        stamp = period * ((row - 1) // period)
        log[row] = [stamp, *[1000.0 * stamp] * size]
    return log


@pytest.fixture
def made_up():
    """A run of the omni robot whose every signal tells its own tick."""
    row = np.arange(TICKS + 1.0)[:, None]
    fix = sampled(VISION_TICKS, 4)
    fix[1:, 1] = 1.0
    return Run(Scenario(), {
        "omni_pose": np.tile(row, 3), "omni_velocity": np.tile(-row, 3), "omni_encoder": sampled(1, 8),
        "omni_torque": np.tile(row - 1.0, 4), "omni_fix": fix, "omni_way_point": sampled(VISION_TICKS, 9),
    }, None, 1.0)


def test_made_up_truth_is_the_row_itself(made_up):
    truth = to_recording(made_up, "omni").channels["truth"]
    assert ticks_of(truth).tolist() == list(range(TICKS + 1))
    assert truth.column("x").tolist() == list(range(TICKS + 1))
    assert np.array_equal(truth.column("vx_w"), -truth.column("x"))


def test_made_up_encoder_samples_are_at_their_stamps(made_up):
    encoder = to_recording(made_up, "omni").channels["encoder"]
    assert ticks_of(encoder).tolist() == list(range(TICKS))
    assert np.array_equal(encoder.column("theta_1"), 1000.0 * np.arange(TICKS))


def test_made_up_torque_is_that_computed_at_its_tick(made_up):
    torque = to_recording(made_up, "omni").channels["torque"]
    assert ticks_of(torque).tolist() == torque.column("tau_4").tolist() == list(range(TICKS))


def test_made_up_way_points_and_fixes_are_there_once(made_up):
    channels = to_recording(made_up, "omni").channels
    assert ticks_of(channels["reference"]).tolist() == ticks_of(channels["kinect"]).tolist() == [0, 19, 38, 57]
    assert channels["reference"].column("phi").tolist() == channels["kinect"].column("phi").tolist() == [
        0.0, 19e3, 38e3, 57e3,
    ]


def test_made_up_fixes_without_latency_are_received_when_captured(made_up):
    kinect = to_recording(made_up, "omni").channels["kinect"]
    assert np.array_equal(kinect.column("t_received"), kinect.t)


def test_a_late_fix_is_received_where_the_log_first_shows_it(made_up):
    made_up.signals["omni_fix"] = np.vstack([np.tile([-1.0, 0, 0, 0, 0], (7, 1)), made_up.signals["omni_fix"][:-7]])
    kinect = to_recording(made_up, "omni").channels["kinect"]
    assert ticks_of(kinect).tolist() == [0, 19, 38]
    assert np.array_equal(kinect.column("t_received"), at([7, 26, 45]))


def test_a_fix_in_which_the_robot_was_not_seen_is_left_out(made_up):
    made_up.signals["omni_fix"][made_up.signals["omni_fix"][:, 0] == 19.0, 1] = 0.0
    assert ticks_of(to_recording(made_up, "omni").channels["kinect"]).tolist() == [0, 38, 57]


def test_a_robot_never_seen_has_no_kinect_channel(made_up):
    made_up.signals["omni_fix"][:, 1] = 0.0
    assert set(to_recording(made_up, "omni").channels) == {"reference", "torque", "encoder", "truth"}


# ------------------------------------------------------------------------------------------------------ simulated runs


def recorded(name, *overrides):
    run = simulate(load_scenario(name, [*EXACT, *overrides]))
    recordings = {robot: to_recording(run, robot) for robot in run.robots}
    for recording in recordings.values():
        validate(recording, name)
    return run, recordings


@pytest.fixture(scope="module")
def omni():
    run, recordings = recorded("omni_multirate", "omni.initial_pose=[-0.6, -0.6, 0.3]")  # so it has to turn
    return run, recordings["omni"].channels


@pytest.fixture(scope="module")
def pendulum():
    run, recordings = recorded("pendulum_multirate")
    return run, recordings["pendulum"].channels


def test_the_torque_of_a_tick_turns_the_robot_until_the_next(omni):
    run, channels = omni
    plant = run.scenario.omni.plant
    moment = channels["torque"].values @ plant.geometry.inverse[:, 2]
    turned = np.diff(channels["truth"].column("wz_w"))
    assert np.abs(moment).max() > 0.01
    assert turned == pytest.approx(TICK_S * moment / mass_matrix(plant)[2, 2], abs=1e-12)


def test_the_torque_of_a_tick_pushes_the_robot_until_the_next(omni):
    run, channels = omni
    plant = run.scenario.omni.plant
    force = channels["torque"].values @ plant.geometry.inverse[:, :2]
    phi = channels["truth"].column("phi")
    c, s = np.cos((phi[:-1] + phi[1:]) / 2.0), np.sin((phi[:-1] + phi[1:]) / 2.0)
    pushed = np.column_stack([c * force[:, 0] - s * force[:, 1], s * force[:, 0] + c * force[:, 1]])
    velocity = channels["truth"].values[:, 3:5]
    assert np.diff(velocity, axis=0) == pytest.approx(TICK_S * pushed / mass_matrix(plant)[0, 0], abs=1e-5)
    assert np.ptp(velocity) > 0.1


def test_omni_encoders_show_the_turning_of_the_same_instant(omni):
    run, channels = omni
    turned = channels["encoder"].values @ run.scenario.omni.plant.geometry.forward[2]
    phi = channels["truth"].column("phi")
    assert turned == pytest.approx(phi[:-1] - phi[0], abs=1e-12) and np.ptp(phi) > 0.1


def test_pendulum_encoders_show_the_turning_of_the_same_instant(pendulum):
    run, channels = pendulum
    plant = run.scenario.pendulum.plant
    right, left = channels["encoder"].values.T
    turned = (right - left) * plant.wheel_radius_m / (2.0 * plant.half_track_m)
    phi = channels["truth"].column("phi")
    assert turned == pytest.approx(phi[:-1] - phi[0], abs=1e-9)


def test_the_gyro_shows_the_tilt_rate_of_the_same_instant(pendulum):
    _, channels = pendulum
    rate = channels["truth"].column("tilt_rate")
    assert channels["imu"].column("wy") == pytest.approx(rate[:-1], abs=1e-12) and np.ptp(rate) > 0.1


def test_an_exact_camera_shows_the_pose_of_the_same_instant(omni):
    _, channels = omni
    seen = channels["kinect"]
    assert seen.values[:, :3] == pytest.approx(channels["truth"].values[ticks_of(seen), :3], abs=1e-12)
    assert ticks_of(seen).tolist() == list(range(0, 200, VISION_TICKS))


def test_the_way_point_of_a_tick_is_where_it_should_be_then(omni):
    _, channels = omni
    reference = channels["reference"]
    expected = -0.6 + 0.25 * np.maximum(reference.t - 0.2, 0.0)
    assert reference.column("x") == pytest.approx(expected, abs=1e-6)


@pytest.mark.parametrize("key", ["space.localizer.latency_ticks", "space.link.delay_ticks"])
@pytest.mark.parametrize("ticks", [0, 7, 25])
def test_a_fix_is_received_its_latency_later(key, ticks):
    _, recordings = recorded("omni_multirate", f"{key}={ticks}")
    kinect, truth = recordings["omni"].channels["kinect"], recordings["omni"].channels["truth"]
    received = np.round(kinect.column("t_received") / TICK_S).astype(int)
    assert np.array_equal(received - ticks_of(kinect), np.full(len(received), ticks))
    assert kinect.values[:, :3] == pytest.approx(truth.values[ticks_of(kinect), :3], abs=1e-12)


def test_dropouts_are_missing_and_the_others_right():
    _, recordings = recorded("omni_multirate", "space.localizer.dropout=0.5", "seconds=4")
    kinect, truth = recordings["omni"].channels["kinect"], recordings["omni"].channels["truth"]
    ticks = ticks_of(kinect)
    assert set(ticks) < set(range(0, 800, VISION_TICKS)) and 10 < len(ticks) < 35
    assert kinect.values[:, :3] == pytest.approx(truth.values[ticks, :3], abs=1e-12)


def test_two_robots_give_two_recordings():
    run, recordings = recorded("shared_space", "seconds=0.5")
    assert list(recordings) == ["omni", "pendulum"]
    for robot, recording in recordings.items():
        assert np.array_equal(recording.channels["truth"].values[:, :3], run.signals[f"{robot}_pose"])


def test_a_recording_on_disk_is_the_recording_in_memory(tmp_path, omni):
    run, channels = omni
    to_recording(run, "omni").save(tmp_path / "run")
    again = load(tmp_path / "run")
    assert again.notes == "simulated, seed 0" and list(again.channels) == list(channels)
    for name, channel in channels.items():
        assert np.array_equal(again.channels[name].values, channel.values)
        assert np.array_equal(again.channels[name].t, channel.t)


@pytest.mark.parametrize("name", ["omni_multirate", "omni_multirate_as_printed", "shared_space"])
def test_a_recording_repeats_its_run(tmp_path, name):
    run = simulate(load_scenario(name, ["seconds=0.2", "seed=3", "omni.plant.mass_kg=8.1"]))
    to_recording(run, "omni").save(tmp_path / "run")
    assert read(Scenario(), load(tmp_path / "run").settings, "run") == run.scenario
    again = load_scenario(str(tmp_path / "run" / "scenario.yaml"))
    assert again == run.scenario
    assert np.array_equal(simulate(again).signals["omni_pose"], run.signals["omni_pose"])


def test_every_fix_of_2000_is_received_in_its_own_tick():
    run = simulate_compiled(load_scenario("omni_multirate", ["seconds=190.5", "omni.trajectory.laps=0"]))
    kinect = to_recording(run, "omni").channels["kinect"]
    assert np.array_equal(ticks_of(kinect), VISION_TICKS * np.arange(len(kinect.t))) and len(kinect.t) > 2000
    assert np.array_equal(kinect.column("t_received"), kinect.t)


def test_a_run_of_one_tick_has_a_recording():
    run = simulate(dataclasses.replace(load_scenario("omni_multirate"), seconds=TICK_S))
    recording = to_recording(run, "omni")
    validate(recording, "run")
    assert {name: len(channel.t) for name, channel in recording.channels.items()} == {
        "reference": 1, "torque": 1, "encoder": 1, "kinect": 1, "truth": 2,
    }
