"""The floor's forces on the pendulum's wheels: against the multipliers of the derivation, against Newton's and Euler's
laws for the whole robot, and against the contacts of another physics engine."""

from dataclasses import replace

import numpy as np
import pendulum_lagrangian as derivation
import pytest

import control
from drake_ispace.plants.contact import FORWARD_L, FORWARD_R, NORMAL_L, NORMAL_R, SIDEWAYS, grip_used
from drake_ispace.plants.friction import Friction
from drake_ispace.plants.pendulum import (
    MOTIONS,
    S_RATE,
    TILT,
    TILT_RATE,
    YAW_RATE,
    PendulumPlant,
    PendulumPlantParameters,
    linear_model,
)
from drake_ispace.plants.slip import GRAVITY

FREE = PendulumPlantParameters(friction=Friction())
UNLIKE = replace(
    FREE, body_inertia_roll_kg_m2=0.05, body_inertia_pitch_kg_m2=0.004, gear_ratio=0.02, rotor_inertia_kg_m2=0.02,
    rotor_inertia_yaw_kg_m2=0.03, wheel_inertia_yaw_kg_m2=0.002,
)


def forces_of(plant, state, torque, context=None):
    """(5,) of the port `contact` at tilt, s_dot, phi_dot, tilt rate."""
    context = context or plant.CreateDefaultContext()
    plant.get_input_port().FixValue(context, torque)
    values = context.get_mutable_continuous_state_vector()
    values[TILT], values[S_RATE], values[YAW_RATE], values[TILT_RATE] = state
    return plant.GetOutputPort("contact").Eval(context)


def motion_of(parameters, tilt, rates, torque, yaw=0.3):
    """q, q_dot, q_ddot (6,) by the derivation."""
    q = np.array([0.0, 0.0, yaw, tilt, 0.0, 0.0])
    s = derivation.numbers(derivation.S, derivation.environment(parameters, q))
    q_dot = s @ rates
    where = derivation.environment(parameters, q, q_dot)
    s_dot = derivation.numbers(np.array([derivation.rate(row) for row in derivation.S]), where)
    return q, q_dot, s @ derivation.accelerations(parameters, tilt, rates, torque) + s_dot @ rates


def random_motions(number):
    rng = np.random.default_rng(4)
    for _ in range(number):
        yield rng.uniform(-1.4, 1.4), rng.uniform(-4.0, 4.0, 3), rng.uniform(-1.0, 1.0, 2)


@pytest.mark.parametrize("motion", MOTIONS)
@derivation.quiet
def test_forces_along_the_floor_are_the_multipliers_of_2_45(motion):
    parameters = replace(UNLIKE, motion=motion, drive_inertia_kg_m2=0.004)
    plant = PendulumPlant(parameters)
    for tilt, rates, torque in random_motions(10):
        q, q_dot, q_ddot = motion_of(parameters, tilt, rates, torque)
        where = derivation.environment(parameters, q, q_dot)
        _, _, mass, velocity_terms, gravity = derivation.lagrangian()
        left_over = derivation.E @ torque - derivation.numbers(mass, where) @ q_ddot - derivation.numbers(
            velocity_terms + gravity, where
        )
        multipliers = np.linalg.lstsq(derivation.numbers(derivation.A, where).T, left_over)[0]
        forces = forces_of(plant, (tilt, *rates), torque)
        # its first row holds -y_V, the others x_V with the torque arm -r
        expected = [multipliers[0], -multipliers[1], -multipliers[2]]
        np.testing.assert_allclose(forces[[SIDEWAYS, FORWARD_R, FORWARD_L]], expected, atol=1e-10)


def test_all_forces_together_move_and_turn_all_masses():
    """Sum of forces = d/dt of the momentum, sum of moments about the floor = d/dt of the angular momentum about the
    direction of travel; the derivatives are differences over two instants of the derivation's own vectors."""
    plant, h = PendulumPlant(UNLIKE), 1e-5

    def momenta(q, q_dot):
        where = derivation.environment(UNLIKE, q, q_dot)
        linear, angular = np.zeros(3), np.zeros(3)
        places = [derivation.p_WC, derivation.p_WR, derivation.p_WL, derivation.p_WV, derivation.p_WV]
        for part, place in zip(derivation.PARTS[: len(places)], places, strict=True):
            mass = derivation.numbers([part.mass], where)[0]
            momentum = mass * derivation.numbers(part.velocity, where)
            linear += momentum
            angular += np.cross(derivation.numbers(place, where), momentum)
            angular += derivation.numbers(part.inertia, where) @ derivation.numbers(part.spin, where)
        return linear, angular

    for tilt, rates, torque in random_motions(6):
        q, q_dot, q_ddot = motion_of(UNLIKE, tilt, rates, torque, yaw=0.0)
        ends = [momenta(q + d * q_dot + d * d / 2 * q_ddot, q_dot + d * q_ddot) for d in (-h, h)]
        force, moment = ((after - before) / (2 * h) for before, after in zip(*ends, strict=True))
        found = forces_of(plant, (tilt, *rates), torque)
        weight = (UNLIKE.body_mass_kg + 2 * UNLIKE.wheel_mass_kg) * GRAVITY
        total = [found[FORWARD_R] + found[FORWARD_L], found[SIDEWAYS], found[NORMAL_R] + found[NORMAL_L] - weight]
        np.testing.assert_allclose(total, force, atol=1e-5)
        roll = UNLIKE.half_track_m * (found[NORMAL_L] - found[NORMAL_R])
        assert roll == pytest.approx(moment[0], abs=1e-5)


def test_at_rest_each_wheel_carries_half_of_the_weight():
    weight = (FREE.body_mass_kg + 2 * FREE.wheel_mass_kg) * GRAVITY
    assert forces_of(PendulumPlant(FREE), (0, 0, 0, 0), [0, 0]) == pytest.approx([0, 0, 0, weight / 2, weight / 2])


def test_in_a_fast_bend_to_the_left_the_left_wheel_lifts():
    force = forces_of(PendulumPlant(FREE), (0.0, 4.0, 5.0, 0.0), [0.0, 0.0])
    assert force[SIDEWAYS] > 0.0
    assert force[NORMAL_L] < force[NORMAL_R]
    faster = forces_of(PendulumPlant(FREE), (0.0, 8.0, 8.0, 0.0), [0.0, 0.0])
    assert grip_used(faster[None], 0.6)[0, 1] == np.inf


def test_a_wheel_slips_where_it_uses_more_than_its_grip():
    used = grip_used(np.array([[6.0, 3.0, 0.0, 20.0, 20.0], [3.0, 0.0, 8.0, 20.0, 20.0]]), 0.5)
    np.testing.assert_allclose(used, [[0.6, 0.3], [0.5, 0.4]])


# -- Against MuJoCo

#: Forward speed and turning rate [m/s, rad/s] as amplitude and frequency [Hz] each, and what is constant in them.
MOTIONS_OF_TEN = [
    (0.5, 0.7, 0.0, 0.0, 0.0), (0.9, 0.4, 0.0, 0.0, 0.0), (0.4, 1.0, 2.0, 0.5, 0.0), (0.0, 0.0, 4.0, 0.4, 0.0),
    (0.3, 0.6, 0.0, 0.0, 1.5), (0.5, 0.5, 0.0, 0.0, 3.0), (0.6, 0.8, 3.0, 0.8, 0.0), (0.8, 0.3, 2.0, 0.3, 1.0),
    (0.2, 1.4, 1.0, 1.1, 2.0), (0.7, 0.5, 2.5, 0.5, -1.0),
]


@pytest.mark.parametrize("motion", MOTIONS_OF_TEN)
def test_forces_are_those_of_mujocos_contacts(motion):
    mujoco = pytest.importorskip("mujoco")
    errors = against_mujoco(mujoco, *motion)
    assert max(errors.values()) < 0.03, errors


def against_mujoco(mujoco, speed, speed_hz, turning, turning_hz, turn, seconds=2.5, settling=500):
    """Differences, rms, as shares of the rms force, over a motion that a state feedback keeps upright in MuJoCo."""
    from hidden.effects_truth import complete
    from hidden.mujoco_pendulum import _state, model_of

    model = model_of(FREE, complete("pendulum", {}), 0.0)
    data, plant, z = mujoco.MjData(model), PendulumPlant(FREE), np.zeros(32)
    data.qpos[3], step_s, context = 1.0, model.opt.timestep, plant.CreateDefaultContext()
    a, b = linear_model(FREE)
    gain = np.asarray(control.lqr(a[1:, 1:], b[1:], np.diag([0.0, 3.0, 1.0, 0.1, 0.01]), 10.0 * np.eye(2))[0])
    measured, modelled = [], []
    for step in range(round(seconds / step_s)):
        t = step * step_s
        forward = speed * np.sin(2 * np.pi * speed_hz * t)
        turned = (turn + turning * np.sin(2 * np.pi * turning_hz * t)) * min(t, 1.0)
        _state(data, z)
        phi, tilt, s_rate, yaw_rate, tilt_rate = z[2:7]
        data.ctrl[:] = -gain @ [0.0, tilt, s_rate - forward, yaw_rate - turned, tilt_rate]
        modelled.append(forces_of(plant, z[3:7], data.ctrl, context))
        mujoco.mj_step(model, data)
        force, (c, s) = floor_forces(mujoco, model, data), (np.cos(phi), np.sin(phi))
        measured.append([*(force @ [c, s, 0.0]), (force @ [-s, c, 0.0]).sum(), *force[:, 2]])
    measured, modelled = np.array(measured)[settling:], np.array(modelled)[settling:]

    def rms(values):
        return float(np.sqrt((values**2).mean()))

    along, error = rms(measured[:, :SIDEWAYS]), measured - modelled
    return {
        "forward": rms(error[:, :SIDEWAYS]) / along,
        "sideways": rms(error[:, SIDEWAYS]) / max(along, rms(measured[:, SIDEWAYS])),
        "normal": rms(error[:, NORMAL_R:]) / rms(measured[:, NORMAL_R:]),
        "shift": rms(error[:, NORMAL_L] - error[:, NORMAL_R])
        / max(along, rms(measured[:, NORMAL_L] - measured[:, NORMAL_R])),
    }


def floor_forces(mujoco, model, data):
    """(2, 3) force of the floor on the right and the left wheel in W [N]."""
    forces, one = np.zeros((2, 3)), np.zeros(6)
    for i in range(data.ncon):
        mujoco.mj_contactForce(model, data, i, one)
        wheel = model.geom_bodyid[max(data.contact[i].geom1, data.contact[i].geom2)] - 2
        forces[wheel] += data.contact[i].frame.reshape(3, 3).T @ one[:3]
    return forces
