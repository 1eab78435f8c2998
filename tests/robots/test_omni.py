"""The omni robot's plant, (2.70)-(2.76), its gains, and other wheel layouts on the same plant."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from pydrake.symbolic import Evaluate, Expression, Jacobian, MakeVectorContinuousVariable
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig

from drake_ispace.blocks.rates import TICK_S, VISION_S
from drake_ispace.control.feedback.dlqr import dlqr, spectral_radius
from drake_ispace.control.feedback.omni_gains import linearised
from drake_ispace.plants.omni import THETA, VX, VY, WZ, OmniPlant, OmniPlantParameters, mass_matrix, mobility
from drake_ispace.plants.wheels import Wheel, WheelGeometry, differential, mecanum, omni3

R, B, I_W = 0.024, 0.36, 1e-6
# a wheel inertia large enough for its terms to show: 2 I_w/r^2 = 2 kg
HEAVY = OmniPlantParameters(wheel_inertia_kg_m2=R**2)
PRINTED_INERTIA = OmniPlantParameters(inertia_kg_m2=7.29e-5)
PRECISE = SimulatorConfig(integration_scheme="runge_kutta5", accuracy=1e-11, max_step_size=0.1, use_error_control=True)


def rates(parameters, phi=0.0, velocity=(0.0, 0.0, 0.0), torque=None):
    """d/dt of the plant's continuous state."""
    plant = OmniPlant(parameters, (0.3, -0.2, phi))
    context = plant.CreateDefaultContext()
    n = len(parameters.geometry.wheels)
    plant.get_input_port().FixValue(context, np.zeros(n) if torque is None else torque)
    for i in range(3):
        context.get_mutable_continuous_state_vector()[3 + i] = velocity[i]
    return plant.EvalTimeDerivatives(context).CopyToVector()


def s_matrix(phi, r=R, b=B):
    """S(q) (7, 3) after (2.72)."""
    s, c = np.sin(phi), np.cos(phi)
    wheels = np.array([[-s, c, b / 2], [-c, -s, b / 2], [s, -c, b / 2], [c, s, b / 2]]) / r
    return np.vstack([np.eye(3), wheels])


def a_matrix(phi, r=R, b=B):
    """A(q) (3, 7) after (2.72)."""
    s, c = np.sin(phi), np.cos(phi)
    jacobian = r / 2 * np.array([[-s, -c, s, c], [c, -s, -c, s], [1 / b, 1 / b, 1 / b, 1 / b]])
    return np.hstack([-np.eye(3), jacobian])


ANGLES = [0.0, 0.7, 2.0, -3.0]


# -- The equation of motion


@pytest.mark.parametrize("parameters, m, i_phi", [(OmniPlantParameters(), 7.31, 7.29e-2), (HEAVY, 7.31, 7.29e-2)])
def test_mass_matrix_is_2_74(parameters, m, i_phi):
    i_w = parameters.wheel_inertia_kg_m2
    translation, rotation = m + 2.0 / R**2 * i_w, i_phi + B**2 / R**2 * i_w
    np.testing.assert_allclose(mass_matrix(parameters), np.diag([translation, translation, rotation]), atol=1e-13)


def test_mass_matrix_in_numbers():
    # 7.31 + 2e-6/5.76e-4 = 7.3135 kg, 0.0729 + 0.1296e-6/5.76e-4 = 0.073125 kg m^2
    assert np.diag(mass_matrix(OmniPlantParameters())) == pytest.approx([7.313472, 7.313472, 0.073125], rel=1e-6)


@pytest.mark.parametrize("phi", ANGLES)
def test_input_matrix_is_2_76(phi):
    mass = np.diag([9.31, 9.31, 7.29e-2 + B**2])
    s, c = np.sin(phi), np.cos(phi)
    printed = np.array([[-s, -c, s, c], [c, -s, -c, s], [B / 2] * 4]) / R
    for wheel in range(4):
        force = mass @ rates(HEAVY, phi, torque=np.eye(4)[wheel])[3:6]
        np.testing.assert_allclose(force, printed[:, wheel], atol=1e-12)


@pytest.mark.parametrize("phi", ANGLES)
def test_velocity_term_is_2_75(phi):
    vx, vy, wz = 0.4, -0.3, 1.7
    mass = np.diag([9.31, 9.31, 7.29e-2 + B**2])
    term = -mass @ rates(HEAVY, phi, (vx, vy, wz))[3:6]
    np.testing.assert_allclose(term, 2.0 * wz * np.array([vy, -vx, 0.0]), atol=1e-12)


@pytest.mark.parametrize("phi", ANGLES)
def test_the_general_plant_is_s_transposed_m_s(phi):
    """(2.70) reduced with S(q): M = diag(m, m, I, I_w ...), V = 0 because I_w is constant."""
    velocity, torque = np.array([0.4, -0.3, 1.7]), np.array([0.01, -0.02, 0.03, 0.005])
    full = np.diag([7.31, 7.31, 7.29e-2, *[HEAVY.wheel_inertia_kg_m2] * 4])
    s, h = s_matrix(phi), 1e-6
    s_dot = (s_matrix(phi + h * velocity[2]) - s_matrix(phi - h * velocity[2])) / (2.0 * h)
    expected = np.linalg.solve(s.T @ full @ s, s[3:].T @ torque - s.T @ full @ s_dot @ velocity)
    np.testing.assert_allclose(rates(HEAVY, phi, velocity, torque)[3:6], expected, rtol=1e-8)


@pytest.mark.parametrize("phi", ANGLES)
def test_s_spans_the_null_space_of_a(phi):
    assert np.abs(a_matrix(phi) @ s_matrix(phi)).max() < 1e-13


@pytest.mark.parametrize("phi", ANGLES)
def test_e_times_jacobian_transposed_is_one(phi):
    np.testing.assert_allclose(s_matrix(phi)[3:].T @ a_matrix(phi)[:, 3:].T, np.eye(3), atol=1e-13)


def test_a_simulated_motion_keeps_the_constraints():
    plant = OmniPlant(HEAVY)
    simulator = Simulator(plant)
    context = simulator.get_mutable_context()
    plant.get_input_port().FixValue(context, [0.05, -0.02, 0.03, 0.01])
    for seconds in np.linspace(0.1, 2.0, 20):
        simulator.AdvanceTo(seconds)
        derivative = plant.EvalTimeDerivatives(context).CopyToVector()
        q_dot = np.concatenate([derivative[:3], derivative[THETA:]])
        phi = plant.GetOutputPort("pose").Eval(context)[2]
        assert np.abs(a_matrix(phi) @ q_dot).max() < 1e-13 * np.abs(q_dot).max()
    assert abs(phi) > 1.0


def test_the_wheels_turn_as_their_rates_say():
    plant = OmniPlant(HEAVY, (0.0, 0.0, 0.5))
    context = plant.CreateDefaultContext()
    plant.get_input_port().FixValue(context, np.zeros(4))
    for i, speed in enumerate([0.2, -0.1, 0.6]):
        context.get_mutable_continuous_state_vector()[3 + i] = speed
    rate = plant.GetOutputPort("wheel_rate").Eval(context)
    np.testing.assert_allclose(rate, s_matrix(0.5)[3:] @ [0.2, -0.1, 0.6], rtol=1e-13)
    np.testing.assert_array_equal(plant.EvalTimeDerivatives(context).CopyToVector()[THETA:], rate)


def kinetic_energy(parameters, plant, context):
    vx, vy, wz = plant.GetOutputPort("velocity").Eval(context)
    wheels = plant.GetOutputPort("wheel_rate").Eval(context)
    phi, (x, y) = plant.GetOutputPort("pose").Eval(context)[2], parameters.centre_of_gravity_m
    vx, vy = vx - wz * (np.sin(phi) * x + np.cos(phi) * y), vy + wz * (np.cos(phi) * x - np.sin(phi) * y)
    return 0.5 * (
        parameters.mass_kg * (vx**2 + vy**2) + parameters.inertia_kg_m2 * wz**2
        + parameters.wheel_inertia_kg_m2 * wheels @ wheels
    )


def energy_drift(parameters, config):
    """Largest relative change of kinetic energy over 10 s without torque and friction."""
    plant = OmniPlant(parameters)
    simulator = Simulator(plant)
    ApplySimulatorConfig(config, simulator)
    context = simulator.get_mutable_context()
    plant.get_input_port().FixValue(context, np.zeros(len(parameters.geometry.wheels)))
    for i, speed in enumerate([0.5, -0.3, 9.0]):
        context.get_mutable_continuous_state_vector()[3 + i] = speed
    start, drift = kinetic_energy(parameters, plant, context), 0.0
    for seconds in np.linspace(0.5, 10.0, 20):
        simulator.AdvanceTo(seconds)
        drift = max(drift, abs(kinetic_energy(parameters, plant, context) / start - 1.0))
    return drift


def test_kinetic_energy_is_kept():
    assert energy_drift(HEAVY, PRECISE) < 1e-9


# -- Centre of gravity beside the middle, and wheels of their own radius

LOADED = replace(HEAVY, centre_of_gravity_m=[0.07, -0.04])


def test_kinetic_energy_is_kept_with_the_centre_of_gravity_off_the_middle():
    assert energy_drift(LOADED, PRECISE) < 1e-9


def body_energy(parameters, q, q_dot):
    """T [J] of the body alone at (x, y, phi): the speed of its centre of gravity, and the body about that."""
    s, c = np.sin(q[2]), np.cos(q[2])
    x, y = parameters.centre_of_gravity_m
    vx = q_dot[0] - q_dot[2] * (s * x + c * y)
    vy = q_dot[1] + q_dot[2] * (c * x - s * y)
    return 0.5 * (parameters.mass_kg * (vx**2 + vy**2) + parameters.inertia_kg_m2 * q_dot[2] ** 2)


def derived_accelerations(parameters, q, q_dot, torque):
    """q_ddot from the body's d/dt(dT/dq_dot) - dT/dq by central differences, and the wheels' S'(I_w S q_ddot ...)."""

    def along(f, at, i, h=1e-4):
        step = h * np.eye(3)[i]
        return (f(at + step) - f(at - step)) / (2.0 * h)

    def momentum(q, q_dot):
        return np.array([along(lambda v: body_energy(parameters, q, v), q_dot, i) for i in range(3)])

    def wheels(phi):
        s, c = np.sin(phi), np.cos(phi)
        return parameters.geometry.inverse @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])

    mass = np.column_stack([along(lambda v: momentum(q, v), q_dot, i) for i in range(3)])
    drift = sum(q_dot[i] * along(lambda p: momentum(p, q_dot), q, i) for i in range(3))
    pull = np.array([along(lambda p: body_energy(parameters, p, q_dot), q, i) for i in range(3)])
    s, s_dot = wheels(q[2]), q_dot[2] * (wheels(q[2] + 1e-5) - wheels(q[2] - 1e-5)) / 2e-5
    i_w = parameters.wheel_inertia_kg_m2
    return np.linalg.solve(mass + i_w * s.T @ s, s.T @ torque - drift + pull - i_w * s.T @ s_dot @ q_dot)


@pytest.mark.parametrize("phi", ANGLES)
@pytest.mark.parametrize("loaded", [LOADED, replace(LOADED, wheel_radius_shares=[0.2, 0.0, -0.1, 0.0])])
def test_off_centre_accelerations_follow_from_the_energies(loaded, phi):
    velocity, torque = np.array([0.4, -0.3, 3.7]), np.array([0.1, -0.2, 0.3, 0.05])
    expected = derived_accelerations(loaded, np.array([0.3, -0.2, phi]), velocity, torque)
    np.testing.assert_allclose(rates(loaded, phi, velocity, torque)[3:6], expected, rtol=1e-6, atol=1e-6)


def test_an_off_centre_mass_matrix_by_hand():
    # m 7.31 kg at (0.07, -0.04) m: -m y = 0.2924, m x = 0.5117, m (x^2 + y^2) = 0.0475150 kg m^2
    light = OmniPlantParameters(wheel_inertia_kg_m2=0.0, centre_of_gravity_m=[0.07, -0.04])
    expected = [[7.31, 0.0, 0.2924], [0.0, 7.31, 0.5117], [0.2924, 0.5117, 0.120415]]
    np.testing.assert_allclose(mass_matrix(light), expected, atol=1e-12)


def test_the_middle_is_pulled_towards_a_mass_that_goes_around_it():
    # 0.0475 kg m^2 and no torque: the centre of gravity does not accelerate, so the middle does by wz^2 c
    loaded = OmniPlantParameters(wheel_inertia_kg_m2=0.0, centre_of_gravity_m=[0.1, 0.0])
    np.testing.assert_allclose(rates(loaded, velocity=(0.0, 0.0, 2.0))[3:6], [0.4, 0.0, 0.0], atol=1e-12)


def test_a_larger_wheel_pushes_less_and_turns_less():
    # wheel 1 drives along y; r = 0.03 instead of 0.024 m
    grown = replace(HEAVY, wheel_inertia_kg_m2=0.0, wheel_radius_shares=[0.25, 0.0, 0.0, 0.0])
    acceleration = rates(grown, velocity=(0.0, 0.3, 0.0), torque=[0.03, 0.0, 0.0, 0.0])
    assert acceleration[4] == pytest.approx(1.0 / 7.31)
    np.testing.assert_allclose(acceleration[THETA:], [10.0, 0.0, -12.5, 0.0], atol=1e-12)


# -- Linearisation


def test_linearisation_is_the_inverse_mass_matrix():
    a, b = linearised(HEAVY)
    expected = np.zeros((6, 6))
    expected[:3, 3:] = np.eye(3)
    np.testing.assert_allclose(a, expected, atol=1e-14)
    np.testing.assert_allclose(b, np.vstack([np.zeros((3, 3)), np.linalg.inv(mass_matrix(HEAVY))]), atol=1e-12)


@pytest.mark.filterwarnings("ignore:invalid value encountered")  # of NumPy, on Expressions
def test_the_symbolic_plants_derivative_is_the_linearisation():
    plant = OmniPlant(HEAVY).ToSymbolic()
    context = plant.CreateDefaultContext()
    state, torque = MakeVectorContinuousVariable(13, "x"), MakeVectorContinuousVariable(4, "tau")
    context.SetContinuousState([Expression(variable) for variable in state])
    plant.get_input_port().FixValue(context, [Expression(variable) for variable in torque])
    derivative = plant.EvalTimeDerivatives(context).CopyToVector()[:6]
    at_rest = dict.fromkeys([*state, *torque], 0.0)
    a = Evaluate(Jacobian(derivative, state[:6]), at_rest)
    b = Evaluate(Jacobian(derivative, torque), at_rest) @ HEAVY.geometry.forward.T
    for symbolic, numeric in zip((a, b), linearised(HEAVY), strict=True):
        np.testing.assert_allclose(symbolic, numeric, atol=1e-13)


def test_mobility_is_wheel_acceleration_per_torque():
    for wheel in range(4):
        acceleration = s_matrix(0.0)[3:] @ rates(HEAVY, torque=np.eye(4)[wheel])[3:6]
        np.testing.assert_allclose(mobility(HEAVY)[:, wheel], acceleration, atol=1e-9)


# -- The printed gains and the plant's own (docs/fidelity.md, rows 12 and 13)

Q, WEIGHTS_R = np.array([1.4, 1.4, 0.0975, 17.5, 17.55, 1.0]) * 1e4, np.array([23.0, 23.0, 5.0]) * 1e2  # (6.24), (6.25)
PRINTED_GAIN = np.hstack([np.diag([2.45, 2.45, 1.23]), np.diag([10.0, 10.0, 4.0])])  # (6.26), (6.27)


def own_gain(parameters, period_s=TICK_S):
    gain = dlqr(*linearised(parameters), Q, WEIGHTS_R, period_s)
    return np.diag(gain[:, :3]), np.diag(gain[:, 3:])


def test_row_13_dlqr_in_translation():
    k_p, k_d = own_gain(OmniPlantParameters())
    assert (k_p[0], k_d[0]) == pytest.approx((2.458, 10.56), abs=2e-3)
    assert k_d[1] > k_d[0]  # 17.55 against 17.5


def test_row_13_the_printed_rate_gain_is_that_of_5_kg():
    k_p, k_d = own_gain(OmniPlantParameters(mass_kg=5.0))
    assert (k_p[0], k_d[0]) == pytest.approx((2.455, 10.0), abs=0.01)


def test_row_12_dlqr_in_yaw_asks_for_the_larger_inertia():
    k_p, k_d = own_gain(OmniPlantParameters())
    assert (k_p[2], k_d[2]) == pytest.approx((1.198, 3.86), abs=1e-3)  # printed (1.23, 4)


def test_row_12_with_the_printed_inertia_the_yaw_gains_are_useless():
    k_p, k_d = own_gain(PRINTED_INERTIA)
    assert (k_p[2], k_d[2]) == pytest.approx((0.0186, 0.0596), abs=1e-4)


def test_row_12_with_the_printed_inertia_the_printed_gains_are_unstable():
    printed, corrected = linearised(PRINTED_INERTIA), linearised(OmniPlantParameters())
    assert spectral_radius(*printed, PRINTED_GAIN, TICK_S) == pytest.approx(66.2, abs=0.1)
    assert spectral_radius(*corrected, PRINTED_GAIN, TICK_S) == pytest.approx(0.9985, abs=1e-4)


def test_row_19_the_printed_yaw_gains_are_lost_at_the_rate_of_vision():
    # 1 - K_d T/I = 1 - 4 * 0.095/0.0731 = -4.2 and its like
    assert spectral_radius(*linearised(OmniPlantParameters()), PRINTED_GAIN, VISION_S) > 4.0


# -- Other wheels


@dataclass
class ThreeWheels(OmniPlantParameters):
    @property
    def geometry(self):
        return omni3(self.wheel_radius_m, self.wheel_distance_m / 2.0)


@dataclass
class Mecanum(OmniPlantParameters):
    @property
    def geometry(self):
        return mecanum(self.wheel_radius_m, 0.2, 0.15)


@dataclass
class Lopsided(OmniPlantParameters):
    """Three wheels anywhere: N = G'G is full, so that x, y and yaw are coupled."""

    @property
    def geometry(self):
        places = ((0.2, 0.05, 1.9), (-0.1, 0.15, 3.0), (-0.05, -0.2, -0.4))
        return WheelGeometry(tuple(Wheel(x, y, drive, self.wheel_radius_m) for x, y, drive in places))


OTHERS = [ThreeWheels, Mecanum, Lopsided]


@pytest.mark.parametrize("kind", OTHERS)
def test_other_holonomic_robots_obey_their_own_mass_matrix(kind):
    parameters = kind(wheel_inertia_kg_m2=R**2)
    wheels = parameters.geometry.inverse
    for i in range(len(wheels)):
        acceleration = rates(parameters, torque=np.eye(len(wheels))[i])[3:6]  # at heading 0 body axes are world axes
        np.testing.assert_allclose(mass_matrix(parameters) @ acceleration, wheels[i], atol=1e-11)


def test_a_lopsided_robot_couples_all_axes():
    assert np.abs(mass_matrix(Lopsided(wheel_inertia_kg_m2=R**2))).min() > 0.01


@pytest.mark.parametrize("kind", OTHERS)
def test_other_holonomic_robots_keep_their_energy(kind):
    assert energy_drift(kind(wheel_inertia_kg_m2=R**2), PRECISE) < 1e-8


def test_three_wheels_by_hand():
    # N = G'G: 3/(2 r^2) in translation, 3 L^2/r^2 in yaw, times I_w = r^2
    mass = mass_matrix(ThreeWheels(wheel_inertia_kg_m2=R**2))
    np.testing.assert_allclose(mass, np.diag([7.31 + 1.5, 7.31 + 1.5, 0.0729 + 3.0 * 0.18**2]), atol=1e-12)


def test_mecanum_by_hand():
    # N = G'G: 4/r^2 in translation, 4 (a + b)^2/r^2 in yaw, times I_w = r^2
    mass = mass_matrix(Mecanum(wheel_inertia_kg_m2=R**2))
    np.testing.assert_allclose(mass, np.diag([11.31, 11.31, 0.0729 + 4.0 * 0.35**2]), atol=1e-12)


def test_wheels_that_hold_sideways_make_no_omni_robot():
    class Held(OmniPlantParameters):
        geometry = differential(0.08, 0.2)

    with pytest.raises(ValueError, match="do not hold sideways"):
        OmniPlant(Held())


def test_a_heavier_robot_is_slower():
    push = [0.0, -0.024, 0.0, 0.024]
    light, heavy = (rates(replace(HEAVY, mass_kg=m), torque=push)[3] for m in (3.0, 8.0))
    assert (light, heavy) == pytest.approx((2.0 / 5.0, 2.0 / 10.0), rel=1e-12)


def test_a_force_of_the_ground_pushes_along_its_own_axis():
    plant = OmniPlant(OmniPlantParameters(), ground=True)
    for axis in range(3):
        context, push = plant.CreateDefaultContext(), np.eye(3)[axis]
        plant.GetInputPort("torque").FixValue(context, np.zeros(4))
        plant.GetInputPort("ground_force").FixValue(context, push)
        rates = plant.EvalTimeDerivatives(context).CopyToVector()
        gained = rates[[VX, VY, WZ]]
        assert gained[axis] > 0.0 and gained == pytest.approx(gained[axis] * push, abs=1e-12)
