"""Wrong numbers of the robot: which number changes by how much, what odometry makes of it, what neutral ones leave."""

import dataclasses
from dataclasses import replace

import numpy as np
import pytest

from drake_ispace.blocks.errors import InputError
from drake_ispace.control.feedback.balance_gains import balance_gain
from drake_ispace.control.feedback.omni_gains import omni_gains
from drake_ispace.effects.effect import Body
from drake_ispace.effects.library import library
from drake_ispace.effects.places.plant import EFFECTS
from drake_ispace.plants.omni import OmniPlant, OmniPlantParameters
from drake_ispace.plants.pendulum import PendulumPlant, PendulumPlantParameters
from drake_ispace.robots.library import robots
from drake_ispace.rollout.engine import parity
from drake_ispace.scenario import load_scenario
from drake_ispace.simulation import simulate

OMNI, PENDULUM = OmniPlantParameters(), PendulumPlantParameters()
ROBOT = {type(OMNI): robots()["omni"], type(PENDULUM): robots()["pendulum"]}
BODIES = [Body(ROBOT[type(OMNI)], OMNI, 4), Body(ROBOT[type(PENDULUM)], PENDULUM, 2)]

CHANGES = [
    ("mass_error", OMNI, {"share": 0.2}, {"mass_kg": 8.772}),
    ("mass_error", PENDULUM, {"share": -0.2}, {"body_mass_kg": 2.8}),
    ("inertia_error", OMNI, {"share": 0.5}, {"inertia_kg_m2": 0.10935}),
    ("inertia_error", PENDULUM, {"share": 1.0}, {"body_inertia_pitch_kg_m2": 0.0017}),
    ("yaw_inertia_error", PENDULUM, {"share": 0.2},
     {"body_inertia_yaw_kg_m2": 0.0306, "body_inertia_roll_kg_m2": 0.0306}),
    ("drive_inertia", OMNI, {"inertia_kg_m2": 1e-5}, {"wheel_inertia_kg_m2": 1.1e-5}),
    ("drive_inertia", PENDULUM, {"inertia_kg_m2": 0.002}, {"drive_inertia_kg_m2": 0.002}),
    ("centre_of_gravity_offset", OMNI, {"x_m": 0.03, "y_m": -0.02}, {"centre_of_gravity_m": [0.03, -0.02]}),
    ("centre_of_gravity_offset", PENDULUM, {"height_m": -0.01}, {"centre_of_gravity_m": 0.03}),
    ("wheel_radius_error", OMNI, {"share": 0.25}, {"wheel_radius_m": 0.03}),
    ("wheel_radius_error", PENDULUM, {"share": -0.25}, {"wheel_radius_m": 0.06}),
    ("single_wheel_radius_error", OMNI, {"wheel": 3, "share": 0.1}, {"wheel_radius_shares": [0.0, 0.0, 0.1, 0.0]}),
    ("single_wheel_radius_error", PENDULUM, {"wheel": 2, "share": 0.1}, {"wheel_radius_shares": [0.0, 0.1]}),
    ("wheel_toe", OMNI, {"wheel": 3, "angle_rad": 0.1}, {"wheel_toe_rad": [0.0, 0.0, 0.1, 0.0]}),
    ("track_error", OMNI, {"share": 0.1}, {"wheel_distance_m": 0.396}),
    ("track_error", PENDULUM, {"share": 0.1}, {"half_track_m": 0.22}),
]


@pytest.mark.parametrize("name, plant, values, changed", CHANGES)
def test_an_effect_changes_its_own_numbers_only(name, plant, values, changed):
    before = dataclasses.asdict(plant)
    after = dataclasses.asdict(library()[name].change(ROBOT[type(plant)], plant, values))
    differing = {key: value for key, value in after.items() if value != before[key]}
    assert set(differing) == set(changed)
    for key, value in changed.items():
        assert differing[key] == pytest.approx(value, rel=1e-12)
    assert dataclasses.asdict(plant) == before


@pytest.mark.parametrize("body", BODIES, ids=lambda body: body.name)
def test_neutral_values_change_no_bit(body):
    odd = {"omni": {"centre_of_gravity_m": [0.013, -0.007]}, "pendulum": {"centre_of_gravity_m": 0.0371}}[body.name]
    odd |= {"wheel_radius_shares": [0.05, -0.07, 0.01, 0.03][: body.wheels]}
    for plant in (body.plant, replace(body.plant, **odd)):
        for effect in EFFECTS:
            if effect.applies_to(body):
                neutral = effect.neutral(replace(body, plant=plant))
                assert effect.change(body.robot, plant, neutral) == plant, effect.card.name


@pytest.mark.parametrize("body", BODIES, ids=lambda body: body.name)
def test_every_number_a_fit_may_try_makes_a_plant(body):
    kind = OmniPlant if body.plant is OMNI else PendulumPlant
    for effect in EFFECTS:
        if not effect.applies_to(body):
            continue
        for parameter in effect.parameters_of(body):
            assert parameter.low <= min(parameter.probes) <= max(parameter.probes) <= parameter.high
            for value in (parameter.low, parameter.high):
                kind(effect.change(body.robot, body.plant, effect.neutral(body) | {parameter.name: value}))


def test_both_radius_errors_multiply():
    plant = library()["single_wheel_radius_error"].change(ROBOT[type(PENDULUM)], PENDULUM, {"wheel": 1, "share": 0.1})
    plant = library()["single_wheel_radius_error"].change(ROBOT[type(PENDULUM)], plant, {"wheel": 1, "share": 0.1})
    plant = library()["wheel_radius_error"].change(ROBOT[type(PENDULUM)], plant, {"share": 0.1})
    assert [wheel.radius_m for wheel in plant.geometry.wheels] == pytest.approx([0.08 * 1.1**3, 0.08 * 1.1])


def moved(name, values, velocity):
    """What nominal odometry makes of the omni robot's `velocity` in B: v [m/s, m/s, rad/s]."""
    plant = library()[name].change(ROBOT[type(OMNI)], OMNI, values)
    return OMNI.geometry.forward @ plant.geometry.inverse @ velocity


def test_odometry_believes_in_the_nominal_robot():
    velocity = np.array([0.4, -0.2, 1.1])
    # the robot goes (1 + share) as far as odometry says, and turns 1/(1 + share) of it
    assert 1.1 * moved("wheel_radius_error", {"share": 0.1}, velocity) == pytest.approx(velocity)
    assert moved("track_error", {"share": 0.1}, velocity) == pytest.approx([0.4, -0.2, 1.21])
    # wheel 1 drives along +y at 0.18 m: it counts 1/1.25 of its way, 0.08 m/s less of 0.4
    straight = moved("single_wheel_radius_error", {"wheel": 1, "share": 0.25}, np.array([0.0, 0.4, 0.0]))
    assert straight == pytest.approx([0.0, 0.36, -0.08 / 4.0 / 0.18])
    # wheel 2 drives along -x at 0.18 m: turned by 90 degrees of a small angle it counts the way along -y as its own
    across = moved("wheel_toe", {"wheel": 2, "angle_rad": 0.1}, np.array([0.0, 0.4, 0.0]))
    missed = -0.4 * np.sin(0.1)
    assert across == pytest.approx([-missed / 2.0, 0.4, missed / 4.0 / 0.18])


@pytest.mark.parametrize("bad, message", [
    ("mass_error.share=-0.7", "at least -0.6"), ("inertia_error.share=4", "at most 3"),
    ("yaw_inertia_error.share=0.1", "omni cannot have it"), ("wheel_radius_error.share=true", "expected a number"),
    ("centre_of_gravity_offset.height_m=0.1", "unknown parameter"), ("track_error.share=-0.7", "at least -0.6"),
    ("centre_of_gravity_offset.x_m=1", "at most 0.15"), ("single_wheel_radius_error.wheel=5", "at most 4"),
    ("single_wheel_radius_error.wheel=1.5", "expected a whole number"),
])
def test_bad_values_are_refused(bad, message):
    with pytest.raises(InputError, match=message):
        load_scenario("omni_multirate", [f"omni.effects.{bad}"])


@pytest.mark.parametrize("bad", [
    "omni.plant.wheel_radius_shares=[0.1]", "omni.plant.wheel_radius_shares=[0, 0, 0, -1]",
    "pendulum.plant.wheel_radius_shares=[0, 0, 0]", "omni.plant.centre_of_gravity_m=[0.1]",
])
def test_bad_numbers_of_a_plant_are_refused(bad):
    with pytest.raises(InputError):
        load_scenario("omni_multirate", [bad])


def test_the_pendulums_centre_of_gravity_stays_above_the_axle():
    with pytest.raises(InputError, match=r"at least -0\.032"):
        load_scenario("pendulum_multirate", ["pendulum.effects.centre_of_gravity_offset.height_m=-0.04"])


def test_the_controller_does_not_know():
    effects = ["mass_error.share=0.5", "inertia_error.share=0.5", "wheel_radius_error.share=0.1"]
    gains = {
        "omni": lambda s: omni_gains(s.omni.plant, s.omni.control, 0.005),
        "pendulum": lambda s: balance_gain(s.pendulum.plant, s.pendulum.control),
    }
    for robot, gain in gains.items():
        wrong = load_scenario(f"{robot}_multirate", [f"{robot}.effects.{effect}" for effect in effects])
        np.testing.assert_array_equal(gain(wrong), gain(load_scenario(f"{robot}_multirate")))


@pytest.mark.first_case
@pytest.mark.parametrize("robot", ["omni", "pendulum"])
def test_neutral_effects_change_no_bit_and_others_agree_with_drake(robot):
    scenario = load_scenario(f"{robot}_multirate", ["seconds=1"])
    body = next(body for body in BODIES if body.name == robot)
    base = simulate(scenario).signals
    getattr(scenario, robot).effects = {effect.card.name: {} for effect in EFFECTS if effect.applies_to(body)}
    neutral = simulate(scenario).signals
    assert all(np.array_equal(rows, neutral[name], equal_nan=True) for name, rows in base.items())
    offset = {"x_m": 0.05, "y_m": -0.03} if robot == "omni" else {"height_m": 0.01}
    getattr(scenario, robot).effects = {
        "mass_error": {"share": 0.2}, "inertia_error": {"share": 0.3}, "centre_of_gravity_offset": offset,
        "wheel_radius_error": {"share": -0.02}, "single_wheel_radius_error": {"wheel": 2, "share": 0.03},
        "track_error": {"share": 0.05},
    } | ({} if robot == "omni" else {"yaw_inertia_error": {"share": 0.3}})
    assert parity(scenario)["max_abs_difference"] == 0.0
    assert np.abs(simulate(scenario).signals[f"{robot}_pose"] - base[f"{robot}_pose"]).max() > 1e-4
