"""The pendulum's plant against its derivation from the energies, (2.2)-(2.57), and the thesis's gains on it."""

from dataclasses import replace

import numpy as np
import pendulum_lagrangian as derivation
import pytest
from pydrake.symbolic import Evaluate, Expression, Jacobian, MakeVectorContinuousVariable
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig
from pydrake.systems.primitives import Linearize
from scipy.linalg import solve_continuous_are

import control
from drake_ispace.blocks.rates import TICK_S
from drake_ispace.control.feedback import balance_gains
from drake_ispace.control.feedback.balance_controller import from_printed
from drake_ispace.control.feedback.dlqr import dlqr, spectral_radius
from drake_ispace.plants.friction import Friction
from drake_ispace.plants.linear_pendulum import LinearPendulumPlant
from drake_ispace.plants.pendulum import (
    MOTIONS,
    PHI,
    S_RATE,
    THETA_L,
    THETA_R,
    TILT,
    TILT_RATE,
    YAW_RATE,
    PendulumPlant,
    PendulumPlantParameters,
    accelerations,
    linear_model,
    linear_terms,
    mobility,
)
from drake_ispace.plants.slip import GRAVITY
from drake_ispace.robots.pendulum import PendulumSettings

FREE = PendulumPlantParameters(friction=Friction())  # Table 2.1 without friction
LITERATURE = replace(FREE, motion="wheel_only")
KAPPA = {motion: replace(FREE, motion=motion) for motion in MOTIONS}
# every constant different from every other, so that a mix-up shows
UNLIKE = PendulumPlantParameters(
    body_mass_kg=3.1, wheel_mass_kg=0.7, body_inertia_pitch_kg_m2=0.013, body_inertia_yaw_kg_m2=0.021,
    body_inertia_roll_kg_m2=0.033, wheel_inertia_kg_m2=0.0017, wheel_inertia_yaw_kg_m2=0.0011,
    rotor_inertia_kg_m2=0.0007, rotor_inertia_yaw_kg_m2=0.0005, centre_of_gravity_m=0.11, half_track_m=0.23,
    wheel_radius_m=0.07, gear_ratio=1.9, drive_inertia_kg_m2=0.0043, friction=Friction(),
)
PRECISE = SimulatorConfig(integration_scheme="runge_kutta5", accuracy=1e-10, max_step_size=0.1, use_error_control=True)
FIXED_STEP = SimulatorConfig(integration_scheme="runge_kutta3", max_step_size=TICK_S, use_error_control=False)


def random_states(count=20, seed=0):
    """(q (6,), q_dot (6,)) without constraints."""
    rng = np.random.default_rng(seed)
    return [(rng.uniform(-3.0, 3.0, 6), rng.uniform(-4.0, 4.0, 6)) for _ in range(count)]


def number(expressions, q, q_dot, parameters=UNLIKE):
    return derivation.numbers(expressions, derivation.environment(parameters, q, q_dot))


def euler(a, b, period_s):
    """A_d, B_d of the thesis's approximation (6.37)-(6.38), with the sign of (2.55): A_d = I + A T, B_d = B T."""
    return np.eye(len(a)) + a * period_s, b * period_s


def sc(angle):
    return np.sin(angle), np.cos(angle)


# -- The derivation, entry by entry


@pytest.mark.parametrize("q, q_dot", random_states(5))
def test_2_3_centre_of_gravity(q, q_dot):
    (s_phi, c_phi), (s, c), z, r = sc(q[2]), sc(q[3]), 0.11, 0.07
    printed = [q[0] + z * c_phi * s, q[1] + z * s_phi * s, z * c + r]
    np.testing.assert_allclose(number(derivation.p_WC, q, q_dot), printed, rtol=1e-13)


@pytest.mark.parametrize("q, q_dot", random_states(5))
def test_2_4_velocity_of_the_centre_of_gravity(q, q_dot):
    (s_phi, c_phi), (s, c), z = sc(q[2]), sc(q[3]), 0.11
    x_dot, y_dot, phi_dot, tilt_dot = q_dot[:4]
    printed = [
        x_dot - z * s_phi * s * phi_dot + z * c_phi * c * tilt_dot,
        y_dot + z * c_phi * s * phi_dot + z * s_phi * c * tilt_dot,
        -z * s * tilt_dot,
    ]
    np.testing.assert_allclose(number(derivation.v_WC, q, q_dot), printed, rtol=1e-12)


@pytest.mark.parametrize("q, q_dot", random_states(5))
def test_2_7_angular_velocity_of_the_body(q, q_dot):
    (s_phi, c_phi), phi_dot, tilt_dot = sc(q[2]), q_dot[2], q_dot[3]
    printed = [-s_phi * tilt_dot, c_phi * tilt_dot, phi_dot]
    np.testing.assert_allclose(number(derivation.w_WB, q, q_dot), printed, rtol=1e-12)


@pytest.mark.parametrize("q, q_dot", random_states(5))
def test_2_11_inertia_of_the_body_in_the_world(q, q_dot):
    (s_phi, c_phi), (s, c), i_xx, i_yy, i_zz = sc(q[2]), sc(q[3]), 0.033, 0.013, 0.021
    i_11 = i_xx * c_phi**2 * c**2 + i_yy * s_phi**2 + i_zz * c_phi**2 * s**2
    i_12 = c_phi * s_phi * (i_xx * c**2 - i_yy + i_zz * s**2)
    i_22 = i_xx * s_phi**2 * c**2 + i_yy * c_phi**2 + i_zz * s_phi**2 * s**2
    i_13, i_23 = -(i_xx - i_zz) * c_phi * c * s, -(i_xx - i_zz) * s_phi * c * s
    i_33 = i_xx * s**2 + i_zz * c**2
    printed = [[i_11, i_12, i_13], [i_12, i_22, i_23], [i_13, i_23, i_33]]
    np.testing.assert_allclose(number(derivation.I_BODY, q, q_dot), printed, atol=1e-16)


@pytest.mark.parametrize("q, q_dot", random_states(5))
def test_2_18_translation_of_the_body_with_its_own_mass(q, q_dot):
    (s_phi, c_phi), (s, c), m_b, z = sc(q[2]), sc(q[3]), 3.1, 0.11
    x_dot, y_dot, phi_dot, tilt_dot = q_dot[:4]
    printed = (
        0.5 * m_b * (x_dot**2 + y_dot**2 + z**2 * tilt_dot**2 + z**2 * s**2 * phi_dot**2)
        + m_b * z * c * tilt_dot * (x_dot * c_phi + y_dot * s_phi)
        + m_b * z * s * phi_dot * (-x_dot * s_phi + y_dot * c_phi)
    )
    assert number(derivation.BODY.translation, q, q_dot) == pytest.approx(printed, rel=1e-12)


@pytest.mark.parametrize("q, q_dot", random_states(5))
def test_2_19_rotation_of_the_body(q, q_dot):
    (s, c), phi_dot, tilt_dot = sc(q[3]), q_dot[2], q_dot[3]
    printed = 0.5 * 0.013 * tilt_dot**2 + 0.5 * (0.033 * s**2 + 0.021 * c**2) * phi_dot**2
    assert number(derivation.BODY.rotation, q, q_dot) == pytest.approx(printed, rel=1e-12)


@pytest.mark.parametrize("q, q_dot", random_states(5))
def test_2_21_2_22_rotation_of_wheels_and_rotors(q, q_dot):
    phi_dot, tilt_dot, right, left = q_dot[2:]
    for part, speed in zip(derivation.WHEELS, (right, left), strict=True):
        printed = 0.5 * (0.0017 * (speed + tilt_dot) ** 2 + 0.0011 * phi_dot**2)
        assert number(part.rotation, q, q_dot) == pytest.approx(printed, rel=1e-12)
    for part, speed in zip(derivation.ROTORS, (right, left), strict=True):
        printed = 0.5 * (0.0007 * (1.9 * speed + tilt_dot) ** 2 + 0.0005 * phi_dot**2)
        assert number(part.rotation, q, q_dot) == pytest.approx(printed, rel=1e-12)


@pytest.mark.parametrize("q, q_dot", random_states(5))
def test_wheels_carry_their_mass_around_the_robot(q, q_dot):
    """Row 3: both wheels' translation is m_w (v^2 + b^2 phi_dot^2); the b^2 is missing in (2.17)."""
    both = sum(number(part.translation, q, q_dot) for part in derivation.WHEELS)
    assert both == pytest.approx(0.7 * (q_dot[0] ** 2 + q_dot[1] ** 2 + 0.23**2 * q_dot[2] ** 2), rel=1e-12)


@pytest.mark.parametrize("q, q_dot", random_states(5))
def test_2_28_with_its_corrections(q, q_dot):
    (s_phi, c_phi), (s, c), phi_dot, tilt_dot = sc(q[2]), sc(q[3]), q_dot[2], q_dot[3]
    m_b, m_w, z, n, b = 3.1, 0.7, 0.11, 1.9, 0.23
    i_xx, i_yy, i_zz, i_w, i_wz, i_r, i_rz = 0.033, 0.013, 0.021, 0.0017, 0.0011, 0.0007, 0.0005
    total = m_b + 2.0 * m_w
    m_33 = (m_b * z**2 + i_xx) * s**2 + i_zz * c**2 + 2.0 * (i_wz + i_rz) + 2.0 * m_w * b**2
    m_44, m_45, m_55 = m_b * z**2 + i_yy + 2.0 * (i_w + i_r), i_w + n * i_r, i_w + n**2 * i_r + 0.0043
    m_13, m_14 = -m_b * z * s * s_phi, m_b * z * c * c_phi
    m_23, m_24 = m_b * z * s * c_phi, m_b * z * c * s_phi
    mass = [
        [total, 0, m_13, m_14, 0, 0], [0, total, m_23, m_24, 0, 0], [m_13, m_23, m_33, 0, 0, 0],
        [m_14, m_24, 0, m_44, m_45, m_45], [0, 0, 0, m_45, m_55, 0], [0, 0, 0, m_45, 0, m_55],
    ]
    shape = s * c * (m_b * z**2 + i_xx - i_zz)
    both, cross = tilt_dot**2 + phi_dot**2, 2.0 * m_b * z * c * tilt_dot * phi_dot
    velocity_terms = [
        -m_b * z * s * c_phi * both - cross * s_phi, -m_b * z * s * s_phi * both + cross * c_phi,
        2.0 * shape * tilt_dot * phi_dot, -shape * phi_dot**2, 0, 0,
    ]
    _, _, derived_mass, derived_terms, gravity = derivation.lagrangian()
    np.testing.assert_allclose(number(derived_mass, q, q_dot), mass, atol=1e-14)
    np.testing.assert_allclose(number(derived_terms, q, q_dot), velocity_terms, atol=1e-13)
    np.testing.assert_allclose(number(gravity, q, q_dot), [0, 0, 0, -m_b * GRAVITY * z * s, 0, 0], atol=1e-15)


@pytest.mark.parametrize("motion", MOTIONS)
def test_s_spans_the_null_space_of_a(motion):
    for q, q_dot in random_states(5):
        a, s = (number(matrix, q, q_dot, replace(UNLIKE, motion=motion)) for matrix in (derivation.A, derivation.S))
        assert np.abs(a @ s).max() < 1e-14
        assert np.linalg.matrix_rank(s) == np.linalg.matrix_rank(a) == 3


def test_s_is_2_41():
    (s_phi, c_phi), r, b = sc(0.7), 0.07, 0.23
    printed = [[c_phi, 0, 0], [s_phi, 0, 0], [0, 1, 0], [0, 0, 1], [1 / r, b / r, -1], [1 / r, -b / r, -1]]
    np.testing.assert_allclose(number(derivation.S, [0, 0, 0.7, 0, 0, 0], np.zeros(6)), printed, rtol=1e-14)


# -- The plant's kernel against the derivation


def kernel_accelerations(parameters, tilt, rates, torque):
    body = np.array(list(parameters.inertias().values()))
    radius = np.array([wheel.radius_m for wheel in parameters.geometry.wheels])
    return np.array(accelerations(tilt, *rates, *torque, np.zeros(3), radius, parameters.half_track_m, body))


@pytest.mark.parametrize("route", ["lagrange", "newton_euler"])
@pytest.mark.parametrize("motion", MOTIONS)
@pytest.mark.parametrize("parameters", [FREE, UNLIKE])
def test_the_kernels_accelerations_are_the_derived_ones(parameters, motion, route):
    parameters, rng = replace(parameters, motion=motion), np.random.default_rng(2)
    for _ in range(30):
        tilt, rates, torque = rng.uniform(-3.1, 3.1), rng.uniform(-5.0, 5.0, 3), rng.uniform(-1.0, 1.0, 2)
        derived = derivation.accelerations(parameters, tilt, rates, torque, route)
        kernel = kernel_accelerations(parameters, tilt, rates, torque)
        assert np.linalg.norm(kernel - derived) < 1e-12 * np.linalg.norm(derived)


@pytest.mark.parametrize("motion", MOTIONS)
def test_energies_and_momenta_lead_to_the_same_reduced_equations(motion):
    parameters, rng = replace(UNLIKE, motion=motion), np.random.default_rng(3)
    for _ in range(20):
        tilt, rates = rng.uniform(-3.0, 3.0), rng.uniform(-4.0, 4.0, 3)
        by_energies = derivation.reduced(parameters, tilt, rates, route="lagrange")
        by_momenta = derivation.reduced(parameters, tilt, rates, route="newton_euler")
        for by_energy, by_momentum in zip(by_energies, by_momenta, strict=True):
            np.testing.assert_allclose(by_energy, by_momentum, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("motion", MOTIONS)
def test_the_reduced_mass_matrix_is_the_hessian_of_the_kinetic_energy(motion):
    """S'MS without forming M: second differences of T(q, S v), exact for a quadratic form."""
    parameters, q = replace(UNLIKE, motion=motion), np.array([0.0, 0.0, 0.4, 0.9, 0.0, 0.0])
    s = number(derivation.S, q, np.zeros(6), parameters)

    def kinetic(v):
        return number(derivation.lagrangian()[0], q, s @ v, parameters)

    unit = np.eye(3)
    hessian = [[kinetic(unit[i] + unit[j]) - kinetic(unit[i]) - kinetic(unit[j]) for j in range(3)] for i in range(3)]
    np.testing.assert_allclose(derivation.reduced(parameters, 0.9, np.zeros(3), 0.4)[0], hessian, atol=1e-14)


def test_the_reduced_equations_do_not_depend_on_the_heading():
    tilt, rates = 0.6, [0.5, 1.0, -2.0]
    for yaw in (0.8, -2.5):
        turned = derivation.reduced(UNLIKE, tilt, rates, yaw)
        for here, there in zip(derivation.reduced(UNLIKE, tilt, rates), turned, strict=True):
            np.testing.assert_allclose(there, here, atol=1e-13)


def test_the_plant_block_accelerates_as_derived():
    plant, torque = PendulumPlant(FREE), [0.2, -0.1]
    context = plant.CreateDefaultContext()
    plant.get_input_port().FixValue(context, torque)
    state = context.get_mutable_continuous_state_vector()
    state[TILT], state[S_RATE], state[YAW_RATE], state[TILT_RATE] = 0.7, 0.5, 1.5, -2.0
    rates = plant.EvalTimeDerivatives(context).CopyToVector()
    derived = derivation.accelerations(FREE, 0.7, [0.5, 1.5, -2.0], torque)
    np.testing.assert_allclose(rates[[S_RATE, YAW_RATE, TILT_RATE]], derived, rtol=1e-12)


def test_friction_enters_as_a_torque_at_the_wheels():
    plant = PendulumPlant(PendulumPlantParameters(friction=Friction(viscous_n_m_s=0.01)))
    context = plant.CreateDefaultContext()
    plant.get_input_port().FixValue(context, [0.0, 0.0])
    state = context.get_mutable_continuous_state_vector()
    state[S_RATE], state[YAW_RATE], state[TILT_RATE] = 0.4, 0.2, 1.0
    # wheels relative to the body: 0.4/0.08 - 1 +- 0.2 * 0.2/0.08 = 4.5 and 3.5 rad/s
    assert plant.GetOutputPort("wheel_rate").Eval(context) == pytest.approx([4.5, 3.5])
    rates = plant.EvalTimeDerivatives(context).CopyToVector()
    derived = derivation.accelerations(FREE, 0.0, [0.4, 0.2, 1.0], [-0.045, -0.035])
    np.testing.assert_allclose(rates[[S_RATE, YAW_RATE, TILT_RATE]], derived, rtol=1e-12)


@pytest.mark.parametrize("tilt, rates, torque", [(0.0, [0, 0, 0], [0, 0]), (0.6, [0.4, 1.5, -2.0], [0.2, 0.05])])
def test_the_imu_feels_the_acceleration_of_its_own_place(tilt, rates, torque):
    """Specific force R_WB' (a - g) and rate R_WB' w at 0.3 m above the axle, from the derivation's own vectors."""
    plant = PendulumPlant(FREE, imu_height_m=0.3)
    context = plant.CreateDefaultContext()
    plant.get_input_port().FixValue(context, torque)
    state = context.get_mutable_continuous_state_vector()
    state[PHI], state[TILT], state[S_RATE], state[YAW_RATE], state[TILT_RATE] = 0.8, tilt, *rates
    q = np.array([0.0, 0.0, 0.8, tilt, 0.0, 0.0])
    s = number(derivation.S, q, np.zeros(6), FREE)
    q_dot = s @ rates
    s_dot = number([derivation.rate(row) for row in derivation.S], q, q_dot, FREE)
    q_ddot = s @ derivation.accelerations(FREE, tilt, rates, torque) + s_dot @ rates
    at_imu = derivation.environment(replace(FREE, centre_of_gravity_m=0.3), q, q_dot)
    along, rest = (Jacobian(derivation.v_WC, names) for names in (derivation.Q_DOT, derivation.Q))
    acceleration = derivation.numbers(along, at_imu) @ q_ddot + derivation.numbers(rest, at_imu) @ q_dot
    r_wb = derivation.numbers(derivation.R_WB, at_imu)
    measured = plant.GetOutputPort("body_motion").Eval(context)
    np.testing.assert_allclose(measured[:3], r_wb.T @ (acceleration + [0, 0, GRAVITY]), atol=1e-12)
    np.testing.assert_allclose(measured[3:], r_wb.T @ derivation.numbers(derivation.w_WB, at_imu), atol=1e-14)


# -- Along a motion


def swing(config, parameters=FREE, tilt=1.0, yaw_rate=2.0, torque=(0.0, 0.0), until=10.0):
    """Yields (plant, context) every half second of a motion that starts at `tilt`."""
    plant = PendulumPlant(parameters, initial_tilt_rad=tilt)
    simulator = Simulator(plant)
    ApplySimulatorConfig(config, simulator)
    context = simulator.get_mutable_context()
    plant.get_input_port().FixValue(context, torque)
    context.get_mutable_continuous_state_vector()[YAW_RATE] = yaw_rate
    yield plant, context
    for seconds in np.arange(0.5, until + 0.25, 0.5):
        simulator.AdvanceTo(seconds)
        yield plant, context


def coordinates(context):
    """(q (6,), v (3,)) of the derivation from the plant's state."""
    state = context.get_continuous_state_vector().CopyToVector()
    return state[[0, 1, PHI, TILT, THETA_R, THETA_L]], state[[S_RATE, YAW_RATE, TILT_RATE]]


def energies(context, parameters=FREE):
    """(kinetic, potential) [J] by the derivation's formulas."""
    q, v = coordinates(context)
    q_dot = number(derivation.S, q, np.zeros(6), parameters) @ v
    return number(derivation.lagrangian()[:2], q, q_dot, parameters)


def drift(config):
    totals = [energies(context).sum() for _, context in swing(config)]
    return np.abs(np.array(totals) / totals[0] - 1.0).max()


def test_energy_is_kept_through_large_swings():
    assert drift(PRECISE) < 1e-8


def test_these_swings_are_large():
    tilts = [coordinates(context)[0][3] for _, context in swing(PRECISE)]
    kinetic = [energies(context)[0] for _, context in swing(PRECISE)]
    assert np.ptp(tilts) > 3.0
    assert max(kinetic) > 5.0 * kinetic[0]


def test_the_fixed_5_ms_step_does_not_keep_energy():
    """Why energy is checked with error control: a falling pendulum is too fast for 5 ms."""
    assert 1e-4 < drift(FIXED_STEP) < 1e-2


@pytest.mark.parametrize("motion", MOTIONS)
def test_a_motion_without_slip_keeps_the_constraints(motion):
    parameters = KAPPA[motion]
    for plant, context in swing(PRECISE, parameters, tilt=0.5, torque=(0.02, -0.01), until=3.0):
        derivative = plant.EvalTimeDerivatives(context).CopyToVector()
        q_dot = derivative[[0, 1, PHI, TILT, THETA_R, THETA_L]]
        constraint = number(derivation.A, coordinates(context)[0], q_dot, parameters) @ q_dot
        assert np.abs(constraint).max() < 1e-13 * max(np.abs(q_dot).max(), 1.0)


def test_the_motors_work_becomes_energy():
    """d(T + U)/dt = tau . theta_dot, so under constant torque the work is tau . (theta - theta_0)."""
    torque = np.array([0.03, -0.01])
    start = None
    for plant, context in swing(PRECISE, torque=torque, until=3.0):
        total = energies(context).sum() - torque @ plant.GetOutputPort("wheel_angle").Eval(context)
        start = total if start is None else start
        assert total == pytest.approx(start, rel=1e-8)


def test_odometry_from_the_wheels_alone_misses_radius_times_tilt():
    for plant, context in swing(PRECISE, tilt=0.3, yaw_rate=0.0, until=2.0):
        x, _, _ = plant.GetOutputPort("pose").Eval(context)
        tilt = plant.GetOutputPort("balance").Eval(context)[0]
        wheels = 0.08 * plant.GetOutputPort("wheel_angle").Eval(context).mean()
        assert x - wheels == pytest.approx(0.08 * (tilt - 0.3), abs=1e-7)
    assert abs(x - wheels) > 0.01


# -- Wheels of two radii


def two_radii(parameters, tilt, rates):
    """(M_bar, h, E_bar) as `derivation.reduced`, with constraints in which each wheel has its own radius."""
    (right, left), b = (wheel.radius_m for wheel in parameters.geometry.wheels), parameters.half_track_m
    kappa, yaw_rate = float(MOTIONS.index(parameters.motion)), rates[1]
    s = np.array([
        [1.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0],
        [1.0 / right, b / right, -kappa], [1.0 / left, -b / left, -kappa],
    ])
    s_dot = np.zeros((6, 3))
    s_dot[1, 0] = yaw_rate  # heading 0: d(cos phi)/dt = 0, d(sin phi)/dt = phi_dot
    q, q_dot = np.array([0.0, 0.0, 0.0, tilt, 0.0, 0.0]), s @ rates
    _, _, mass, velocity_terms, gravity = (number(entry, q, q_dot, parameters) for entry in derivation.lagrangian())
    rest = velocity_terms + gravity
    return s.T @ mass @ s, s.T @ (mass @ s_dot @ rates + rest), s.T @ derivation.E


@pytest.mark.parametrize("motion", MOTIONS)
@pytest.mark.parametrize("shares", [[0.0, 0.0], [0.1, -0.2], [0.0, 0.3]])
def test_wheels_of_two_radii_accelerate_as_derived(motion, shares):
    parameters = replace(UNLIKE, motion=motion, wheel_radius_shares=shares)
    rng = np.random.default_rng(5)
    for _ in range(10):
        tilt, rates, torque = rng.uniform(-3.1, 3.1), rng.uniform(-5.0, 5.0, 3), rng.uniform(-1.0, 1.0, 2)
        mass, rest, effort = two_radii(parameters, tilt, rates)
        derived = np.linalg.solve(mass, effort @ torque - rest)
        kernel = kernel_accelerations(parameters, tilt, rates, torque)
        assert np.linalg.norm(kernel - derived) < 1e-12 * np.linalg.norm(derived)
    np.testing.assert_allclose(linear_terms(parameters)[0], two_radii(parameters, 0.0, np.zeros(3))[0], atol=1e-15)
    np.testing.assert_allclose(linear_terms(parameters)[2], two_radii(parameters, 0.0, np.zeros(3))[2], atol=1e-14)


def test_each_wheel_rolls_on_its_own_radius():
    plant = PendulumPlant(replace(FREE, wheel_radius_shares=[0.25, 0.0]))
    context = plant.CreateDefaultContext()
    plant.get_input_port().FixValue(context, [0.0, 0.0])
    state = context.get_mutable_continuous_state_vector()
    state[S_RATE], state[YAW_RATE], state[TILT_RATE] = 0.4, 0.5, 1.0
    # (0.4 + 0.2 * 0.5)/0.1 - 1 and (0.4 - 0.2 * 0.5)/0.08 - 1 rad/s
    rate = plant.GetOutputPort("wheel_rate").Eval(context)
    assert rate == pytest.approx([4.0, 2.75])
    np.testing.assert_array_equal(plant.EvalTimeDerivatives(context).CopyToVector()[[THETA_R, THETA_L]], rate)


def test_energy_is_kept_with_wheels_of_two_radii():
    uneven = replace(FREE, wheel_radius_shares=[0.2, -0.1])
    totals = []
    for plant, context in swing(PRECISE, uneven, until=4.0):
        q, v = coordinates(context)
        q_dot = np.array([v[0], 0.0, *v[1:], *plant.GetOutputPort("wheel_rate").Eval(context)])
        q[2] = 0.0  # with the heading along x the axle's middle moves along x
        totals.append(number(derivation.lagrangian()[:2], q, q_dot, uneven).sum())
    assert np.abs(np.array(totals) / totals[0] - 1.0).max() < 1e-8


# -- Linearisation, (2.49)-(2.57)


def drake_linearisation(parameters):
    plant = PendulumPlant(parameters)
    context = plant.CreateDefaultContext()
    plant.get_input_port().FixValue(context, np.zeros(2))
    model = Linearize(plant, context, plant.get_input_port().get_index(), plant.GetOutputPort("balance").get_index())
    rates = [S_RATE, YAW_RATE, TILT_RATE]
    return model.A()[rates, TILT], model.B()[rates]


@pytest.mark.parametrize("parameters", [FREE, UNLIKE, LITERATURE])
def test_three_ways_to_linearise_agree(parameters):
    a, b = linear_model(parameters)
    a_wired, b_wired = balance_gains.linearised(parameters)
    a_block, b_block = drake_linearisation(parameters)
    np.testing.assert_allclose(a_wired, a, atol=1e-10)
    np.testing.assert_allclose(b_wired, b, atol=1e-10)
    np.testing.assert_allclose(a_block, a[3:, 2], atol=1e-10)
    np.testing.assert_allclose(b_block, b[3:], atol=1e-10)


@pytest.mark.parametrize("motion", MOTIONS)
def test_linear_terms_are_the_derivation_upright(motion):
    parameters = replace(UNLIKE, motion=motion)
    mass, gravity, effort = linear_terms(parameters)
    derived_mass, _, derived_effort = derivation.reduced(parameters, 0.0, np.zeros(3))
    small = 1e-6
    derived_gravity = derivation.reduced(parameters, small, np.zeros(3))[1] / small
    np.testing.assert_allclose(mass, derived_mass, atol=1e-15)
    np.testing.assert_allclose(effort, derived_effort, atol=1e-14)
    np.testing.assert_allclose(gravity @ [0, 0, 1], derived_gravity, rtol=1e-10)


def test_linear_terms_by_hand():
    mass, gravity, effort = linear_terms(FREE)
    # m11 = 4 + 2 * 0.0013/0.08^2, m13 = 3.5 * 0.04 + 2 (n - n^2) I_r/r, m33 = 3.5 * 0.04^2 + 8.5e-4 + 2 (1 - n)^2 I_r
    assert (mass[0, 0], mass[0, 2], mass[2, 2]) == pytest.approx((4.40625, 0.140001, 0.00648184), rel=1e-6)
    # 0.0255 + 2 (0.00065 + 0.000016) + 2 * 0.25 * 0.2^2 + 2 (0.2/0.08)^2 * 0.0013
    assert mass[1, 1] == pytest.approx(0.063082, abs=1e-6)
    assert gravity[2, 2] == pytest.approx(-3.5 * 0.04 * 9.80665)
    np.testing.assert_allclose(effort, [[12.5, 12.5], [2.5, -2.5], [-1.0, -1.0]])


def test_the_linear_plant_in_numbers():
    a, b = linear_model(FREE)
    both = b[3:].sum(axis=1)
    assert np.sqrt(a[5, 2]) == pytest.approx(25.98, abs=0.01)  # tilt pole [1/s]
    assert np.abs(np.linalg.eigvals(a)).max() == pytest.approx(25.98, abs=0.01)
    assert (both[0], both[2]) == pytest.approx((49.33, -1374.1), abs=0.05)  # per unit torque on both wheels
    assert b[4, 0] == -b[4, 1] == pytest.approx(2.5 / 0.063082, rel=1e-5)


@pytest.mark.filterwarnings("ignore:invalid value encountered")  # of NumPy, on Expressions
@pytest.mark.parametrize("parameters", [FREE, UNLIKE])
def test_the_symbolic_plants_derivative_is_the_linearisation(parameters):
    plant = PendulumPlant(parameters).ToSymbolic()
    context = plant.CreateDefaultContext()
    state, torque = MakeVectorContinuousVariable(THETA_L + 1, "x"), MakeVectorContinuousVariable(2, "tau")
    context.SetContinuousState([Expression(variable) for variable in state])
    plant.get_input_port().FixValue(context, [Expression(variable) for variable in torque])
    derivative = plant.EvalTimeDerivatives(context).CopyToVector()[[S_RATE, YAW_RATE, TILT_RATE]]
    upright = dict.fromkeys([*state, *torque], 0.0)
    a, b = linear_model(parameters)
    np.testing.assert_allclose(Evaluate(Jacobian(derivative, state[[TILT]]), upright).ravel(), a[3:, 2], atol=1e-10)
    np.testing.assert_allclose(Evaluate(Jacobian(derivative, state[[S_RATE, YAW_RATE, TILT_RATE]]), upright), a[3:, 3:])
    np.testing.assert_allclose(Evaluate(Jacobian(derivative, torque), upright), b[3:], atol=1e-10)


def test_mobility_is_wheel_acceleration_per_torque():
    plant = PendulumPlant(FREE)
    for wheel in range(2):
        context = plant.CreateDefaultContext()
        plant.get_input_port().FixValue(context, np.eye(2)[wheel])
        s_ddot, yaw_ddot, tilt_ddot = plant.EvalTimeDerivatives(context).CopyToVector()[[S_RATE, YAW_RATE, TILT_RATE]]
        turn = 0.2 * yaw_ddot / 0.08
        expected = [s_ddot / 0.08 - tilt_ddot + turn, s_ddot / 0.08 - tilt_ddot - turn]
        np.testing.assert_allclose(mobility(FREE)[:, wheel], expected, rtol=1e-12)


# -- What the print says instead (docs/fidelity.md)


def test_rows_1_and_2_the_printed_mass_matrix_lacks_the_coupling():
    n, i_r, i_w, r = 1.0 / 400.0, 1.6e-5, 0.0013, 0.08
    mass, _, _ = linear_terms(FREE)
    printed_m13 = 2.0 * (n - n**2) * i_r / r**2
    printed_m33 = 4.0 * 0.04**2 + 8.5e-4 + 2.0 * ((1.0 + n**2 - n) * i_r - i_w)
    assert (printed_m13, mass[0, 2]) == pytest.approx((1.25e-5, 0.14), rel=3e-3)
    assert (printed_m33, mass[2, 2]) == pytest.approx((0.00468, 0.00648), abs=1e-5)
    # the printed plant would fall at 18.3 1/s, and torque would not move the base through the body
    assert np.sqrt(4.0 * 0.04 * GRAVITY / printed_m33) == pytest.approx(18.3, abs=0.05)


def test_row_3_the_printed_yaw_inertia_lacks_the_wheels_distance():
    mass, _, _ = linear_terms(FREE)
    rolling = 2.0 * 2.5**2 * (0.0013 + 1.6e-5 / 400.0**2)
    printed = 0.0255 + (0.00065 + 1.6e-5) + rolling
    assert (printed, mass[1, 1]) == pytest.approx((0.0424, 0.0631), abs=5e-5)
    assert mass[1, 1] - 2.0 * 0.25 * 0.2**2 == pytest.approx(0.0431, abs=5e-5)  # (2.24)'s factor 2, no 2 m_w b^2


def test_the_literatures_motion_is_another_plant():
    a, b = linear_model(LITERATURE)
    both = b[3:].sum(axis=1)
    assert np.sqrt(a[5, 2]) == pytest.approx(24.28, abs=0.01)
    assert (both[0], both[2]) == pytest.approx((22.13, -420.3), abs=0.05)  # derived 49.33, -1374.1
    assert linear_terms(LITERATURE)[2][2].tolist() == [0.0, 0.0]  # the motors' reaction on the body is missing


def test_row_5_the_printed_plant_hangs():
    plant = LinearPendulumPlant(FREE, initial_tilt_rad=0.1)
    simulator = Simulator(plant)
    ApplySimulatorConfig(PRECISE, simulator)
    context = simulator.get_mutable_context()
    plant.get_input_port().FixValue(context, [0.0, 0.0])
    for seconds in np.linspace(0.1, 4.0, 40):
        simulator.AdvanceTo(seconds)
        tilt = plant.GetOutputPort("balance").Eval(context)[0]
        assert tilt == pytest.approx(0.1 * np.cos(np.sqrt(9.87) * seconds), abs=1e-6)


def test_row_5_the_printed_plant_is_3_41_and_3_42():
    plant = LinearPendulumPlant(FREE)
    context = plant.CreateDefaultContext()
    plant.get_input_port().FixValue(context, [1.0, 0.5])
    context.get_mutable_continuous_state_vector()[TILT] = 0.1
    rates = plant.EvalTimeDerivatives(context).CopyToVector()[[S_RATE, YAW_RATE, TILT_RATE]]
    assert rates == pytest.approx([1.21 * 0.1 - 1.73 * 1.5, 101.46 * 0.5, -9.87 * 0.1 + 35.39 * 1.5], rel=1e-13)


def test_row_5_the_printed_plants_imu_to_first_order():
    plant = LinearPendulumPlant(FREE, initial_tilt_rad=0.1, imu_height_m=0.3)
    context = plant.CreateDefaultContext()
    plant.get_input_port().FixValue(context, [0.0, 0.0])
    # s_ddot = 0.121, 0.3 m * theta_ddot = -0.2961, gravity -0.980665
    assert plant.GetOutputPort("body_motion").Eval(context) == pytest.approx([-1.155765, 0, GRAVITY, 0, 0, 0], rel=1e-9)


def test_row_5_negated_it_is_no_robot_either():
    """M^-1 [0, m_b g z] = (-1.21, 9.87) and M^-1 [1/r, -1] = (1.73, -35.39) leave no positive definite M for any r."""
    for radius in np.linspace(0.005, 1.0, 200):
        lift = (1.21 / radius + 9.87) / 35.39  # m_b g z from the last row
        inverse = np.array([[radius * (1.73 - 1.21 / lift), -1.21 / lift], [-1.21 / lift, 9.87 / lift]])
        np.testing.assert_allclose(inverse @ [1.0 / radius, -1.0], [1.73, -35.39], rtol=1e-10)
        assert np.linalg.det(inverse) < 0.0


def test_row_8_the_printed_sign_of_6_37_hangs_too():
    mass, gravity, _ = linear_terms(FREE)
    block = TICK_S * np.linalg.solve(mass, gravity)
    one, step = np.eye(3), TICK_S * np.eye(3)
    printed, corrected = (np.block([[one, step], [sign * block, one]]) for sign in (1.0, -1.0))
    np.testing.assert_allclose(corrected, euler(*linear_model(FREE), TICK_S)[0], atol=1e-14)
    assert np.sort(np.abs(np.linalg.eigvals(corrected).real))[-1] == pytest.approx(1.1299, abs=1e-4)  # 1 + 25.98 T
    oscillation = np.linalg.eigvals(printed)
    assert np.abs(oscillation.imag).max() == pytest.approx(0.1299, abs=1e-4)  # 1 +- 25.98 i T


def test_row_8_euler_and_zero_order_hold_give_different_gains():
    exact = dlqr(*linear_model(FREE), Q, R, TICK_S)[0]
    approximate = control.dlqr(*euler(*linear_model(FREE), TICK_S), np.diag(Q), np.diag(R))[0][0]
    assert np.abs(exact) == pytest.approx([0.2422, 0.2191, 1.0028, 0.2991, 0.1016, 0.1243], abs=1e-4)
    assert np.abs(approximate) == pytest.approx([0.2434, 0.2191, 1.0093, 0.3023, 0.1022, 0.1250], abs=1e-4)


# -- The printed gains (docs/fidelity.md, rows 9 to 11)

Q, R = [5e3, 1e3, 800.0, 50.0, 100.0, 1e3], [1e4, 1e4]  # (6.40), (6.41)
K = np.array([[0.4351, -0.2217], [0.4351, 0.2217]])  # (6.42)
F1 = np.array([[1.3328, 0.5548, -0.0843, 0.2023], [1.3328, 0.5548, 0.0843, 0.2023]])  # (6.43)
F_4_11 = np.array([[-0.3, 0.05, -1.0, -0.49, 0.03, -0.2], [-0.3, -0.05, -1.0, -0.49, -0.03, -0.2]])


def test_row_9_the_printed_gains_as_meant_balance_the_corrected_plant():
    assert spectral_radius(*linear_model(FREE), from_printed(K, F1), TICK_S) == pytest.approx(0.9934, abs=1e-4)


def test_row_9_the_gains_of_4_11_balance_it_too():
    assert spectral_radius(*linear_model(FREE), F_4_11, TICK_S) == pytest.approx(0.9962, abs=1e-4)


def test_row_9_6_39_read_literally_is_unstable():
    """tau = -K x1 - F1 x2 with x1 = P_d - P, hence +K P."""
    a, b = linear_model(FREE)
    literal = np.hstack([-K, F1])
    a_d, b_d = euler(a, b, TICK_S)
    assert np.abs(np.linalg.eigvals(a_d - b_d @ literal)).max() == pytest.approx(2.30, abs=0.005)
    assert spectral_radius(a, b, literal, TICK_S) == pytest.approx(2.344, abs=0.001)  # zero-order hold


def test_row_9_the_left_wheels_gains_mirror_the_right_ones():
    gain = from_printed(K, F1)
    np.testing.assert_array_equal(gain[1], gain[0] * [1, -1, 1, 1, -1, 1])
    np.testing.assert_array_equal(gain[0], [-0.4351, 0.2217, -1.3328, -0.5548, 0.0843, -0.2023])


def test_row_10_dlqr_of_table_2_1():
    gain = dlqr(*linear_model(FREE), Q, R, TICK_S)
    assert np.abs(gain[0]) == pytest.approx([0.242, 0.219, 1.003, 0.299, 0.102, 0.124], abs=5e-4)
    np.testing.assert_array_equal(np.sign(gain), [[-1, 1, -1, -1, 1, -1], [-1, -1, -1, -1, -1, -1]])


def test_row_10_dlqr_with_ten_times_the_pitch_inertia_is_near_the_print():
    gain = dlqr(*linear_model(replace(FREE, body_inertia_pitch_kg_m2=8.5e-3)), Q, R, TICK_S)[0]
    assert np.abs(gain) == pytest.approx([0.419, 0.219, 1.410, 0.527, 0.102, 0.237], abs=6e-4)
    printed = np.array([0.4351, 0.2217, 1.3328, 0.5548, 0.0843, 0.2023])
    assert np.abs(np.abs(gain) / printed - 1.0).max() < 0.22


def test_the_default_pendulum_is_designed_with_row_10s_gain():
    settings = PendulumSettings()
    assert np.abs(balance_gains.balance_gain(settings.plant, settings.control)[0]) == pytest.approx(
        [0.242, 0.219, 1.003, 0.299, 0.102, 0.124], abs=5e-4
    )


def lqr(a, b, q, r):
    """The gain of u = -K x that minimises the integral of x'Qx + u'Ru."""
    return np.linalg.solve(r, b.T @ solve_continuous_are(a, b, q, r))


def test_row_11_4_10_with_a_torque_weight_of_1e6_is_near_4_11():
    gain = lqr(*linear_model(FREE), np.diag([2e5, 5e3, 1e2, 1e4, 1e3, 8e4]), 1e6 * np.eye(2))
    assert np.abs(gain[0]) == pytest.approx([0.316, 0.050, 1.374, 0.453, 0.042, 0.221], abs=5e-4)
    np.testing.assert_array_equal(np.sign(gain), np.sign(F_4_11))


def servo(plant_a, plant_b):
    """(A_s, B_s) of (3.53)-(3.54), x = [s, theta, s_dot, theta_dot, omega] with omega_dot = -s."""
    rows = [0, 2, 3, 5]
    a, b = np.zeros((5, 5)), np.zeros((5, 2))
    a[:4, :4], a[4, 0], b[:4] = plant_a[np.ix_(rows, rows)], -1.0, plant_b[rows]
    return a, b


def printed_plant():
    a, b = np.zeros((6, 6)), np.zeros((6, 2))
    a[:3, 3:] = np.eye(3)
    a[3, 2], a[5, 2] = 1.21, -9.87
    b[3:] = [[-1.73, -1.73], [101.46, -101.46], [35.39, 35.39]]
    return a, b


SERVO_F = np.array([[6.7056, 2.1560, 6.0055, 0.6502]] * 2)  # (3.61)
SERVO_K_I = np.array([[3.5355]] * 2)  # (3.62)


def test_row_11_the_servo_gain_follows_from_its_weight():
    weights = np.diag([2e5, 8e2, 1e2, 6e3, 4e3])
    gain = lqr(*servo(*printed_plant()), weights, 160.0 * np.eye(2))
    assert np.abs(gain[:, 4]) == pytest.approx([np.sqrt(4e3 / (2.0 * 160.0))] * 2, rel=1e-6)
    assert np.sqrt(4e3 / (2.0 * 160.0)) == pytest.approx(3.5355, abs=5e-5)
    assert np.abs(np.abs(gain[0, :4]) / SERVO_F[0] - 1.0).max() > 0.5  # F does not follow


@pytest.mark.parametrize("plant, sign, slowest", [("printed", 1.0, -0.80), ("derived", -1.0, -0.59)])
def test_row_11_signs_of_the_servo_loop(plant, sign, slowest):
    """Printed plant: u = -F x + K_i omega; derived plant: u = +F x - K_i omega. Each is lost with the other's signs."""
    a, b = servo(*(printed_plant() if plant == "printed" else linear_model(FREE)))
    gain = np.hstack([SERVO_F, -SERVO_K_I])
    assert np.linalg.eigvals(a - sign * b @ gain).real.max() == pytest.approx(slowest, abs=0.01)
    assert np.linalg.eigvals(a + sign * b @ gain).real.max() > 1.0


def test_the_linear_plants_wheels_turn_as_it_drives_and_yaws():
    plant = LinearPendulumPlant(PendulumPlantParameters())
    context = plant.CreateDefaultContext()
    plant.get_input_port().FixValue(context, [0.0, 0.0])
    state = context.get_mutable_continuous_state_vector()
    state[S_RATE], state[YAW_RATE], state[TILT_RATE] = 0.4, 0.2, 1.0
    # relative to the body: 0.4 / 0.08 - 1 +- 0.2 * 0.2 / 0.08
    assert plant.GetOutputPort("wheel_rate").Eval(context) == pytest.approx([4.5, 3.5])
