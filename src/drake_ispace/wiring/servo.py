"""Diagrams of chapters 3 and 4: the servo loop of Fig. 3.9 and the friction compensation of Fig. 4.1.

Both robots move along one straight line; the room watches, as everywhere, and carries the way point to the robot.
"""

from pydrake.systems.framework import Diagram

from drake_ispace.control.adaptive_compensator import AdaptiveCompensator
from drake_ispace.control.balance_controller import BalanceController
from drake_ispace.control.friction_compensator import FrictionCompensator
from drake_ispace.control.online_identifier import OnlineIdentifier
from drake_ispace.control.servo import ServoController
from drake_ispace.control.straight_error import StraightError
from drake_ispace.robots.impulse import TorqueImpulse
from drake_ispace.scenario import Scenario
from drake_ispace.sensing.sinusoid_noise import NoisyState
from drake_ispace.wiring.bench import Bench
from drake_ispace.wiring.pendulum import FEEDBACK, add_pendulum_body, linear_model, pendulum_gain
from drake_ispace.wiring.room import add_room

_VIEW = {"pendulum_plant": ["pendulum_link.fix"]}


def pendulum_servo(scenario: Scenario) -> Diagram:
    """Fig. 3.9: servo control of position with noise on position and tilt, the experiment of section 3.4."""
    robot = scenario.pendulum
    bench = Bench()
    start = add_pendulum_body(bench, scenario)
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
    start = add_pendulum_body(bench, scenario)
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
        *FEEDBACK,
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
