"""Diagrams of chapters 3 and 4: the servo loop of Fig. 3.9 and the friction compensation of Fig. 4.1.

Both robots move along one straight line; the room watches, as everywhere, and carries the way point to the robot.
"""

from drake_ispace.control.adaptive.adaptive_compensator import AdaptiveCompensator
from drake_ispace.control.adaptive.online_identifier import OnlineIdentifier
from drake_ispace.control.adaptive.servo import ServoController
from drake_ispace.control.adaptive.straight_error import StraightError
from drake_ispace.control.feedback.balance_controller import BalanceController
from drake_ispace.control.feedback.balance_gains import balance_gain, linearised
from drake_ispace.control.feedback.friction_compensator import FrictionCompensator
from drake_ispace.plants.impulse import TorqueImpulse
from drake_ispace.robots.pendulum import AS_PRINTED
from drake_ispace.scenario import Scenario
from drake_ispace.sensing.sinusoid_noise import NoisyState
from drake_ispace.wiring.bench import Bench
from drake_ispace.wiring.pendulum import FEEDBACK, add_pendulum_body
from drake_ispace.wiring.room import add_room


def pendulum_servo(scenario: Scenario, bench: Bench) -> None:
    """Fig. 3.9: servo control of position with noise on position and tilt, the experiment of section 3.4."""
    settings = scenario.pendulum
    part, start = add_pendulum_body(bench, scenario)
    sign = 1.0 if settings.model == AS_PRINTED else -1.0
    part.add("state", NoisyState(settings.sensor_noise, start, scenario.seed, f"{part.name}.sensor_noise"))
    part.add("controller", ServoController(settings.servo, start, sign))
    part.wire(
        ("plant.pose", "state.pose"),
        ("plant.balance", "state.balance"),
        ("state.message", "controller.state"),
        ("link.order", "controller.way_point"),
        ("controller.torque", "actuator.command"),
        ("actuator.torque", "plant.torque"),
    )
    part.show(state="state.message")
    add_room(bench, scenario, [part])


def pendulum_friction_compensation(scenario: Scenario, bench: Bench) -> None:
    """Fig. 4.1: state feedback with friction compensation, an impulse on both wheels, an identifier listening."""
    settings, control = scenario.pendulum, scenario.pendulum.control
    part, start = add_pendulum_body(bench, scenario)
    gain = balance_gain(settings.plant, control)
    part.add("error", StraightError(start))
    part.add("controller", BalanceController(gain))
    if settings.adaptation.enabled:
        a, b = linearised(settings.plant)
        band = control.friction_compensation
        part.add("compensator", AdaptiveCompensator(
            settings.adaptation, a, b, gain, band.dead_band_rad_s, band.speed_scale_rad_s
        ))
        part.wire(
            ("error.error", "compensator.error"),
            ("tilt_filter.tilt", "compensator.tilt"),
            ("odometry.velocity", "compensator.velocity"),
        )
        part.show(coefficients="compensator.coefficients")
    else:
        part.add("compensator", FrictionCompensator(control.friction_compensation, 2))
    part.add("impulse", TorqueImpulse(settings.impulse, 2))
    part.add("identifier", OnlineIdentifier(settings.identifier, settings.encoder.filter_time_constant_s))
    part.wire(
        ("odometry.path", "error.path"),
        ("link.order", "error.way_point"),
        *FEEDBACK,
        ("actuator.torque", "impulse.torque"),
        ("impulse.torque", "plant.torque"),
        ("encoder.message", "identifier.encoder"),
        ("imu.message", "identifier.imu"),
        ("tilt_filter.tilt", "identifier.tilt"),
        ("actuator.held_command", "identifier.torque"),
    )
    part.show(error="error.error", parameters="identifier.parameters", friction="identifier.friction")
    add_room(bench, scenario, [part])
