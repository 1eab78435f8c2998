"""Diagrams of the two-wheeled inverted pendulum: Fig. 6.6, and the loops it is compared with."""

import dataclasses

import numpy as np
from pydrake.systems.framework import Diagram, LeafSystem
from pydrake.systems.primitives import Linearize

from drake_ispace.control.balance_controller import BalanceController, from_printed
from drake_ispace.control.dlqr import dlqr
from drake_ispace.control.error_estimator import ErrorEstimator, HeldError
from drake_ispace.control.friction_compensator import FrictionCompensator
from drake_ispace.control.odometry import PendulumOdometry
from drake_ispace.control.paths import build_path, check_inside
from drake_ispace.control.position_estimator import PositionEstimator
from drake_ispace.control.tracker import TRACKING_ERROR, Tracker, TrajectoryTracker
from drake_ispace.control.trajectory import WAY_POINT, WayPoint
from drake_ispace.rates import TICK_S
from drake_ispace.robots.actuator import TorqueActuator
from drake_ispace.robots.plants.friction import Friction
from drake_ispace.robots.plants.linear_pendulum import LinearPendulumPlant
from drake_ispace.robots.plants.pendulum import (
    MOTIONS,
    S_RATE,
    TILT,
    TILT_RATE,
    YAW_RATE,
    PendulumPlant,
    PendulumPlantParameters,
)
from drake_ispace.robots.plants.slip import Slip
from drake_ispace.scenario import PendulumRobot, Scenario, body_of
from drake_ispace.sensing.encoder import WheelEncoder
from drake_ispace.sensing.imu import InertialSensor
from drake_ispace.sensing.tilt_filter import TiltKalmanFilter
from drake_ispace.space.link import RoomLink
from drake_ispace.wiring.bench import Bench
from drake_ispace.wiring.effects import changed_plant, chosen_effects, needs_ground
from drake_ispace.wiring.omni import start_pose
from drake_ispace.wiring.room import add_room, oldest_fix_ticks

#: The inputs that take this robot's fix from the room.
PENDULUM_VIEW = {"pendulum_plant": ["pendulum_tracker.fix", "pendulum_link.fix"]}
#: The wires from error and tilt to the commanded torque.
FEEDBACK = (
    ("pendulum_error.error", "pendulum_controller.error"),
    ("pendulum_tilt_filter.tilt", "pendulum_controller.tilt"),
    ("pendulum_odometry.velocity", "pendulum_controller.velocity"),
    ("pendulum_controller.torque", "pendulum_compensator.torque"),
    ("pendulum_encoder.message", "pendulum_compensator.encoder"),
    ("pendulum_compensator.torque", "pendulum_actuator.command"),
)


def pendulum_multirate(scenario: Scenario, bench: Bench | None = None) -> Diagram:
    """Fig. 6.6: balance and tracking error at 5 ms, way point and tracker at 95 ms."""
    bench = bench or Bench()
    add_pendulum(bench, scenario)
    add_room(bench, scenario, PENDULUM_VIEW)
    return bench.build("pendulum_multirate")


def pendulum_vision_feedback(scenario: Scenario, bench: Bench | None = None) -> Diagram:
    """Balance at 5 ms from encoder and IMU, position from vision at 95 ms only."""
    bench = bench or Bench()
    add_pendulum(bench, scenario, vision_only=True)
    add_room(bench, scenario, PENDULUM_VIEW)
    return bench.build("pendulum_vision_feedback")


def pendulum_jacobian_tracking(scenario: Scenario, bench: Bench | None = None) -> Diagram:
    """Fig. 6.2's blue line: the same loop without trajectory tracker, s_e = d."""
    scenario = dataclasses.replace(scenario)
    tracker = dataclasses.replace(scenario.pendulum.control.tracker, mode="jacobian")
    control = dataclasses.replace(scenario.pendulum.control, tracker=tracker)
    scenario.pendulum = dataclasses.replace(scenario.pendulum, control=control)
    bench = bench or Bench()
    add_pendulum(bench, scenario)
    add_room(bench, scenario, PENDULUM_VIEW)
    return bench.build("pendulum_jacobian_tracking")


def add_pendulum(bench: Bench, scenario: Scenario, vision_only: bool = False) -> None:
    """The whole robot and its part of the room."""
    robot, control = scenario.pendulum, scenario.pendulum.control
    add_pendulum_body(bench, scenario, control.tracker)
    oldest = oldest_fix_ticks(scenario, TRACKING_ERROR)
    bench.add("pendulum_error", HeldError() if vision_only else ErrorEstimator(oldest))
    bench.add("pendulum_controller", BalanceController(pendulum_gain(robot)))
    bench.add("pendulum_compensator", FrictionCompensator(control.friction_compensation, 2))
    bench.wire(
        ("pendulum_link.order", "pendulum_error.error"),
        *FEEDBACK,
        ("pendulum_actuator.torque", "pendulum_plant.torque"),
    )
    if not vision_only:
        bench.wire(("pendulum_odometry.path", "pendulum_error.path"))
    bench.show(pendulum_error="pendulum_error.error")


def add_pendulum_body(bench: Bench, scenario: Scenario, tracker: Tracker | None = None) -> list[float]:
    """Plant, actuator, sensors, odometry, estimate, way point and link: everything but the feedback law.

    Args:
        tracker: settings of the tracker whose error the link carries; without one it carries the way point.

    Returns:
        Where the robot starts.
    """
    robot, seed = scenario.pendulum, scenario.seed
    # the linear plant's wheels turn with the body
    body_share = float(MOTIONS.index(robot.plant.motion)) if robot.model == "nonlinear" else 1.0
    path = build_path(robot.trajectory, "pendulum.trajectory")
    check_inside(path, scenario.space.width_m, scenario.space.depth_m, "pendulum.trajectory")
    start = robot.initial_pose or start_pose(robot.trajectory, path)
    radius_m, half_track_m = robot.plant.wheel_radius_m, robot.plant.half_track_m
    order_size = TRACKING_ERROR if tracker else WAY_POINT
    oldest = oldest_fix_ticks(scenario, order_size)

    bench.add("pendulum_plant", pendulum_plant(scenario, start))
    bench.add("pendulum_actuator", TorqueActuator(robot.actuator, 2, seed, "pendulum.actuator"))
    bench.add("pendulum_encoder", WheelEncoder(robot.encoder, 2))
    bench.add("pendulum_imu", InertialSensor(robot.imu, seed, "pendulum.imu"))
    bench.add("pendulum_tilt_filter", TiltKalmanFilter(robot.tilt_filter, robot.initial_tilt_rad))
    bench.add("pendulum_odometry", PendulumOdometry(radius_m, half_track_m, start, body_share))
    bench.add("pendulum_estimator", PositionEstimator(oldest, robot.control.estimator_as_printed))
    bench.add("pendulum_way_point", WayPoint(robot.trajectory, path, start[:2]))
    order = "pendulum_way_point.way_point"
    if tracker:
        bench.add("pendulum_tracker", TrajectoryTracker(tracker))
        bench.wire((order, "pendulum_tracker.way_point"))
        order = "pendulum_tracker.error"
    bench.add("pendulum_link", RoomLink(scenario.space.link, order_size, seed, "pendulum.link"))
    bench.wire(
        ("pendulum_plant.wheel_angle", "pendulum_encoder.wheel_angle"),
        ("pendulum_plant.wheel_rate", "pendulum_encoder.wheel_rate"),
        ("pendulum_plant.body_motion", "pendulum_imu.body_motion"),
        ("pendulum_imu.message", "pendulum_tilt_filter.imu"),
        ("pendulum_encoder.message", "pendulum_odometry.encoder"),
        ("pendulum_tilt_filter.tilt", "pendulum_odometry.tilt"),
        (order, "pendulum_link.order"),
        ("pendulum_encoder.tick", "pendulum_link.robot_tick"),
        ("pendulum_link.fix", "pendulum_estimator.fix"),
        ("pendulum_odometry.pose", "pendulum_estimator.odometry"),
    )
    bench.show(
        pendulum_pose="pendulum_plant.pose", pendulum_balance="pendulum_plant.balance",
        pendulum_encoder="pendulum_encoder.message", pendulum_imu="pendulum_imu.message",
        pendulum_torque="pendulum_actuator.held_command", pendulum_fix="pendulum_link.fix",
        pendulum_odometry="pendulum_odometry.pose", pendulum_estimate="pendulum_estimator.pose",
        pendulum_way_point="pendulum_way_point.way_point", pendulum_tilt="pendulum_tilt_filter.tilt",
    )
    return start


def pendulum_plant(scenario: Scenario, start) -> LeafSystem:
    """The plant that `model` names, at the pose `start`, with the scenario's effects on its parameters."""
    robot = scenario.pendulum
    if robot.model == "linear_as_printed":
        return LinearPendulumPlant(robot.plant, start, robot.initial_tilt_rad, robot.imu.height_m)
    effects = chosen_effects(robot.effects)
    plant = changed_plant(robot.plant, body_of(scenario, "pendulum"), effects)
    return PendulumPlant(
        plant, start, robot.initial_tilt_rad, robot.imu.height_m, scenario.seed, "pendulum.plant", needs_ground(effects)
    )


def pendulum_gain(robot: PendulumRobot) -> np.ndarray:
    """K (2, 6) of u = -K x: DLQR at 5 ms from the plant's own linearisation, or the given one, (6.42)-(6.43)."""
    control = robot.control
    if control.gains == "given":
        mirror_k, mirror_f1 = np.array([1.0, -1.0]), np.array([1.0, 1.0, -1.0, 1.0])
        k, f1 = np.array(control.k_right), np.array(control.f1_right)
        return from_printed(np.vstack([k, k * mirror_k]), np.vstack([f1, f1 * mirror_f1]))
    a, b = linear_model(robot.plant)
    return dlqr(a, b, control.q, control.r, TICK_S)


def linear_model(plant: PendulumPlantParameters) -> tuple[np.ndarray, np.ndarray]:
    """(A (6, 6), B (6, 2)) of (2.54)-(2.57), linearised by Drake from the plant block, slip and friction left out."""
    neutral = dataclasses.replace(plant, friction=Friction(), slip=Slip())
    block = PendulumPlant(neutral)
    context = block.CreateDefaultContext()
    block.get_input_port().FixValue(context, np.zeros(2))
    model = Linearize(block, context, block.get_input_port().get_index(), block.GetOutputPort("balance").get_index())
    rates = [S_RATE, YAW_RATE, TILT_RATE]
    a, b = np.zeros((6, 6)), np.zeros((6, 2))
    a[:3, 3:] = np.eye(3)
    a[3:, 2] = model.A()[rates, TILT]
    a[3:, 3:] = model.A()[np.ix_(rates, rates)]
    b[3:] = model.B()[rates]
    return a, b
