"""Diagrams of chapters 3 and 4: the servo loop of Fig. 3.9 and the friction compensation of Fig. 4.1.

Both robots move along one straight line; the room watches, as everywhere, and carries the way point to the robot.
"""

from pydrake.systems.framework import Diagram

from drake_ispace.control.adaptive_compensator import AdaptiveCompensator
from drake_ispace.control.balance_controller import BalanceController
from drake_ispace.control.friction_compensator import FrictionCompensator
from drake_ispace.control.odometry import PendulumOdometry
from drake_ispace.control.online_identifier import OnlineIdentifier
from drake_ispace.control.paths import build_path, check_inside
from drake_ispace.control.position_estimator import PositionEstimator
from drake_ispace.control.servo import ServoController
from drake_ispace.control.straight_error import StraightError
from drake_ispace.control.trajectory import WAY_POINT, WayPoint
from drake_ispace.robots.actuator import TorqueActuator
from drake_ispace.robots.impulse import TorqueImpulse
from drake_ispace.robots.pendulum import MOTIONS
from drake_ispace.scenario import Scenario
from drake_ispace.sensing.encoder import WheelEncoder
from drake_ispace.sensing.imu import InertialSensor
from drake_ispace.sensing.sinusoid_noise import NoisyState
from drake_ispace.sensing.tilt_filter import TiltKalmanFilter
from drake_ispace.space.link import RoomLink
from drake_ispace.wiring.bench import Bench
from drake_ispace.wiring.omni import start_pose
from drake_ispace.wiring.pendulum import linear_model, pendulum_gain, pendulum_plant
from drake_ispace.wiring.room import add_room, oldest_fix_ticks

_VIEW = {"pendulum_plant": ["pendulum_link.fix"]}


def pendulum_servo(scenario: Scenario) -> Diagram:
    """Fig. 3.9: servo control of position with noise on position and tilt, the experiment of section 3.4."""
    robot = scenario.pendulum
    bench = Bench()
    start = add_straight_robot(bench, scenario)
    printed = robot.model == "linear_as_printed"
    bench.add("pendulum_state", NoisyState(robot.sensor_noise, start, scenario.seed, "pendulum.sensor_noise"))
    bench.add("pendulum_controller", ServoController(robot.servo, start, 1.0 if printed else -1.0))
    bench.wire(
        ("pendulum_plant.pose", "pendulum_state.pose"),
        ("pendulum_plant.balance", "pendulum_state.balance"),
        ("pendulum_state.message", "pendulum_controller.state"),
        ("pendulum_link.order", "pendulum_controller.way_point"),
        ("pendulum_controller.torque", "pendulum_actuator.command"),
        ("pendulum_actuator.torque", "pendulum_plant.torque"),
    )
    bench.show(pendulum_state="pendulum_state.message")
    add_room(bench, scenario, _VIEW)
    return bench.build("pendulum_servo")


def pendulum_friction_compensation(scenario: Scenario) -> Diagram:
    """Fig. 4.1: state feedback with friction compensation, an impulse on both wheels, an identifier listening."""
    robot, control = scenario.pendulum, scenario.pendulum.control
    bench = Bench()
    start = add_straight_robot(bench, scenario)
    gain = pendulum_gain(robot)
    bench.add("pendulum_error", StraightError(start))
    bench.add("pendulum_controller", BalanceController(gain))
    if robot.adaptation.enabled:
        a, b = linear_model(robot.plant)
        band = control.friction_compensation
        bench.add("pendulum_compensator", AdaptiveCompensator(
            robot.adaptation, a, b, gain, band.dead_band_rad_s, band.speed_scale_rad_s
        ))
        bench.wire(
            ("pendulum_error.error", "pendulum_compensator.error"),
            ("pendulum_tilt_filter.tilt", "pendulum_compensator.tilt"),
            ("pendulum_odometry.velocity", "pendulum_compensator.velocity"),
        )
        bench.show(pendulum_coefficients="pendulum_compensator.coefficients")
    else:
        bench.add("pendulum_compensator", FrictionCompensator(control.friction_compensation, 2))
    bench.add("pendulum_impulse", TorqueImpulse(robot.impulse, 2))
    bench.add("pendulum_identifier", OnlineIdentifier(robot.identifier, robot.encoder.filter_time_constant_s))
    bench.wire(
        ("pendulum_odometry.path", "pendulum_error.path"),
        ("pendulum_link.order", "pendulum_error.way_point"),
        ("pendulum_error.error", "pendulum_controller.error"),
        ("pendulum_tilt_filter.tilt", "pendulum_controller.tilt"),
        ("pendulum_odometry.velocity", "pendulum_controller.velocity"),
        ("pendulum_controller.torque", "pendulum_compensator.torque"),
        ("pendulum_encoder.message", "pendulum_compensator.encoder"),
        ("pendulum_compensator.torque", "pendulum_actuator.command"),
        ("pendulum_actuator.torque", "pendulum_impulse.torque"),
        ("pendulum_impulse.torque", "pendulum_plant.torque"),
        ("pendulum_encoder.message", "pendulum_identifier.encoder"),
        ("pendulum_imu.message", "pendulum_identifier.imu"),
        ("pendulum_tilt_filter.tilt", "pendulum_identifier.tilt"),
        ("pendulum_actuator.held_command", "pendulum_identifier.torque"),
    )
    bench.show(
        pendulum_error="pendulum_error.error", pendulum_parameters="pendulum_identifier.parameters",
        pendulum_friction="pendulum_identifier.friction",
    )
    add_room(bench, scenario, _VIEW)
    return bench.build("pendulum_friction_compensation")


def add_straight_robot(bench: Bench, scenario: Scenario) -> list[float]:
    """Plant, actuator, sensors, odometry, estimate and way point of a robot on a straight line; where it starts."""
    robot, seed = scenario.pendulum, scenario.seed
    path = build_path(robot.trajectory, "pendulum.trajectory")
    check_inside(path, scenario.space.width_m, scenario.space.depth_m, "pendulum.trajectory")
    start = robot.initial_pose or start_pose(robot.trajectory, path)
    body_share = float(MOTIONS.index(robot.plant.motion)) if robot.model == "nonlinear" else 1.0
    radius_m, half_track_m = robot.plant.wheel_radius_m, robot.plant.half_track_m

    bench.add("pendulum_plant", pendulum_plant(scenario, start))
    bench.add("pendulum_actuator", TorqueActuator(robot.actuator, 2, seed, "pendulum.actuator"))
    bench.add("pendulum_encoder", WheelEncoder(robot.encoder, 2))
    bench.add("pendulum_imu", InertialSensor(robot.imu, seed, "pendulum.imu"))
    bench.add("pendulum_tilt_filter", TiltKalmanFilter(robot.tilt_filter, robot.initial_tilt_rad))
    bench.add("pendulum_odometry", PendulumOdometry(radius_m, half_track_m, start, body_share))
    bench.add("pendulum_estimator", PositionEstimator(oldest_fix_ticks(scenario, WAY_POINT)))
    bench.add("pendulum_way_point", WayPoint(robot.trajectory, path, start[:2]))
    bench.add("pendulum_link", RoomLink(scenario.space.link, WAY_POINT, seed, "pendulum.link"))
    bench.wire(
        ("pendulum_plant.wheel_angle", "pendulum_encoder.wheel_angle"),
        ("pendulum_plant.wheel_rate", "pendulum_encoder.wheel_rate"),
        ("pendulum_plant.body_motion", "pendulum_imu.body_motion"),
        ("pendulum_imu.message", "pendulum_tilt_filter.imu"),
        ("pendulum_encoder.message", "pendulum_odometry.encoder"),
        ("pendulum_tilt_filter.tilt", "pendulum_odometry.tilt"),
        ("pendulum_way_point.way_point", "pendulum_link.order"),
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
