"""The follower holds a model on its measured motion and lets through what the model cannot predict."""

from dataclasses import replace

import numpy as np
import pytest

from drake_ispace.blocks.rates import TICK_S
from drake_ispace.explain.predict.filters import ASSUMED, filters_of
from drake_ispace.explain.predict.follower import Follower, design, discrete
from drake_ispace.robots.library import robots
from drake_ispace.scenario import load_scenario

MASS = np.array([[0.0, 1.0], [0.0, 0.0]]), np.array([[0.0], [1.0]])


def rail_filter(ticks=1):
    """Of a mass on a rail whose place is measured to a millimetre, every so many ticks."""
    a, b = MASS
    feedback = np.array([[225.0, 30.0]])
    process, sensors = np.diag([0.0, 1e-2]), np.array([1e-6])
    return design(a, b, np.array([[1.0, 0.0]]), np.zeros((1, 1)), process, sensors, feedback, [[2.0]], ticks)


def test_a_mass_moves_as_newton_says():
    a, b = discrete(*MASS)
    assert a == pytest.approx(np.array([[1.0, TICK_S], [0.0, 1.0]]))
    assert b == pytest.approx(np.array([[TICK_S**2 / 2], [TICK_S]]))


def test_the_filter_forgets_an_error_of_its_own():
    f = rail_filter()
    decay = f.a @ (np.eye(2) - f.gain @ f.c)
    assert np.abs(np.linalg.eigvals(decay)).max() < 0.99


def test_a_filter_for_rare_samples_forgets_between_them():
    f = rail_filter(8)
    decay = np.linalg.matrix_power(f.a, 8) @ (np.eye(2) - f.gain @ f.c)
    assert np.abs(np.linalg.eigvals(decay)).max() < 0.99


@pytest.mark.first_case
@pytest.mark.parametrize("ticks", [1, 8])
def test_the_model_follows_a_robot_that_stands_elsewhere(ticks):
    """It is measured every `ticks` ticks, and where it is not there is nothing to be surprised at."""
    f, place, speed, push = rail_filter(ticks), 0.0, 0.0, []
    block = Follower(f)
    context = block.CreateDefaultContext()
    block.GetInputPort("measured").FixValue(context, [0.01])
    block.GetInputPort("push").FixValue(context, [0.0])
    state = context.get_discrete_state_vector().CopyToVector()
    for k in range(400):
        state[0] = 0.01 - place if k % ticks == 0 else np.nan
        context.SetDiscreteState(state)
        state = block.EvalUniquePeriodicDiscreteUpdate(context).get_vector().CopyToVector()
        assert k % ticks == 0 or state[1] == 0.0
        acceleration = state[-1] / 2.0  # what acts is the weight times the acceleration
        place, speed = place + speed * TICK_S + acceleration * TICK_S**2 / 2, speed + acceleration * TICK_S
        push.append(state[-1])
    assert place == pytest.approx(0.01, abs=1e-4) and abs(push[-1]) < 1e-2


@pytest.mark.parametrize("robot", ["omni", "pendulum"])
def test_every_robot_has_a_stable_filter(robot):
    scenario, has = load_scenario(f"{robot}_multirate"), frozenset({"torque", "encoder", "imu"})
    filters, plant = filters_of(scenario, robots()[robot], has), getattr(scenario, robot).plant
    f = filters(plant)
    assert np.abs(np.linalg.eigvals(f.a @ (np.eye(len(f.a)) - f.gain @ f.c))).max() < 1.0
    model = slice(len(f.a) - f.slips)
    assert np.abs(np.linalg.eigvals((f.a - f.b @ f.feedback)[model, model])).max() < 1.0
    assert all(not np.array_equal(filters(plant, number).gain, f.gain) for number in range(len(ASSUMED)))


def test_wheels_that_slip_against_each_other_are_followed_and_push_nothing():
    scenario = load_scenario("omni_multirate")
    f = filters_of(scenario, robots()["omni"], frozenset({"torque", "encoder"}))(scenario.omni.plant)
    apart, x, rate = np.array([1.0, -1.0, 1.0, -1.0]), np.zeros(len(f.a)), 0.1  # rad/s
    for k in range(2000):
        innovation = rate * TICK_S * k * apart - f.c @ x
        x = f.a @ (x + f.gain @ innovation)
    assert np.abs(innovation).max() < 0.1 * rate * TICK_S * k
    assert np.abs(f.feedback @ x).max() < 1e-9


@pytest.mark.parametrize("height_m", [-0.03, 0.025, 0.1])
def test_the_filter_holds_a_pendulum_whose_weight_is_elsewhere(height_m):
    scenario, has = load_scenario("pendulum_multirate"), frozenset({"torque", "encoder", "imu"})
    robot, plant = robots()["pendulum"], scenario.pendulum.plant
    f = filters_of(scenario, robot, has)(robot.off_centre(plant, {"height_m": height_m}))
    assert np.abs(np.linalg.eigvals(f.a @ (np.eye(len(f.a)) - f.gain @ f.c))).max() < 0.998


def test_wheels_show_the_body_as_the_geometry_says():
    plant = load_scenario("pendulum_multirate").pendulum.plant
    c = robots()["pendulum"].error_system(plant).c
    radius, half = plant.wheel_radius_m, plant.half_track_m
    assert c[0, :3] == pytest.approx([1 / radius, half / radius, -1.0])
    assert c[1, :3] == pytest.approx([1 / radius, -half / radius, -1.0])


def test_an_acceleration_becomes_a_force_by_the_mass():
    plant = load_scenario("omni_multirate").omni.plant
    assert robots()["omni"].mass_matrix(plant)[0, 0] == pytest.approx(plant.mass_kg, rel=1e-3)


@pytest.mark.parametrize("height_m", [0.0, 0.1])
def test_a_push_on_the_model_shows_in_its_imu_and_so_with_the_other_sign_in_the_error(height_m):
    settings, robot = load_scenario("pendulum_multirate").pendulum, robots()["pendulum"]
    settings = replace(settings, imu=replace(settings.imu, height_m=height_m))
    plant = robot.followed_plant(settings, settings.plant)
    context, shown = plant.CreateDefaultContext(), []
    plant.GetInputPort("torque").FixValue(context, np.zeros(2))
    for u in np.vstack([np.zeros(3), np.eye(3)]):
        plant.GetInputPort("ground_force").FixValue(context, robot.mass_matrix(settings.plant) @ u)
        shown.append(plant.GetOutputPort("body_motion").Eval(context))
    system = robot.error_system(settings.plant, height_m)
    assert system.d[2:] == pytest.approx(-(np.array(shown[1:]) - shown[0]).T, abs=1e-9)
