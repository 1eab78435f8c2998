"""A robot commanded by body velocity: its wheels, its motion, and what errors of radius and track do to both."""

import dataclasses

import numpy as np
import pytest
from pydrake.autodiffutils import AutoDiffXd
from pydrake.systems.analysis import Simulator

from drake_ispace.blocks.errors import InputError
from drake_ispace.blocks.rates import TICK_S
from drake_ispace.control.feedback.velocity_command import VelocityCommand, VelocityControl
from drake_ispace.plants.rover import WHEELS, RoverPlant, RoverPlantParameters, block_parameters
from drake_ispace.plants.slip import Slip
from drake_ispace.plants.wheels import differential, mecanum, omni3, omni4
from drake_ispace.robots.library import robots
from drake_ispace.scenario import load_scenario

COMMAND = np.array([0.3, -0.2, 0.5])
KINDS = pytest.mark.parametrize("kind", [kind for kind, count in WHEELS.items() if count])


def context_of(plant, command=COMMAND):
    context = plant.CreateDefaultContext()
    plant.get_input_port().FixValue(context, command)
    return context


def outputs(parameters, phi=0.0, command=COMMAND):
    """Body velocity (3,) and wheel rates (n,)."""
    plant = RoverPlant(parameters, (0.1, 0.2, phi))
    context = context_of(plant, command)
    vx, vy, wz = plant.GetOutputPort("velocity").Eval(context)
    c, s = np.cos(phi), np.sin(phi)
    return np.array([c * vx + s * vy, -s * vx + c * vy, wz]), plant.GetOutputPort("wheel_rate").Eval(context)


# -- Geometry


def test_each_name_is_its_layout():
    p = RoverPlantParameters()
    expected = {
        "omni3": omni3(p.radius_m, p.centre_distance_m, p.first_rad),
        "omni4": omni4(p.radius_m, 2.0 * p.centre_distance_m), "differential": differential(p.radius_m, p.half_track_m),
        "mecanum": mecanum(p.radius_m, p.half_length_m, p.half_width_m),
    }
    assert set(expected) == {kind for kind, count in WHEELS.items() if count}
    for name, geometry in expected.items():
        plant = RoverPlantParameters(wheels=name, first_rad=0.0 if name == "omni4" else p.first_rad)
        assert plant.geometry == plant.nominal_geometry == geometry
        assert len(geometry.wheels) == WHEELS[name]


def test_shares_change_radius_and_track_of_the_real_geometry_only():
    plant = RoverPlantParameters(wheels="differential", wheel_radius_shares=[0.1, 0.0], track_share=0.2)
    right, left = plant.geometry.wheels
    assert (right.radius_m, left.radius_m) == (pytest.approx(0.055), 0.05)
    assert (right.y_m, left.y_m) == (pytest.approx(-0.18), pytest.approx(0.18))
    assert plant.nominal_geometry == differential(0.05, 0.15)


def test_a_wheel_that_is_turned_rolls_along_its_new_direction():
    plant = RoverPlantParameters(wheels="omni4", first_rad=0.0, wheel_toe_rad=[0.0, 0.1, 0.0, 0.0])
    turned = plant.geometry.wheels[1]
    assert turned.drive_rad == pytest.approx(plant.nominal_geometry.wheels[1].drive_rad + 0.1)
    assert turned.row() @ [0.0, 1.0, 0.0] == pytest.approx(-np.sin(0.1) / 0.05)


@pytest.mark.parametrize("toe, message", [
    ("rover.plant.wheel_toe_rad=[0.1, 0]", "the tyres of differential wheels cannot move sideways"),
    ("rover.effects.wheel_toe={}", "rover cannot have it on these wheels"),
])
def test_tyres_that_hold_sideways_have_no_toe(toe, message):
    with pytest.raises(InputError, match=message):
        load_scenario("velocity_base", ["rover.plant.wheels=differential", toe])


# -- Motion


@KINDS
@pytest.mark.parametrize("phi", [0.0, 0.7, -2.5])
def test_the_body_does_what_it_is_told_but_for_what_plain_tyres_hold(kind, phi):
    expected = COMMAND * [1.0, 0.0, 1.0] if kind == "differential" else COMMAND
    body, rates = outputs(RoverPlantParameters(wheels=kind), phi)
    assert body == pytest.approx(expected, abs=1e-14)
    assert rates == pytest.approx(RoverPlantParameters(wheels=kind).geometry.inverse @ expected, abs=1e-13)


def test_a_differential_drive_by_hand():
    body, rates = outputs(RoverPlantParameters(wheels="differential"), command=[0.2, 0.7, 1.0])
    assert body == pytest.approx([0.2, 0.0, 1.0])
    assert rates == pytest.approx([(0.2 + 0.15) / 0.05, (0.2 - 0.15) / 0.05])


def test_a_larger_wheel_moves_the_robot_and_leaves_the_wheels_speed():
    grown = RoverPlantParameters(wheels="differential", wheel_radius_shares=[0.1, 0.0])
    body, rates = outputs(grown, command=[0.2, 0.0, 0.0])
    assert rates == pytest.approx([4.0, 4.0])
    assert body == pytest.approx([(0.22 + 0.20) / 2.0, 0.0, (0.22 - 0.20) / 0.3])


def test_a_wider_track_turns_less():
    body, rates = outputs(RoverPlantParameters(wheels="mecanum", track_share=0.25), command=[0.2, 0.1, 1.0])
    assert body == pytest.approx([0.2, 0.1, 0.8])
    assert rates == pytest.approx(RoverPlantParameters(wheels="mecanum").geometry.inverse @ [0.2, 0.1, 1.0])


@KINDS
def test_slip_slows_the_robot_and_not_its_wheels(kind):
    slipping = RoverPlantParameters(wheels=kind, slip=Slip(ratio=[0.1, 0.2, 0.3]))
    plant, free = RoverPlant(slipping, (0.0, 0.0, 0.4)), RoverPlant(RoverPlantParameters(wheels=kind), (0, 0, 0.4))
    rates = plant.EvalTimeDerivatives(context_of(plant)).CopyToVector()
    ideal = free.EvalTimeDerivatives(context_of(free)).CopyToVector()
    turn = np.array([[np.cos(0.4), -np.sin(0.4), 0], [np.sin(0.4), np.cos(0.4), 0], [0, 0, 1.0]])
    assert rates[:3] == pytest.approx(turn @ np.diag([0.9, 0.8, 0.7]) @ turn.T @ ideal[:3], abs=1e-14)
    assert rates[3:] == pytest.approx(ideal[3:], abs=0.0)


def test_a_patch_slips_inside_only():
    slip = Slip(patch_m=[0.0, 1.0, 0.0, 1.0], patch_ratio=[0.5, 0.5, 0.5])
    for place, speed in (((0.5, 0.5, 0.0), 0.15), ((-0.5, 0.5, 0.0), 0.3)):
        plant = RoverPlant(RoverPlantParameters(slip=slip), place)
        rates = plant.EvalTimeDerivatives(context_of(plant, [0.3, 0.0, 0.0])).CopyToVector()
        assert rates[0] == pytest.approx(speed)


def test_driving_in_a_circle_closes_it():
    plant = RoverPlant(RoverPlantParameters(wheels="differential"))
    simulator = Simulator(plant)
    plant.get_input_port().FixValue(simulator.get_mutable_context(), [0.3, 0.0, 0.5])
    simulator.AdvanceTo(4.0 * np.pi)
    x, y, phi, right, left = simulator.get_context().get_continuous_state_vector().CopyToVector()
    assert (x, y, phi) == (pytest.approx(0.0, abs=1e-4), pytest.approx(0.0, abs=1e-4), pytest.approx(2.0 * np.pi))
    assert right - left == pytest.approx(0.3 / 0.05 * 2.0 * np.pi)


def test_it_works_with_automatic_differentiation():
    plant = RoverPlant(RoverPlantParameters()).ToAutoDiffXd()
    context = plant.CreateDefaultContext()
    plant.get_input_port().FixValue(context, [AutoDiffXd(0.2, [1.0]), AutoDiffXd(0.0, [0.0]), AutoDiffXd(0.0, [0.0])])
    rates = plant.EvalTimeDerivatives(context).CopyToVector()
    assert rates[0].value() == pytest.approx(0.2) and rates[0].derivatives()[0] == pytest.approx(1.0)


# -- Run-time numbers and refusals


def test_block_parameters_are_those_of_the_block():
    changed = RoverPlantParameters(wheels="mecanum", wheel_radius_shares=[0.1, 0, 0, 0], slip=Slip(ratio=[0.1] * 3))
    values = block_parameters(changed)
    assert RoverPlant(changed).spec.parameters.keys() == values.keys() == {"wheels", "projection", "slip"}
    neutral = RoverPlant(RoverPlantParameters(wheels="mecanum")).spec
    assert dataclasses.replace(neutral, parameters=values).parameter_names == neutral.parameter_names


@pytest.mark.parametrize("override, message", [
    ("rover.plant.wheel_radius_shares=[0.1]", r"rover.plant.wheel_radius_shares: expected 3 values for omni3 or null"),
    ("rover.plant.wheel_radius_shares=[-1, 0, 0]", "expected more than -1"),
    ("rover.plant.wheel_toe_rad=[0.1]", r"rover.plant.wheel_toe_rad: expected 3 values for omni3 or null"),
    ("rover.plant.wheel_toe_rad=[1, 0, 0]", "expected at most 0.5"),
    ("rover.plant.slip.traction_gain=[0.1, 0, 0]", r"rover.plant.slip.traction_gain: expected zeros"),
    ("rover.plant.slip.noise_std=[0.1, 0, 0]", r"rover.plant.slip.noise_std: expected zeros"),
    ("rover.plant.wheels=caster", "expected one of omni3, omni4, differential, mecanum"),
    ("rover.plant.radius_m=0", "expected more than 0"),
    ("rover.initial_pose=[9, 0, 0]", "lies outside"),
    ("rover.effects.motor_lag={}", "rover cannot have it, expected an effect of omni, pendulum"),
    ("omni.effects.velocity_lag={}", "omni cannot have it, expected an effect of rover"),
])
def test_bad_values_are_refused(override, message):
    with pytest.raises(InputError, match=message):
        load_scenario("velocity_base", [override])


# -- The command


def commanded(estimate, way_point, holds_sideways=False):
    block = VelocityCommand(VelocityControl(position_per_s=2.0, heading_per_s=3.0, side_rad_m2=10.0), holds_sideways)
    context = block.CreateDefaultContext()
    block.GetInputPort("estimate").FixValue(context, estimate)
    block.GetInputPort("way_point").FixValue(context, way_point)
    simulator = Simulator(block, context)
    simulator.AdvanceTo(0.5 * TICK_S)
    return block.get_output_port().Eval(simulator.get_context())


WAY_POINT = [0.0, 0.5, 0.1, 0.2, 0.3, 0.0, 0.1, 0.0, 0.0, 0.0]  # at x 0.5, y 0.1, phi 0.2; vx 0.3, wz 0.1


def test_on_the_way_point_the_command_is_fed_forward():
    assert commanded([0.0, 0.5, 0.1, 0.2], WAY_POINT) == pytest.approx(
        [0.3 * np.cos(0.2), -0.3 * np.sin(0.2), 0.1], abs=1e-15
    )


def test_beside_it_the_command_leads_back():
    assert commanded([0.0, 0.4, 0.2, 0.0], WAY_POINT) == pytest.approx([0.5, -0.2, 0.1 + 0.6])


def test_wheels_that_hold_sideways_turn_back_instead():
    assert commanded([0.0, 0.4, 0.2, 0.0], WAY_POINT, True) == pytest.approx([0.5, 0.0, 0.7 + 10.0 * 0.5 * -0.1])


@pytest.mark.parametrize("message", [0, 1])
def test_without_way_point_or_estimate_it_stands_still(message):
    estimate, way_point = [0.0, 0.4, 0.2, 0.0], list(WAY_POINT)
    (estimate, way_point)[message][0] = -1.0
    assert not commanded(estimate, way_point).any()


@pytest.mark.parametrize("kind", ["omni3", "omni4", "mecanum"])
def test_the_pose_moves_with_the_commanded_velocity_turned_into_the_room(kind):
    phi = 0.7
    plant = RoverPlant(RoverPlantParameters(wheels=kind), (0.1, 0.2, phi))
    rates = plant.EvalTimeDerivatives(context_of(plant)).CopyToVector()
    geometry = RoverPlantParameters(wheels=kind).geometry
    c, s = np.cos(phi), np.sin(phi)
    vx, vy, wz = COMMAND
    assert rates[:3] == pytest.approx([c * vx - s * vy, s * vx + c * vy, wz])
    assert rates[3:] == pytest.approx(geometry.inverse @ COMMAND)


@KINDS
def test_small_errors_are_called_back_and_add_up(kind):
    plant = RoverPlantParameters(wheels=kind)
    system = robots()["rover"].error_system(plant)
    wheels = len(plant.geometry.wheels)
    assert system.a[:3, :3] == pytest.approx(-1e-3 * np.eye(3)) and system.a[3:, 3:] == pytest.approx(-2.0 * np.eye(3))
    assert not system.a[3:, :3].any() and not system.b[3:].any()
    assert system.a[:3, 3:] == pytest.approx(system.b[:3])
    sideways = 0.0 if kind == "differential" else 1.0
    assert system.b[:3] == pytest.approx(np.diag([1.0, sideways, 1.0]), abs=1e-12)
    assert system.c[:, :3] == pytest.approx(plant.geometry.inverse) and not system.c[:, 3:].any()
    assert system.d.shape == (wheels, 3) and not system.d.any()
