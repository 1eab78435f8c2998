"""velocity_base and odometry_replay: they follow their path, whatever the wheels, in Drake and compiled."""

import numpy as np
import pytest

from drake_ispace.alignment import to_recording
from drake_ispace.blocks.errors import InputError
from drake_ispace.blocks.rates import TICK_S
from drake_ispace.comparison import compare
from drake_ispace.files.recording import load, validate
from drake_ispace.metrics import measure
from drake_ispace.rollout.engine import parity, simulate_compiled
from drake_ispace.scenario import load_scenario
from drake_ispace.wiring.catalog import build_diagram

TANGENT = "rover.trajectory.heading=tangent"
IDEAL = ["rover.encoder.counts_per_turn=0", "space.localizer.whole_pixels=false", "space.localizer.noise_std_pixels=0"]
EFFECTS = ["rover.effects.velocity_delay.delay_s=0.012", "rover.effects.velocity_lag.time_constant_s=0.03"]


def run(name, *overrides, seconds=22):
    return simulate_compiled(load_scenario(name, [f"seconds={seconds}", *overrides]))


@pytest.mark.parametrize("wheels", ["omni3", "omni4", "mecanum"])
def test_it_tracks_a_square(wheels):
    metrics = measure(run("velocity_base", f"rover.plant.wheels={wheels}"), "rover")
    assert metrics.rms_cross_track_m < 4e-3
    assert metrics.rms_position_error_m < 0.01 and metrics.final_error_m < 5e-3
    assert metrics.control_effort is None


def test_a_differential_drive_tracks_a_square_but_for_its_corners():
    metrics = measure(run("velocity_base", "rover.plant.wheels=differential", TANGENT), "rover")
    assert metrics.rms_cross_track_m < 0.04 and metrics.final_error_m < 5e-3


def test_a_differential_drive_tracks_a_circle():
    circle = ["rover.plant.wheels=differential", TANGENT, "rover.trajectory.kind=circle"]
    assert measure(run("velocity_base", *circle), "rover").rms_cross_track_m < 3e-3


@pytest.mark.parametrize("name, wheels", [
    ("velocity_base", "omni3"), ("velocity_base", "mecanum"), ("odometry_replay", "differential"),
])
def test_without_slip_odometry_is_the_truth(name, wheels):
    signals = run(name, *IDEAL, TANGENT, f"rover.plant.wheels={wheels}").signals
    # chords for arcs in the four corners, where the robot turns at 4.7 rad/s
    assert np.abs(signals["rover_odometry"][1:, 1:] - signals["rover_pose"][:-1]).max() < 2e-6
    assert np.ptp(signals["rover_pose"], axis=0) == pytest.approx([1.2, 1.2, 1.5 * np.pi], abs=0.2)


def test_with_slip_the_room_keeps_the_robot_on_its_path_and_odometry_alone_does_not():
    slip = "rover.plant.slip.ratio=[0.1, 0.1, 0.1]"
    held = measure(run("velocity_base", "rover.plant.wheels=differential", TANGENT, slip), "rover")
    alone = measure(run("odometry_replay", slip), "rover")
    assert held.final_error_m < 0.01 < 0.2 < alone.final_error_m


def test_a_larger_wheel_shows_between_encoder_and_room_and_not_between_command_and_encoder():
    recording = to_recording(run("odometry_replay", *IDEAL, "rover.plant.wheel_radius_shares=[0.05, 0.05]"), "rover")
    command, encoder, truth = (recording.channels[name] for name in ("command", "encoder", "truth"))
    turned = (encoder.values[-1] - encoder.values[0]).mean()
    told = command.column("vx")[: len(encoder.t) - 1].sum() * TICK_S
    driven = np.hypot(*np.diff(truth.values[: len(encoder.t), :2], axis=0).T).sum()
    assert turned * 0.05 == pytest.approx(told, rel=1e-9)
    assert driven == pytest.approx(1.05 * told, rel=1e-4)


@pytest.mark.parametrize("name, overrides", [
    ("velocity_base", []),
    ("velocity_base", [*EFFECTS, "rover.plant.slip.ratio=[0.1, 0.1, 0.1]", "rover.plant.wheels=mecanum"]),
    ("odometry_replay", ["rover.plant.slip.patch_m=[0, 1, 0, 1]", "rover.plant.slip.patch_ratio=[0.2, 0.2, 0.1]"]),
])
def test_drake_and_the_compiled_rollout_agree_to_the_bit(name, overrides):
    result = parity(load_scenario(name, ["seconds=8", *overrides]))
    assert result["max_abs_difference"] == 0.0 and result["ticks"] == 1600


def test_the_command_of_a_tick_moves_the_robot_until_the_next(tmp_path):
    recording = to_recording(run("velocity_base", *IDEAL, "rover.trajectory.heading_rad=0.3", seconds=3), "rover")
    validate(recording, "rover")
    command, truth = recording.channels["command"], recording.channels["truth"]
    assert command.columns == ("vx", "vy", "wz") and command.t[0] == 0.0
    phi, step = truth.column("phi"), np.diff(truth.values[:, :3], axis=0)
    assert step[:, 2] == pytest.approx(TICK_S * command.column("wz"), abs=1e-12)
    middle = 0.5 * (phi[:-1] + phi[1:])
    along = np.cos(middle) * command.column("vx") - np.sin(middle) * command.column("vy")
    assert step[:, 0] == pytest.approx(TICK_S * along, abs=1e-9) and np.ptp(along) > 0.1
    recording.save(tmp_path / "run")
    again = load(tmp_path / "run")
    assert again.robot == "rover" and list(again.channels["encoder"].columns) == ["theta_1", "theta_2", "theta_3"]
    assert np.array_equal(again.channels["command"].values, command.values)


def test_a_comparison_drives_both_on_one_reference():
    first = load_scenario("velocity_base", ["seconds=3", "rover.initial_pose=[-0.5, -0.6, 0.0]"])
    results = compare({"a": first, "b": load_scenario("odometry_replay"), "c": load_scenario("omni_multirate")})
    assert [robot for _, robot, _ in results.values()] == ["rover", "rover", "omni"]
    starts = [run.signals[f"{robot}_pose"][0, :2].tolist() for run, robot, _ in results.values()]
    assert starts == [[-0.5, -0.6], [-0.5, -0.6], [-0.6, -0.6]]


def test_a_fixed_heading_is_refused_for_wheels_that_hold_sideways():
    with pytest.raises(InputError, match=r"rover.trajectory.heading: expected tangent, the wheels of a differential"):
        build_diagram(load_scenario("velocity_base", ["rover.plant.wheels=differential"]))
