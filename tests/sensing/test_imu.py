"""IMU: what it measures, its noise, and the torque that it sees."""

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource, VectorLogSink

from drake_ispace.blocks.rates import TICK_S
from drake_ispace.plants.actuator import Actuator, TorqueActuator
from drake_ispace.plants.pendulum import PendulumPlant, PendulumPlantParameters
from drake_ispace.plants.slip import GRAVITY, Slip
from drake_ispace.sensing.imu import Imu, InertialSensor

QUIET = {"accelerometer_noise_density": 0.0, "gyro_noise_density": 0.0}


def body_motion(plant, torque=(0.0, 0.0), state=None):
    context = plant.CreateDefaultContext()
    plant.get_input_port().FixValue(context, torque)
    if state is not None:
        context.SetContinuousState(state)
    return plant.GetOutputPort("body_motion").Eval(context).copy()


def samples(imu, ticks, seed=0, motion=(0.0, 0.0, GRAVITY, 0.0, 0.0, 0.0), where="imu"):
    """(ticks, 7) messages for a body that moves the same way all the time."""
    block = InertialSensor(imu, seed, where)
    simulator = Simulator(block)
    block.get_input_port().FixValue(simulator.get_mutable_context(), motion)
    rows = []
    for tick in range(ticks):
        simulator.AdvanceTo((tick + 0.5) * TICK_S)
        rows.append(block.get_output_port().Eval(simulator.get_context()).copy())
    return np.array(rows)


def test_at_rest_and_upright_the_specific_force_is_gravity_upward():
    assert list(body_motion(PendulumPlant(PendulumPlantParameters()))) == [0.0, 0.0, GRAVITY, 0.0, 0.0, 0.0]


def test_leaning_forward_by_10_degrees_gravity_shows_backward_along_the_body():
    # with its centre of gravity on the axle the body stays where it is
    balanced = PendulumPlantParameters(centre_of_gravity_m=1e-12)
    force = body_motion(PendulumPlant(balanced, initial_tilt_rad=np.radians(10.0)))[:3]
    assert force == pytest.approx([-1.70291, 0.0, 9.65766], abs=1e-5)


def point_in_world(q, height):
    """The IMU's place in W for q = x, y, phi, tilt: R_z(phi) R_y(tilt) [0, 0, height] above the axle."""
    x, y, phi, tilt = q
    ahead = height * np.sin(tilt)
    return np.array([x + ahead * np.cos(phi), y + ahead * np.sin(phi), height * np.cos(tilt)])


def attitude(q):
    """R_WB = R_z(phi) R_y(tilt)."""
    c, s, ct, st = np.cos(q[2]), np.sin(q[2]), np.cos(q[3]), np.sin(q[3])
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) @ np.array([[ct, 0, st], [0, 1, 0], [-st, 0, ct]])


def moved(plant, state, torque, h):
    """The state `h` seconds later, by one Runge-Kutta 4 step."""
    context = plant.CreateDefaultContext()
    plant.get_input_port().FixValue(context, torque)

    def rate(x):
        context.SetContinuousState(x)
        return plant.EvalTimeDerivatives(context).CopyToVector()

    k1 = rate(state)
    k2 = rate(state + 0.5 * h * k1)
    k3 = rate(state + 0.5 * h * k2)
    return state + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + rate(state + h * k3))


@pytest.mark.parametrize("slip", [
    Slip(), Slip(ratio=[0.1, 0.0, 0.2]), Slip(traction_gain=[0.9, 0.0, 0.9]),
    Slip(frame="world", ratio=[0.5, 0.1, 0.2]), Slip(frame="additive", ratio=[0.5, 0.1, 0.2]),
    Slip(ratio=[0.1, 0.0, 0.2], cornering_s=0.2),
], ids=["grip", "body", "traction", "world", "additive", "cornering"])
@pytest.mark.parametrize("height", [0.0, 0.15])
def test_motion_equals_finite_differences_in_the_world_while_the_robot_turns_and_leans(slip, height):
    plant = PendulumPlant(PendulumPlantParameters(slip=slip), imu_height_m=height)
    torque = [0.08, -0.03]
    # x, y, phi, tilt, s', phi', tilt', traction slip (2), wheels (2)
    state = np.array([0.2, -0.1, 0.7, 0.3, 0.6, 2.0, -1.5, 0.0, 0.0, 0.3, 0.4])
    h = 1e-4
    before, now, after = (x[:4] for x in (moved(plant, state, torque, -h), state, moved(plant, state, torque, h)))
    p0, p1, p2 = (point_in_world(q, height) for q in (before, now, after))
    acceleration = (p2 - 2.0 * p1 + p0) / h**2
    force_b = attitude(now).T @ (acceleration + [0.0, 0.0, GRAVITY])
    spin = attitude(now).T @ (attitude(after) - attitude(before)) / (2.0 * h)
    rate_b = [spin[2, 1], spin[0, 2], spin[1, 0]]
    motion = body_motion(plant, torque, state)
    assert np.abs(motion[[1, 3, 5]]).min() > 0.1  # all axes at work
    assert motion == pytest.approx([*force_b, *rate_b], abs=5e-5)


def test_noise_of_a_sample_is_the_density_over_the_root_of_the_period():
    rows = samples(Imu(), 3000)[:, 1:] - [0.0, 0.0, GRAVITY, 0.0, 0.0, 0.0]
    # 3e-3 / sqrt(5 ms) = 0.0424 m/s^2, 1.5e-4 / sqrt(5 ms) = 0.00212 rad/s
    assert rows.std(axis=0) == pytest.approx([0.04243] * 3 + [0.002121] * 3, rel=0.065)
    assert (np.abs(rows.mean(axis=0)) < 5.0 * rows.std(axis=0) / np.sqrt(3000)).all()
    assert np.abs(np.corrcoef(rows.T) - np.eye(6)).max() < 5.0 / np.sqrt(3000)


def test_bias_adds():
    imu = Imu(**QUIET, accelerometer_bias_m_s2=[0.1, 0.2, 0.3], gyro_bias_rad_s=[0.01, 0.02, 0.03])
    assert samples(imu, 1)[0] == pytest.approx([0.0, 0.1, 0.2, GRAVITY + 0.3, 0.01, 0.02, 0.03])


def test_the_same_seed_gives_the_same_numbers():
    assert np.array_equal(samples(Imu(), 20, seed=3), samples(Imu(), 20, seed=3))
    assert not np.array_equal(samples(Imu(), 20, seed=3), samples(Imu(), 20, seed=4))
    assert not np.array_equal(samples(Imu(), 20, seed=3), samples(Imu(), 20, seed=3, where="pendulum.imu"))


def test_the_torque_commanded_at_a_tick_shows_in_the_sample_of_the_next():
    builder = DiagramBuilder()
    source = builder.AddSystem(ConstantVectorSource([0.05, 0.05]))
    actuator = builder.AddSystem(TorqueActuator(Actuator(), 2))
    plant = builder.AddSystem(PendulumPlant(PendulumPlantParameters()))
    imu = builder.AddSystem(InertialSensor(Imu(**QUIET)))
    builder.Connect(source.get_output_port(), actuator.get_input_port())
    builder.Connect(actuator.GetOutputPort("torque"), plant.get_input_port())
    builder.Connect(plant.GetOutputPort("body_motion"), imu.get_input_port())
    log = builder.AddSystem(VectorLogSink(7, TICK_S))
    builder.Connect(imu.get_output_port(), log.get_input_port())
    simulator = Simulator(builder.Build())
    simulator.AdvanceTo(3 * TICK_S)
    none, first, second, _ = log.FindLog(simulator.get_context()).data().T
    assert none[0] == -1.0
    assert list(first) == [0.0, 0.0, 0.0, GRAVITY, 0.0, 0.0, 0.0]
    assert second[0] == 1.0
    # 49.3 m/s^2 per N m on either wheel is 2.5 m/s^2 at first; the body has fallen back for 5 ms since
    assert 1.5 < second[1] < 2.5
