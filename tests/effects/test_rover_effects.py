"""Effects of plant, ground, encoder and camera on a robot that is commanded by body velocity."""

import numpy as np
import pytest

from drake_ispace.alignment import to_recording
from drake_ispace.blocks.errors import InputError
from drake_ispace.effects.effect import Body, body_of
from drake_ispace.effects.library import library
from drake_ispace.plants.rover import WHEELS, RoverPlantParameters
from drake_ispace.plants.slip import Slip
from drake_ispace.plants.wheels import mecanum
from drake_ispace.robots.library import robots
from drake_ispace.rollout.engine import parity, simulate_compiled
from drake_ispace.scenario import Scenario, load_scenario

BODY = body_of(Scenario(), robots()["rover"])
NAMES = [name for name, effect in library().items() if effect.applies_to(BODY)]
SOME = {
    "wheel_radius_error": {"share": 0.05}, "single_wheel_radius_error": {"wheel": 2, "share": 0.03},
    "track_error": {"share": 0.05}, "constant_slip": {"ratio_x": 0.05}, "encoder_scale": {"share": 0.02},
    "encoder_lost_counts": {"wheel": 1, "share": 0.02}, "camera_scale": {"share": 0.02},
    "camera_latency": {"latency_s": 0.033}, "camera_dropouts": {"share": 0.2}, "clock_offset": {"offset_s": -0.02},
    "velocity_lag": {"time_constant_s": 0.05}, "cornering_slip": {"time_s": 0.04},
}
#: Every run lists them, so that one Diagram is compiled for all.
BLOCKS = ["rover.effects.encoder_scale={}", "rover.effects.camera_scale={}"]
EXACT = ["rover.encoder.counts_per_turn=0", "space.localizer.whole_pixels=false", "space.localizer.noise_std_pixels=0"]


def changed(name, plant=None, **values):
    effect, plant = library()[name], plant or RoverPlantParameters(wheels="mecanum")
    return effect.change(BODY.robot, plant, effect.neutral(Body(BODY.robot, plant, 4)) | values)


@pytest.mark.parametrize("wheels, said", [("mecanum", "of length and width together"), ("omni3", "")])
def test_of_wheels_with_askew_rollers_the_track_is_length_and_width_together(wheels, said):
    body = Body(BODY.robot, RoverPlantParameters(wheels=wheels), 4)
    assert library()["track_error"].called(body) == said and library()["wheel_radius_error"].called(body) == ""


def test_of_length_and_width_only_the_sum_shows_with_mecanum_wheels():
    longer, wider = (mecanum(0.05, *sizes).inverse for sizes in ((0.17, 0.14), (0.15, 0.16)))
    assert np.allclose(longer, wider)


def test_every_effect_but_those_of_forces_and_imu_applies():
    assert set(SOME) < set(NAMES) and {"velocity_delay", "camera_rotation", "marker_offset"} < set(NAMES)
    assert not {"mass_error", "motor_lag", "gyro_bias", "wheel_slip", "soft_floor"} & set(NAMES)


@pytest.mark.parametrize("wheels", [kind for kind, count in WHEELS.items() if count])
def test_radius_and_track_change_the_wheels_that_it_has_and_not_those_it_believes_in(wheels):
    nominal = RoverPlantParameters(wheels=wheels)
    grown = changed("single_wheel_radius_error", changed("wheel_radius_error", nominal, share=0.1), wheel=2, share=-0.2)
    shares = np.array([w.radius_m for w in grown.geometry.wheels]) / nominal.radius_m - 1.0
    assert shares == pytest.approx([0.1, 1.1 * 0.8 - 1.0, *[0.1] * (WHEELS[wheels] - 2)])
    wide = changed("track_error", changed("track_error", grown, share=0.1), share=0.1)
    assert wide.geometry.wheels[0].y_m == pytest.approx(1.21 * nominal.geometry.wheels[0].y_m)
    assert wide.nominal_geometry == nominal.geometry


def test_only_wheels_with_rollers_may_be_turned():
    toe, differential = library()["wheel_toe"], Body(BODY.robot, RoverPlantParameters(wheels="differential"), 2)
    assert toe.applies_to(BODY) and not toe.applies_to(differential)
    twice = changed("wheel_toe", changed("wheel_toe", wheel=3, angle_rad=0.1), wheel=3, angle_rad=0.05)
    assert twice.wheel_toe_rad == pytest.approx([0.0, 0.0, 0.15, 0.0])
    assert twice.nominal_geometry == RoverPlantParameters(wheels="mecanum").geometry != twice.geometry


def test_slip_adds_to_what_the_plant_has():
    plant = RoverPlantParameters(slip=Slip(ratio=[0.1, 0.0, 0.2]))
    assert changed("constant_slip", plant, ratio_x=0.05, ratio_y=0.3).slip.ratio == pytest.approx([0.15, 0.3, 0.2])
    differential = Body(BODY.robot, RoverPlantParameters(wheels="differential"), 2)
    assert [p.name for p in library()["constant_slip"].parameters_of(differential)] == ["ratio"]


@pytest.mark.parametrize("name", ["velocity_base", "odometry_replay"])
def test_at_neutral_values_the_run_is_the_base_run(name):
    body = body_of(load_scenario(name), BODY.robot)
    every = {effect: {} for effect in NAMES if library()[effect].applies_to(body)}
    alone = simulate_compiled(load_scenario(name, ["seconds=5"]))
    listed = simulate_compiled(load_scenario(name, ["seconds=5", f"rover.effects={every}"]))
    for signal, rows in alone.signals.items():
        assert np.array_equal(rows, listed.signals[signal]), signal


@pytest.mark.slow
def test_drake_and_the_compiled_rollout_agree_to_the_bit():
    every = {effect: {} for effect in NAMES} | SOME
    assert parity(load_scenario("velocity_base", ["seconds=4", f"rover.effects={every}"]))["max_abs_difference"] == 0.0


def ratios(*effects):
    """Way and turn seen by the camera over those of odometry, and wheel angle over the one commanded."""
    circle = ["rover.plant.wheels=differential", "rover.trajectory={kind: circle, heading: tangent, start_s: 0.0}"]
    run = simulate_compiled(load_scenario("odometry_replay", [
        "seconds=8", *EXACT, *circle, *BLOCKS, *[f"rover.effects.{e}" for e in effects],
    ]))
    channels, odometry = to_recording(run, "rover").channels, run.signals["rover_odometry"][1:, 1:]
    seen = channels["kinect"].values[:, :3]
    odometry = odometry[np.round(channels["kinect"].t / 0.005).astype(int)]
    way = [np.hypot(*np.diff(rows[:, :2], axis=0).T).sum() for rows in (seen, odometry)]
    turn = [np.unwrap(rows[:, 2])[-1] - rows[0, 2] for rows in (seen, odometry)]
    told = channels["command"].column("vx")[: len(channels["encoder"].t) - 1].sum() * 0.005 / 0.05
    return [way[0] / way[1], turn[0] / turn[1], channels["encoder"].values[-1].mean() / told]


@pytest.mark.parametrize("effect, way, turn, wheel", [
    ("wheel_radius_error.share=0.1", 1.1, 1.1, 1.0),
    ("track_error.share=0.1", 1.0, 1.0 / 1.1, 1.0),
    ("constant_slip.ratio=0.1", 0.9, 1.0, 1.0),
    ("encoder_scale.share=0.1", 1.0 / 1.1, 1.0 / 1.1, 1.1),
    ("camera_scale.share=0.1", 1.1, 1.0, 1.0),
])
def test_each_has_its_own_signature(effect, way, turn, wheel):
    assert ratios(effect) == pytest.approx([way, turn, wheel], rel=2e-3)


@pytest.mark.parametrize("override, message", [
    ("single_wheel_radius_error.wheel=4", r"rover.effects.single_wheel_radius_error.wheel: expected at most 3"),
    ("constant_slip.ratio=0.1", "constant_slip.ratio: unknown parameter, did you mean 'ratio_y'"),
    ("mass_error.share=0.1", "rover cannot have it, expected an effect of omni, pendulum"),
])
def test_bad_values_are_refused(override, message):
    with pytest.raises(InputError, match=message):
        load_scenario("velocity_base", [f"rover.effects.{override}"])
