"""Slip and forces from the floor: what they are in numbers, what they leave alone, and that no step goes unstable."""

from dataclasses import replace

import numpy as np
import pytest
from passing import passed
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource

from drake_ispace.blocks.errors import InputError
from drake_ispace.blocks.rates import TICK_S
from drake_ispace.effects.effect import Body, EffectBlock
from drake_ispace.effects.library import library
from drake_ispace.plants.friction import Friction
from drake_ispace.plants.omni import OmniPlant, OmniPlantParameters
from drake_ispace.plants.pendulum import PendulumPlant, PendulumPlantParameters, linear_terms
from drake_ispace.plants.slip import GRAVITY, Slip
from drake_ispace.robots.library import robots
from drake_ispace.rollout.engine import parity
from drake_ispace.scenario import load_scenario
from drake_ispace.simulation import simulate

OMNI = Body(robots()["omni"], OmniPlantParameters(), 4)
PENDULUM = Body(robots()["pendulum"], PendulumPlantParameters(friction=Friction()), 2)
FORCES = ("turn_scrub", "soft_floor", "soft_patch", "quadratic_drag", "floor_tilt")
FIXED_STEP = SimulatorConfig(integration_scheme="runge_kutta3", max_step_size=TICK_S, use_error_control=False)
PRECISE = SimulatorConfig(integration_scheme="runge_kutta5", accuracy=1e-10, max_step_size=0.05, use_error_control=True)


def force(name, body, ports, before=(0.0, 0.0, 0.0), **values):
    """What the block of the effect makes of the ground force `before`, given the robot's `ports`."""
    return passed(name, body, before, ports, **values)


def test_scrub_brakes_the_yaw_alone_and_adds_to_what_is_there():
    omni = force("turn_scrub", OMNI, {"velocity": [0.2, 0.1, 3.0]}, [1.0, 2.0, 3.0], moment_n_m=0.5)
    assert omni == pytest.approx([1.0, 2.0, 2.5])
    pendulum = force("turn_scrub", PENDULUM, {"balance": [0.1, 0.3, -3.0, 0.2]}, [1.0, 2.0, 3.0], moment_n_m=0.5)
    assert pendulum == pytest.approx([1.0, 2.5, 3.0])


def test_resistance_points_against_the_motion_in_body_axes():
    # heading 90 degrees: W (0.6, 0.8) is B (0.8, -0.6)
    ports = {"pose": [9.0, 9.0, np.pi / 2], "velocity": [0.3, 0.4, 1.0]}
    assert force("soft_floor", OMNI, ports, [1.0, 2.0, 3.0], force_n=2.0) == pytest.approx([-0.6, 3.2, 3.0])
    dragged = force("quadratic_drag", OMNI, ports, [1.0, 2.0, 3.0], coefficient_n_s2_m2=8.0)
    assert dragged == pytest.approx([-0.6, 3.2, 3.0])
    faster = force("quadratic_drag", PENDULUM, {"balance": [0.1, -0.6, 1.0, 0.2]}, coefficient_n_s2_m2=8.0)
    assert faster == pytest.approx([2.88, 0.0, 0.0])
    backwards = force("soft_floor", PENDULUM, {"balance": [0.1, -0.3, 1.0, 0.2]}, force_n=2.0)
    assert backwards == pytest.approx([2.0, 0.0, 0.0])


def test_a_patch_resists_on_it_alone_and_half_as_much_on_its_edge():
    patch = {"force_n": 2.0, "x_min_m": 0.0, "x_max_m": 0.9, "y_min_m": -0.7, "y_max_m": 0.4}

    def along(x, y):
        omni = force("soft_patch", OMNI, {"pose": [x, y, 0.0], "velocity": [0.5, 0.0, 1.0]}, **patch)
        balance = {"pose": [x, y, 0.0], "balance": [0.1, 0.5, 1.0, 0.2]}
        assert force("soft_patch", PENDULUM, balance, **patch) == pytest.approx([omni[0], 0.0, 0.0])
        return omni

    assert along(0.5, 0.0) == pytest.approx([-2.0, 0.0, 0.0])
    assert along(0.0, 0.0) == pytest.approx([-1.0, 0.0, 0.0]) == along(0.5, 0.4)
    assert along(-0.3, 0.0) == pytest.approx([0.0, 0.0, 0.0], abs=1e-4) == along(0.5, 0.7)


def test_resistance_is_none_at_rest_and_grows_smoothly():
    # w_s = 0.05 rad/s of the wheels: 0.05 * 0.024 m/s
    def along(speed):
        return force("soft_floor", OMNI, {"pose": [0, 0, 0], "velocity": [speed, 0, 0]}, force_n=0.5)[0]

    assert along(0.0) == 0.0
    assert along(0.0012) == pytest.approx(-0.5 * np.tanh(1.0))


def test_a_large_force_turns_its_sign_more_slowly():
    # 20 N on 7.313 kg: v_s = 20 * 0.005/7.3135/0.5 = 0.02735 m/s
    force_n = force("soft_floor", OMNI, {"pose": [0, 0, 0], "velocity": [0.02735, 0, 0]}, force_n=20.0)[0]
    assert force_n == pytest.approx(-20.0 * np.tanh(1.0), rel=1e-3)


def test_a_floor_that_rises_along_x_pulls_towards_minus_x():
    # 7.31 kg * 9.80665 * 0.01 = 0.716866 N
    east = force("floor_tilt", OMNI, {"pose": [1, 2, 0.0]}, slope_x_rad=0.01, slope_y_rad=0.0)
    north = force("floor_tilt", OMNI, {"pose": [1, 2, np.pi / 2]}, slope_x_rad=0.01, slope_y_rad=0.0)
    assert east == pytest.approx([-0.716866, 0.0, 0.0], abs=1e-6)
    assert north == pytest.approx([0.0, 0.716866, 0.0], abs=1e-6)


def test_on_a_tilted_floor_a_mass_beside_the_middle_turns_the_robot_downhill():
    body = replace(OMNI, plant=OmniPlantParameters(centre_of_gravity_m=[0.1, 0.0]))
    pulled = force("floor_tilt", body, {"pose": [0, 0, 0.0]}, slope_x_rad=0.0, slope_y_rad=0.01)
    assert pulled == pytest.approx([0.0, -0.716866, -0.0716866], abs=1e-6)


def slope_energy(s, phi, tilt, slope, plant, place=(0.3, -0.2)):
    """Potential energy [J] of body and wheels when the axle has gone s [m] along its heading, first order in slope."""
    along = np.array([np.cos(phi), np.sin(phi)])
    axle = np.array(place) + s * along
    body = axle + plant.centre_of_gravity_m * np.sin(tilt) * along
    masses = 2.0 * plant.wheel_mass_kg * axle + plant.body_mass_kg * body
    return GRAVITY * float(np.dot(slope, masses))


@pytest.mark.parametrize("phi, tilt", [(0.0, 0.0), (0.7, 0.2), (-2.0, -0.5)])
def test_the_pendulum_on_a_slope_is_pulled_down_its_potential(phi, tilt):
    slope, h = (0.03, -0.02), 1e-5
    steps = h * np.eye(3)
    gradient = [
        (slope_energy(0.0 + d[0], phi + d[1], tilt + d[2], slope, PENDULUM.plant)
         - slope_energy(0.0 - d[0], phi - d[1], tilt - d[2], slope, PENDULUM.plant)) / (2.0 * h) for d in steps
    ]
    ports = {"pose": [0.3, -0.2, phi], "balance": [tilt, 0.5, 0.2, 0.1]}
    pulled = force("floor_tilt", PENDULUM, ports, slope_x_rad=slope[0], slope_y_rad=slope[1])
    np.testing.assert_allclose(pulled, -np.array(gradient), atol=1e-9)


def test_the_pendulum_on_a_slope_by_hand():
    # uphill along x by 0.01: -4 * 9.80665 * 0.01 N, -3.5 * 0.04 * 9.80665 * 0.01 * cos(0.1) N m
    ports = {"pose": [0, 0, 0], "balance": [0.1, 0, 0, 0]}
    pulled = force("floor_tilt", PENDULUM, ports, slope_x_rad=0.01, slope_y_rad=0.0)
    assert pulled == pytest.approx([-0.392266, 0.0, -0.0136607], abs=1e-6)


def driven(plant, body, effects, torque, start, config, until):
    """The plant's states every 50 ms with the blocks of `effects` (name -> values) in its ground force."""
    builder = DiagramBuilder()
    plant = builder.AddSystem(plant)
    torques, last = (builder.AddSystem(ConstantVectorSource(values)) for values in (torque, np.zeros(3)))
    builder.Connect(torques.get_output_port(), plant.GetInputPort("torque"))
    for name, values in effects.items():
        block = builder.AddSystem(EffectBlock(library()[name], body, values))
        builder.Connect(last.get_output_port(), block.GetInputPort("ground_force"))
        for port in set(block.spec.inputs) - {"ground_force"}:
            builder.Connect(plant.GetOutputPort(port), block.GetInputPort(port))
        last = block
    builder.Connect(last.get_output_port(), plant.GetInputPort("ground_force"))
    simulator = Simulator(builder.Build())
    ApplySimulatorConfig(config, simulator)
    state = simulator.get_mutable_context().get_mutable_continuous_state_vector()
    for index, value in start.items():
        state[index] = value
    found = []
    for seconds in np.arange(0.0, until + 0.01, 0.05):
        simulator.AdvanceTo(seconds)
        found.append(simulator.get_context().get_continuous_state_vector().CopyToVector())
    return np.array(found)


@pytest.mark.slow
def test_the_pendulum_on_a_slope_keeps_its_energy():
    plant, slope = PENDULUM.plant, (0.05, -0.03)
    effects = {"floor_tilt": {"slope_x_rad": slope[0], "slope_y_rad": slope[1]}}
    states = driven(PendulumPlant(plant, ground=True), PENDULUM, effects, [0.0, 0.0], {3: 1.0, 5: 2.0}, PRECISE, 3.0)
    i, totals = plant.inertias(), []
    for x, y, phi, tilt, *v in states[:, :7]:
        s, c = np.sin(tilt), np.cos(tilt)
        mass = linear_terms(plant)[0]
        mass[0, 2] = mass[2, 0] = i["m_b_z"] * c + i["m13_rotors"]
        mass[1, 1] = i["yaw_lying"] * s * s + i["yaw_upright"] * c * c + i["yaw_wheels"]
        height = i["m_b_z"] * GRAVITY * c + slope_energy(0.0, phi, tilt, slope, plant, (x, y))
        totals.append(0.5 * np.array(v) @ mass @ v + height)
    assert np.ptp(states[:, 0]) > 0.1
    assert np.ptp(totals) < 1e-7


def test_an_omni_robot_rolls_down_at_g_times_slope():
    states = driven(
        OmniPlant(OMNI.plant, ground=True), OMNI, {"floor_tilt": {"slope_x_rad": 0.0, "slope_y_rad": 0.01}},
        np.zeros(4), {2: 0.8}, FIXED_STEP, 1.0,
    )
    # 7.31/(7.31 + 2 I_w/r^2) * 9.80665 * 0.01 m/s^2 for 1 s
    assert states[-1, 3:6] == pytest.approx([0.0, -0.0980199, 0.0], abs=1e-6)


@pytest.mark.first_case
@pytest.mark.parametrize("scrub, floor", [(0.01, 0.2), (0.3, 4.0), (2.0, 20.0)])
def test_large_forces_beside_dry_friction_come_to_rest_in_the_5_ms_step(scrub, floor):
    effects = {"turn_scrub": {"moment_n_m": scrub}, "soft_floor": {"force_n": floor}}
    sticky = replace(OMNI.plant, friction=Friction(coulomb_n_m=0.02))
    omni = driven(
        OmniPlant(sticky, ground=True), replace(OMNI, plant=sticky), effects, np.zeros(4), {3: 0.3, 4: 0.1, 5: 1.0},
        FIXED_STEP, 4.0,
    )
    assert np.abs(omni[-1, 3:6]).max() < 1e-6
    hanging = PendulumPlantParameters()
    pendulum = driven(
        PendulumPlant(hanging, initial_tilt_rad=np.pi, ground=True), replace(PENDULUM, plant=hanging), effects,
        np.zeros(2), {4: 0.3, 5: 1.0}, FIXED_STEP, 4.0,
    )
    assert np.abs(pendulum[-1, 4:7]).max() < 1e-3


# -- Slip


def test_constant_slip_is_what_odometry_does_not_see():
    plant = library()["constant_slip"].change(OMNI.robot, OMNI.plant, {"ratio_x": 0.1, "ratio_y": -0.05})
    block = OmniPlant(plant)
    context = block.CreateDefaultContext()
    block.get_input_port().FixValue(context, np.zeros(4))
    for i, speed in enumerate([0.4, 0.2, 1.0]):
        context.get_mutable_continuous_state_vector()[3 + i] = speed
    rates = block.EvalTimeDerivatives(context).CopyToVector()
    assert rates[:3] == pytest.approx([0.36, 0.21, 1.0])
    assert OMNI.plant.geometry.forward @ rates[9:] == pytest.approx([0.4, 0.2, 1.0])


def test_slip_adds_to_what_the_plant_has():
    plant = replace(PENDULUM.plant, slip=Slip(ratio=[0.1, 0.2, 0.3], traction_gain=[0.1, 0.0, 0.2]))
    slid = library()["constant_slip"].change(PENDULUM.robot, plant, {"ratio": 0.05}).slip
    assert slid.ratio == pytest.approx([0.15, 0.2, 0.3])
    slid = library()["wheel_slip"].change(PENDULUM.robot, plant, {"gain": 0.2}).slip
    assert slid.traction_gain == pytest.approx([0.3, 0.0, 0.2])
    assert plant.slip.ratio == [0.1, 0.2, 0.3]


def test_cornering_slip_moves_the_robot_outwards_and_turns_it_not():
    plant = library()["cornering_slip"].change(OMNI.robot, OMNI.plant, {"time_s": 0.1})
    block = OmniPlant(plant)
    context = block.CreateDefaultContext()
    block.get_input_port().FixValue(context, np.zeros(4))
    for speeds, moved in (((0.4, 0.0, 2.0), (0.4, -0.08, 2.0)), ((0.0, 0.2, -1.0), (-0.02, 0.2, -1.0))):
        for i, speed in enumerate(speeds):
            context.get_mutable_continuous_state_vector()[3 + i] = speed
        rates = block.EvalTimeDerivatives(context).CopyToVector()
        assert rates[:3] == pytest.approx(moved)
        assert OMNI.plant.geometry.forward @ rates[9:] == pytest.approx(speeds)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_wheel_slip_lags_while_driven_and_slides_on_while_braked(sign):
    plant = library()["wheel_slip"].change(PENDULUM.robot, PENDULUM.plant, {"gain": 0.3})
    block = PendulumPlant(plant)
    context = block.CreateDefaultContext()
    block.get_input_port().FixValue(context, sign * np.array([0.2, 0.2]))
    context.get_mutable_continuous_state_vector()[4] = 0.5
    # F = 0.4/0.08 = 5 N of mu m g = 0.6 * 4 * 9.80665 N
    share = 0.3 * 5.0 / (0.6 * 4.0 * GRAVITY)
    assert block.EvalTimeDerivatives(context)[0] == pytest.approx(0.5 * (1.0 - sign * share))


@pytest.mark.parametrize("name, values, slip, message", [
    ("constant_slip", {"ratio_x": 0.1, "ratio_y": 0.0}, Slip(frame="world"), "constant_slip: slip.frame is world"),
    ("wheel_slip", {"gain_x": 0.1, "gain_y": 0.0}, Slip(frame="additive"), "wheel_slip: slip.frame is additive"),
    ("cornering_slip", {"time_s": 0.1}, Slip(frame="world"), "cornering_slip: slip.frame is world"),
    ("constant_slip", {"ratio_x": 0.5, "ratio_y": 0.0}, Slip(ratio=[0.5, 0.0, 0.0]), "slip.ratio 1, expected less"),
    ("wheel_slip", {"gain_x": 0.0, "gain_y": 0.9}, Slip(traction_gain=[0, 0.5, 0]), "slip.traction_gain 1.4, expected"),
])
def test_slip_that_has_no_meaning_is_refused(name, values, slip, message):
    with pytest.raises(InputError, match=message):
        library()[name].change(OMNI.robot, replace(OMNI.plant, slip=slip), values)


# -- In a scenario


@pytest.mark.parametrize("bad, message", [
    ("constant_slip.ratio_x=0.6", "at most 0.5"), ("constant_slip.ratio=0.1", "unknown parameter"),
    ("wheel_slip.gain_y=-0.1", "at least 0"), ("turn_scrub.moment_n_m=-1", "at least 0"),
    ("soft_floor.force_n=soft", "expected a number"), ("floor_tilt.slope_z_rad=0.1", "unknown parameter"),
    ("floor_tilt.slope_x_rad=0.2", "at most 0.1"),
])
def test_bad_values_are_refused(bad, message):
    with pytest.raises(InputError, match=message):
        load_scenario("omni_multirate", [f"omni.effects.{bad}"])


@pytest.mark.first_case
@pytest.mark.parametrize("robot", ["omni", "pendulum"])
def test_neutral_effects_change_no_bit_and_others_agree_with_drake(robot):
    scenario = load_scenario(f"{robot}_multirate", ["seconds=1", f"{robot}.plant.slip.ratio=[0.05, 0, 0.05]"])
    base = simulate(scenario).signals
    names = ("constant_slip", "cornering_slip", "wheel_slip", *FORCES)
    slipping = ("ratio_x", "gain_y") if robot == "omni" else ("ratio", "gain")
    getattr(scenario, robot).effects = {name: {} for name in names}
    neutral = simulate(scenario).signals
    assert all(np.array_equal(rows, neutral[name], equal_nan=True) for name, rows in base.items())
    getattr(scenario, robot).effects = {
        "constant_slip": {slipping[0]: 0.1}, "cornering_slip": {"time_s": 0.05}, "wheel_slip": {slipping[1]: 0.3},
        "turn_scrub": {"moment_n_m": 0.03},
        "soft_floor": {"force_n": 0.5}, "floor_tilt": {"slope_x_rad": 0.01, "slope_y_rad": -0.02},
    }
    assert parity(scenario)["max_abs_difference"] == 0.0
    assert np.abs(simulate(scenario).signals[f"{robot}_pose"] - base[f"{robot}_pose"]).max() > 1e-4
