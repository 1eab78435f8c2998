"""What every robot answers: numbers that may be off, wheels by name, what it offers to effects, its dynamics."""

from dataclasses import replace

import numpy as np
import pytest

from drake_ispace.blocks.errors import InputError
from drake_ispace.files.recording import Channel
from drake_ispace.robots.library import robots
from drake_ispace.scenario import load_scenario

ROBOTS = robots()


def plant_of(name):
    return getattr(load_scenario("shared_space"), name).plant


@pytest.mark.parametrize(
    "name, number", [(name, number) for name in ("omni", "pendulum") for number in ROBOTS[name].numbers]
)
def test_a_number_that_is_off_is_off_by_its_share(name, number):
    robot, plant = ROBOTS[name], plant_of(name)
    changed = robot.scaled(plant, number, 0.25)
    fields = robot.numbers[number].fields
    assert [getattr(changed, f) for f in fields] == pytest.approx([1.25 * getattr(plant, f) for f in fields])
    assert {f for f in vars(plant) if getattr(plant, f) != getattr(changed, f)} == set(fields)


def test_the_rover_has_a_share_of_its_own_for_the_track():
    assert ROBOTS["rover"].scaled(plant_of("rover"), "track", 0.25).track_share == 0.25
    assert ROBOTS["rover"].scaled(plant_of("rover"), "radius", 0.25).wheel_radius_shares == [0.25] * 3


@pytest.mark.parametrize("name", ROBOTS)
def test_a_worn_wheel_is_worn_on_top_of_what_it_was(name):
    robot, plant = ROBOTS[name], plant_of(name)
    once = robot.worn(plant, 0.1, [1])
    assert once.wheel_radius_shares[:2] == [0.0, 0.1]
    assert robot.worn(once, 0.1, [0, 1]).wheel_radius_shares[:2] == pytest.approx([0.1, 0.21])


@pytest.mark.parametrize("name, wires", [
    ("omni", {"torque", "wheel_angle", "ground_force", "pose", "fix"}),
    ("pendulum", {"torque", "wheel_angle", "ground_force", "body_motion", "pose", "fix"}),
    ("rover", {"velocity", "wheel_angle", "pose", "fix"}),
])
def test_wires_that_take_an_effect(name, wires):
    robot = ROBOTS[name]
    assert robot.wires == wires
    assert robot.offers >= wires | set(robot.numbers) | {"slip"}
    assert ("traction" in robot.offers) == robot.has_traction_slip
    assert ("centre_of_gravity" in robot.offers) == robot.has_centre_of_gravity


def channel(*columns):
    return Channel([0.0, 1.0], columns, np.vstack([np.arange(len(columns)), np.ones(len(columns))]))


def test_columns_are_taken_by_the_names_of_wheels():
    robot, plant = ROBOTS["pendulum"], plant_of("pendulum")
    swapped = robot.by_wheel(channel("theta_l", "theta_r"), plant, "here")
    assert swapped.columns == ("theta_r", "theta_l") and swapped.values[0].tolist() == [1.0, 0.0]
    numbered = channel("theta_1", "theta_2")
    assert robot.by_wheel(numbered, plant, "here") is numbered


@pytest.mark.parametrize("columns, said", [
    (("theta_r",), "here has 1 columns, expected 2"), (("theta_r", "theta_x"), "has the columns theta_r, theta_x"),
    (("theta_r", "theta_1"), "expected one each of r or 1, l or 2"),
])
def test_columns_of_other_wheels_are_refused(columns, said):
    with pytest.raises(InputError, match=said):
        ROBOTS["pendulum"].by_wheel(channel(*columns), plant_of("pendulum"), "here")


def test_columns_that_are_missing_are_told_with_their_file():
    read = replace(channel("theta_r"), file="run/encoder.csv")
    with pytest.raises(InputError, match=r"\(run/encoder.csv\) has 1 columns, .* r or 1, l or 2, got theta_r"):
        ROBOTS["pendulum"].by_wheel(read, plant_of("pendulum"), "here")


@pytest.mark.parametrize("name", ["omni", "pendulum"])
def test_torque_on_the_wheels_moves_them_by_force_over_mass(name):
    robot, plant = ROBOTS[name], plant_of(name)
    mobility, effort = robot.mobility(plant), robot.effort(plant)
    assert effort.shape == (3, robot.wheel_count(plant))
    assert mobility == pytest.approx(effort.T @ np.linalg.inv(robot.mass_matrix(plant)) @ effort)
    assert mobility == pytest.approx(mobility.T) and (np.diag(mobility) > 0.0).all()


def test_the_axes_of_a_body_that_turns_turn_with_it():
    rates = np.array([[0.3, 0.2, 0.5]])
    assert ROBOTS["omni"].turning(rates).tolist() == [[-0.5 * 0.2, 0.5 * 0.3, 0.0]]


def test_wheels_that_turn_alike_turn_the_omni_robot():
    robot, plant = ROBOTS["omni"], plant_of("omni")
    velocity = robot.rates(plant, np.full((1, 4), 2.0), None)[0]
    assert velocity[:2] == pytest.approx([0.0, 0.0], abs=1e-12)
    assert abs(velocity[2]) == pytest.approx(2.0 * plant.wheel_radius_m / (plant.wheel_distance_m / 2.0))


def test_a_patch_has_to_have_an_inside():
    settings = load_scenario("omni_multirate").omni
    settings.plant.slip.patch_m = [0.0, 1.0, 0.5, 0.5]
    with pytest.raises(InputError, match=r"omni\.plant\.slip\.patch_m: expected x_min < x_max"):
        ROBOTS["omni"].check(settings, "omni")
    settings.plant.slip.patch_m = [0.5, 0.5, 0.0, 1.0]
    with pytest.raises(InputError, match=r"omni\.plant\.slip\.patch_m: expected x_min < x_max"):
        ROBOTS["omni"].check(settings, "omni")
    settings.plant.slip.patch_m = [0.0, 1.0, 0.4, 0.5]
    ROBOTS["omni"].check(settings, "omni")


@pytest.mark.parametrize("count, said", [(3, "expected a list of 4 values"), (4, None)])
def test_the_omni_robot_has_a_share_for_each_of_four_wheels(count, said):
    override = [f"omni.plant.wheel_radius_shares={[0.0] * (count - 1) + [0.1]}"]
    if said is None:
        assert load_scenario("omni_multirate", override).omni.plant.wheel_radius_shares == [0.0, 0.0, 0.0, 0.1]
        return
    with pytest.raises(InputError, match=said):
        load_scenario("omni_multirate", override)


def test_the_pendulum_moves_as_its_wheels_and_its_lean_say():
    robot, plant = ROBOTS["pendulum"], load_scenario("pendulum_multirate").pendulum.plant
    rates = robot.rates(plant, np.array([[4.5, 3.5]]), np.array([1.0]))  # relative to the body, which leans on
    assert rates[0] == pytest.approx([0.08 * (4.0 + 1.0), 0.08 * 1.0 / 0.4, 1.0])


def test_a_centre_of_gravity_may_be_lower_than_said_but_not_below_the_axle():
    robot, plant = ROBOTS["pendulum"], load_scenario("pendulum_multirate").pendulum.plant
    (height,) = robot.centre_of_gravity(plant)
    assert height.low == pytest.approx(-0.8 * plant.centre_of_gravity_m)
