"""Friction at the wheels, (3.35): smooth and elastoplastic, at the fixed 5 ms step."""

import numpy as np
import pytest
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig

from drake_ispace.blocks.errors import InputError
from drake_ispace.blocks.rates import TICK_S
from drake_ispace.plants.friction import (
    BRISTLE,
    Friction,
    dragged_anchor,
    dry_slope,
    friction_parameters,
    friction_torque,
)
from drake_ispace.plants.omni import THETA, WZ, OmniPlant, OmniPlantParameters
from drake_ispace.plants.omni import mobility as omni_mobility
from drake_ispace.plants.pendulum import PendulumPlant, PendulumPlantParameters
from drake_ispace.plants.pendulum import mobility as pendulum_mobility

FIXED_STEP = SimulatorConfig(integration_scheme="runge_kutta3", max_step_size=TICK_S, use_error_control=False)
C = 0.02  # Coulomb torque of most tests here [N m]
MOBILITY = omni_mobility(OmniPlantParameters())
LARGEST = np.linalg.eigvalsh(MOBILITY)[-1]


def group(friction, mobility=MOBILITY):
    return friction_parameters(friction, mobility, "omni.plant.friction")


def torque(friction, rate, deflection=0.0):
    return friction_torque(rate, deflection, np.array(list(group(friction).values())))


def turn_on_the_spot(friction, load, seconds, wz=0.0, **changed):
    """The omni robot with the same torque `load` [N m] on every wheel, at 5 ms steps: (plant, its Simulator)."""
    plant = OmniPlant(OmniPlantParameters(friction=friction))
    simulator = Simulator(plant)
    ApplySimulatorConfig(FIXED_STEP, simulator)
    context = simulator.get_mutable_context()
    plant.get_input_port().FixValue(context, np.full(4, load))
    context.get_mutable_continuous_state_vector()[WZ] = wz
    for name, number in changed.items():
        context.get_mutable_numeric_parameter(0)[plant.spec.parameter_names.index(f"friction.{name}")] = number
    simulator.AdvanceTo(seconds)
    return plant, simulator


def wheel(simulator):
    """(angle [rad], speed [rad/s]) of wheel 1; all four turn alike here."""
    state = simulator.get_context().get_continuous_state_vector()
    return state[THETA], state[WZ] * 0.18 / 0.024


# -- The law


@pytest.mark.parametrize("model", ["smooth", "elastoplastic"])
def test_no_friction_at_rest(model):
    assert torque(Friction(model, C, 0.01), 0.0) == 0.0


@pytest.mark.parametrize("model", ["smooth", "elastoplastic"])
def test_friction_is_odd(model):
    for rate in (1e-4, 0.3, 25.0):
        assert torque(Friction(model, C, 0.01), -rate, -0.001) == -torque(Friction(model, C, 0.01), rate, 0.001)


@pytest.mark.parametrize("model", ["smooth", "elastoplastic"])
def test_at_speed_friction_is_coulomb_plus_viscous(model):
    # 0.02 N m + 0.01 N m s/rad * 30 rad/s
    assert torque(Friction(model, C, 0.01), 30.0, 1.0) == pytest.approx(0.32, rel=1e-14)


def test_smooth_friction_at_its_speed_scale():
    # tanh(1) = 0.76159...
    friction = Friction(coulomb_n_m=C, speed_scale_rad_s=0.5)
    assert torque(friction, 0.5) == pytest.approx(C * 0.7615941559557649, rel=1e-14)


def test_no_friction_by_default():
    assert torque(Friction(), 10.0) == 0.0


def test_a_stretched_bristle_pulls_back_at_rest():
    friction = Friction("elastoplastic", C)
    stiffness = group(friction)["stiffness"]
    assert torque(friction, 0.0, 0.5 * C / stiffness) == pytest.approx(0.5 * C, rel=1e-14)


def test_the_anchor_follows_at_the_bristles_reach():
    friction = group(Friction("elastoplastic", C))
    reach, numbers = C / friction["stiffness"], np.array(list(friction.values()))
    assert dragged_anchor(0.5 * reach, 0.0, numbers) == 0.0
    assert dragged_anchor(3.0 * reach, 0.0, numbers) == pytest.approx(2.0 * reach, rel=1e-14)
    assert dragged_anchor(-3.0 * reach, 0.0, numbers) == pytest.approx(-2.0 * reach, rel=1e-14)


# -- The bound on the speed scale


def test_the_pendulums_own_bound():
    mobility = pendulum_mobility(PendulumPlantParameters())
    assert np.linalg.eigvalsh(mobility) == pytest.approx([198.15, 1990.79], abs=0.01)
    # 0.5 C h lambda = 0.5 * 0.0061 * 0.005 * 1990.79
    chosen = group(PendulumPlantParameters().friction, mobility)["speed_scale"]
    assert chosen == pytest.approx(0.03036, abs=1e-5)


def test_null_means_the_smallest_scale_allowed():
    assert group(Friction(coulomb_n_m=C))["speed_scale"] == pytest.approx(0.5 * C * TICK_S * LARGEST, rel=1e-14)


def test_a_scale_that_the_step_cannot_integrate_is_refused():
    with pytest.raises(InputError) as refusal:
        PendulumPlant(PendulumPlantParameters(friction=Friction(coulomb_n_m=0.0061, speed_scale_rad_s=0.03)))
    assert "plant.friction.speed_scale_rad_s: 0.03 rad/s is too steep" in str(refusal.value)
    assert "at least 0.03036 rad/s" in str(refusal.value)


def test_a_wider_scale_is_taken_as_given():
    assert group(Friction(coulomb_n_m=C, speed_scale_rad_s=5.0))["speed_scale"] == 5.0


def test_the_bound_does_not_apply_to_bristles():
    assert group(Friction("elastoplastic", C, speed_scale_rad_s=1e-3))["bristle"] == 1.0
    assert list(group(Friction())).index("bristle") == BRISTLE


def test_at_the_bound_a_small_motion_dies_out():
    _, simulator = turn_on_the_spot(Friction(coulomb_n_m=C), 0.0, 0.5, wz=1e-4)
    assert abs(wheel(simulator)[1]) < 1e-12


def test_far_below_the_bound_a_small_motion_grows():
    smallest = group(Friction(coulomb_n_m=C))["speed_scale"]
    _, simulator = turn_on_the_spot(Friction(coulomb_n_m=C), 0.0, 0.5, wz=1e-4, speed_scale=smallest / 5.0)
    assert abs(wheel(simulator)[1]) > 100.0 * 1e-4 * 0.18 / 0.024


# -- Under load


@pytest.mark.parametrize("share", [0.3, 0.8])
def test_smooth_friction_creeps_under_a_load_below_coulomb(share):
    friction = Friction(coulomb_n_m=C)
    _, simulator = turn_on_the_spot(friction, share * C, 5.0)
    assert wheel(simulator)[1] == pytest.approx(group(friction)["speed_scale"] * np.arctanh(share), rel=1e-6)


def test_bristles_stick_under_a_load_below_coulomb():
    friction = Friction("elastoplastic", C)
    _, simulator = turn_on_the_spot(friction, 0.8 * C, 5.0)
    angle, speed = wheel(simulator)
    stiffness = group(friction)["stiffness"]
    assert angle == pytest.approx(0.8 * C / stiffness, rel=1e-6)  # the bristle's deflection, and no more
    assert abs(speed) < 1e-9


@pytest.mark.parametrize("model", ["smooth", "elastoplastic"])
def test_a_load_above_coulomb_slides_at_the_speed_that_viscosity_allows(model):
    # 1.5 C - C = c w with c = 0.001 N m s/rad: w = 10 rad/s
    _, simulator = turn_on_the_spot(Friction(model, C, 0.001), 1.5 * C, 5.0)
    assert wheel(simulator)[1] == pytest.approx(10.0, rel=1e-4)


def test_a_stuck_wheel_springs_back_when_the_load_goes():
    friction = Friction("elastoplastic", C)
    plant, simulator = turn_on_the_spot(friction, 0.8 * C, 2.0)
    plant.get_input_port().FixValue(simulator.get_mutable_context(), np.zeros(4))
    simulator.AdvanceTo(4.0)
    assert abs(wheel(simulator)[0]) < 1e-9


def test_bristles_hold_the_upright_pendulum_against_a_yaw_torque():
    parameters = PendulumPlantParameters(friction=Friction("elastoplastic", 0.0061))
    plant = PendulumPlant(parameters)
    simulator = Simulator(plant)
    ApplySimulatorConfig(FIXED_STEP, simulator)
    plant.get_input_port().FixValue(simulator.get_mutable_context(), [0.003, -0.003])
    simulator.AdvanceTo(5.0)
    stiffness = group(parameters.friction, pendulum_mobility(parameters))["stiffness"]
    angles = plant.GetOutputPort("wheel_angle").Eval(simulator.get_context())
    assert angles == pytest.approx([0.003 / stiffness, -0.003 / stiffness], rel=1e-5)


@pytest.mark.parametrize("model", ["smooth", "elastoplastic"])
def test_viscous_friction_that_the_step_cannot_integrate_is_refused(model):
    with pytest.raises(InputError, match=r"viscous_n_m_s: 0\.5 N\*m\*s/rad is too much for the 5 ms step"):
        friction_parameters(Friction(model=model, viscous_n_m_s=0.5), np.array([[1990.0]]), "plant.friction")


def test_the_most_viscous_friction_is_the_stable_slope():
    friction_parameters(Friction(viscous_n_m_s=0.25), np.array([[1990.0]]), "plant.friction")
    with pytest.raises(InputError, match=r"at most 0\.252"):
        friction_parameters(Friction(viscous_n_m_s=0.253), np.array([[1990.0]]), "plant.friction")


def test_without_coulomb_friction_nothing_is_dry():
    assert dry_slope(group(Friction("elastoplastic", 0.0))) == 0.0
    assert dry_slope(group(Friction("elastoplastic", C))) == group(Friction("elastoplastic", C))["damping"] > 0.0
    smooth = group(Friction("smooth", C, speed_scale_rad_s=0.5))
    assert dry_slope(smooth) == pytest.approx(C / 0.5)
