"""Diagrams of the omni-directional robot: Fig. 6.5, Fig. 6.9 and section 6.7.2."""

import numpy as np

from drake_ispace.blocks.messages import WAY_POINT
from drake_ispace.blocks.rates import TICK_S, VISION_S
from drake_ispace.control.estimate.conventional_merge import ConventionalMerge
from drake_ispace.control.feedback.friction_compensator import FrictionCompensator
from drake_ispace.control.feedback.jacobian_transpose import JacobianTranspose
from drake_ispace.control.feedback.omni_gains import omni_gains
from drake_ispace.control.feedback.pose_controller import PoseController
from drake_ispace.control.feedback.vision_feedback import VisionFeedback
from drake_ispace.plants.omni import mass_matrix
from drake_ispace.robots.omni import Omni
from drake_ispace.scenario import Scenario
from drake_ispace.wiring.bench import Bench, Part
from drake_ispace.wiring.body import add_body, add_estimator
from drake_ispace.wiring.room import add_room


def omni_multirate(scenario: Scenario, bench: Bench) -> None:
    """Fig. 6.5: pose estimated and fed back every 5 ms, corrected by the room every 95 ms."""
    add_room(bench, scenario, [add_omni_multirate(bench, scenario)])


def omni_conventional_multirate(scenario: Scenario, bench: Bench) -> None:
    """Section 6.7.2: the room's pose when it arrives, raw odometry in between."""
    part = _add_omni(bench, scenario)
    part.add("estimator", ConventionalMerge())
    part.wire(("link.fix", "estimator.fix"), ("odometry.pose", "estimator.odometry"))
    part.show(estimate="estimator.pose")
    _close_multirate_loop(part, scenario)
    add_room(bench, scenario, [part])


def omni_vision_feedback(scenario: Scenario, bench: Bench) -> None:
    """Fig. 6.9: PID on the room's pose, renewed every 95 ms only; odometry runs along as an observer."""
    part = _add_omni(bench, scenario)
    control, plant = scenario.omni.control, scenario.omni.plant
    k_p, k_d = omni_gains(plant, control, VISION_S)
    part.add("controller", VisionFeedback(
        np.diag(k_p), control.k_i, np.diag(k_d), control.force_limit or [np.inf] * 3, np.diag(mass_matrix(plant)),
        control.velocity_feed_forward, control.acceleration_feed_forward,
    ))
    part.wire(
        ("link.fix", "controller.fix"),
        ("link.order", "controller.way_point"),
        ("controller.force", "jacobian.force"),
        ("controller.pose", "jacobian.estimate"),
    )
    part.show(estimate="controller.pose")
    add_room(bench, scenario, [part])


def add_omni_multirate(bench: Bench, scenario: Scenario) -> Part:
    """The whole robot with position estimator (6.6) and the feedback (6.23) on it."""
    part = _add_omni(bench, scenario)
    add_estimator(part, scenario, len(WAY_POINT), scenario.omni.control.estimator_as_printed)
    _close_multirate_loop(part, scenario)
    return part


def _add_omni(bench, scenario):
    """Everything but the feedback law."""
    part, _ = add_body(bench, scenario, Omni(), len(WAY_POINT))
    geometry = scenario.omni.plant.geometry
    part.add("jacobian", JacobianTranspose(geometry))
    part.add("compensator", FrictionCompensator(scenario.omni.friction_compensation, len(geometry.wheels)))
    part.wire(
        ("way_point.way_point", "link.order"),
        ("jacobian.torque", "compensator.torque"),
        ("encoder.message", "compensator.encoder"),
        ("compensator.torque", "actuator.command"),
        ("actuator.torque", "plant.torque"),
    )
    return part


def _close_multirate_loop(part, scenario):
    control, plant = scenario.omni.control, scenario.omni.plant
    k_p, k_d = omni_gains(plant, control, TICK_S)
    part.add("controller", PoseController(
        k_p, k_d, np.diag(mass_matrix(plant)), control.velocity_feed_forward, control.acceleration_feed_forward,
    ))
    part.wire(
        ("estimator.pose", "controller.estimate"),
        ("odometry.body_velocity", "controller.body_velocity"),
        ("link.order", "controller.way_point"),
        ("controller.force", "jacobian.force"),
        (f"{'odometry' if control.estimator_as_printed else 'estimator'}.pose", "jacobian.estimate"),
    )
