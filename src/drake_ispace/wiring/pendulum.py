"""Diagrams of the two-wheeled inverted pendulum: Fig. 6.6, and the loops it is compared with."""

import dataclasses

from drake_ispace.blocks.messages import TRACKING_ERROR, WAY_POINT
from drake_ispace.control.estimate.error_estimator import ErrorEstimator, HeldError
from drake_ispace.control.feedback.balance_controller import BalanceController
from drake_ispace.control.feedback.balance_gains import balance_gain
from drake_ispace.control.feedback.friction_compensator import FrictionCompensator
from drake_ispace.control.guide.tracker import Tracker, TrajectoryTracker
from drake_ispace.robots.pendulum import Pendulum
from drake_ispace.scenario import Scenario
from drake_ispace.wiring.bench import Bench, Part
from drake_ispace.wiring.body import add_body, add_estimator
from drake_ispace.wiring.room import add_room, oldest_fix_ticks

#: The wires from error and tilt to the commanded torque.
FEEDBACK = (
    ("error.error", "controller.error"),
    ("tilt_filter.tilt", "controller.tilt"),
    ("odometry.velocity", "controller.velocity"),
    ("controller.torque", "compensator.torque"),
    ("encoder.message", "compensator.encoder"),
    ("compensator.torque", "actuator.command"),
)


def pendulum_multirate(scenario: Scenario, bench: Bench) -> None:
    """Fig. 6.6: balance and tracking error at 5 ms, way point and tracker at 95 ms."""
    add_room(bench, scenario, [add_pendulum(bench, scenario)])


def pendulum_vision_feedback(scenario: Scenario, bench: Bench) -> None:
    """Balance at 5 ms from encoder and IMU, position from vision at 95 ms only."""
    add_room(bench, scenario, [add_pendulum(bench, scenario, vision_only=True)])


def pendulum_jacobian_tracking(scenario: Scenario, bench: Bench) -> None:
    """Fig. 6.2's blue line: the same loop without trajectory tracker, s_e = d."""
    tracker = dataclasses.replace(scenario.pendulum.control.tracker, mode="jacobian")
    control = dataclasses.replace(scenario.pendulum.control, tracker=tracker)
    scenario = dataclasses.replace(scenario, pendulum=dataclasses.replace(scenario.pendulum, control=control))
    add_room(bench, scenario, [add_pendulum(bench, scenario)])


def add_pendulum(bench: Bench, scenario: Scenario, vision_only: bool = False) -> Part:
    """The whole robot and its part of the room."""
    settings, control = scenario.pendulum, scenario.pendulum.control
    part, _ = add_pendulum_body(bench, scenario, control.tracker)
    oldest = oldest_fix_ticks(scenario, len(TRACKING_ERROR))
    part.add("error", HeldError() if vision_only else ErrorEstimator(oldest))
    part.add("controller", BalanceController(balance_gain(settings.plant, control)))
    part.add("compensator", FrictionCompensator(control.friction_compensation, 2))
    part.wire(("link.order", "error.error"), *FEEDBACK, ("actuator.torque", "plant.torque"))
    if not vision_only:
        part.wire(("odometry.path", "error.path"))
    part.show(error="error.error")
    return part


def add_pendulum_body(bench: Bench, scenario: Scenario, tracker: Tracker | None = None) -> tuple[Part, list[float]]:
    """Everything but the feedback law.

    Args:
        tracker: settings of the tracker whose error the link carries; without one it carries the way point.

    Returns:
        The robot's Part of the Bench, and where it starts.
    """
    order_size = len(TRACKING_ERROR if tracker else WAY_POINT)
    part, start = add_body(bench, scenario, Pendulum(), order_size)
    add_estimator(part, scenario, order_size, scenario.pendulum.control.estimator_as_printed)
    if tracker:
        part.add("tracker", TrajectoryTracker(tracker, scenario.space.localizer.latency_ticks))
        part.takes_fix.insert(0, "tracker.fix")
        part.wire(("way_point.way_point", "tracker.way_point"), ("tracker.error", "link.order"))
    else:
        part.wire(("way_point.way_point", "link.order"))
    return part, start
