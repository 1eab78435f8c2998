"""Diagrams of the omni-directional robot: Fig. 6.5, Fig. 6.9 and section 6.7.2."""

import dataclasses

import numpy as np
from pydrake.systems.framework import Diagram
from pydrake.systems.primitives import Linearize

from drake_ispace.control.conventional_merge import ConventionalMerge
from drake_ispace.control.dlqr import dlqr
from drake_ispace.control.friction_compensator import FrictionCompensator
from drake_ispace.control.jacobian_transpose import JacobianTranspose
from drake_ispace.control.odometry import OmniOdometry
from drake_ispace.control.paths import Path, Trajectory, build_path, check_inside
from drake_ispace.control.pose_controller import PoseController
from drake_ispace.control.position_estimator import PositionEstimator
from drake_ispace.control.trajectory import WAY_POINT, WayPoint
from drake_ispace.control.vision_feedback import VisionFeedback
from drake_ispace.rates import TICK_S, VISION_S
from drake_ispace.robots.actuator import TorqueActuator
from drake_ispace.robots.plants.friction import Friction
from drake_ispace.robots.plants.omni import OmniPlant, OmniPlantParameters, mass_matrix
from drake_ispace.robots.plants.slip import Slip
from drake_ispace.scenario import OmniRobot, Scenario, body_of
from drake_ispace.sensing.encoder import WheelEncoder
from drake_ispace.space.link import RoomLink
from drake_ispace.wiring.bench import Bench
from drake_ispace.wiring.effects import changed_plant, chosen_effects, needs_ground
from drake_ispace.wiring.room import add_room, oldest_fix_ticks

#: The inputs that take this robot's fix from the room.
OMNI_VIEW = {"omni_plant": ["omni_link.fix"]}


def omni_multirate(scenario: Scenario, bench: Bench | None = None) -> Diagram:
    """Fig. 6.5: pose estimated and fed back every 5 ms, corrected by the room every 95 ms."""
    bench = bench or Bench()
    add_omni_multirate(bench, scenario)
    add_room(bench, scenario, OMNI_VIEW)
    return bench.build("omni_multirate")


def omni_conventional_multirate(scenario: Scenario, bench: Bench | None = None) -> Diagram:
    """Section 6.7.2: the room's pose when it arrives, raw odometry in between."""
    bench = bench or Bench()
    add_omni_body(bench, scenario)
    bench.add("omni_estimator", ConventionalMerge())
    _close_multirate_loop(bench, scenario)
    add_room(bench, scenario, OMNI_VIEW)
    return bench.build("omni_conventional_multirate")


def omni_vision_feedback(scenario: Scenario, bench: Bench | None = None) -> Diagram:
    """Fig. 6.9: PID on the room's pose, renewed every 95 ms only; odometry runs along as an observer."""
    bench = bench or Bench()
    add_omni_body(bench, scenario)
    k_p, k_d = omni_gains(scenario.omni, VISION_S)
    control = scenario.omni.control
    bench.add("omni_controller", VisionFeedback(
        np.diag(k_p), control.k_i, np.diag(k_d), control.force_limit or [np.inf] * 3,
        np.diag(mass_matrix(scenario.omni.plant)), control.velocity_feed_forward, control.acceleration_feed_forward,
    ))
    bench.wire(
        ("omni_link.fix", "omni_controller.fix"),
        ("omni_link.order", "omni_controller.way_point"),
        ("omni_controller.force", "omni_jacobian.force"),
        ("omni_controller.pose", "omni_jacobian.estimate"),
    )
    bench.show(omni_estimate="omni_controller.pose")
    add_room(bench, scenario, OMNI_VIEW)
    return bench.build("omni_vision_feedback")


def add_omni_body(bench: Bench, scenario: Scenario) -> None:
    """Plant, actuator, encoder, odometry, way point and link: everything but the feedback law."""
    robot, seed = scenario.omni, scenario.seed
    path = build_path(robot.trajectory, "omni.trajectory")
    check_inside(path, scenario.space.width_m, scenario.space.depth_m, "omni.trajectory")
    start = robot.initial_pose or start_pose(robot.trajectory, path)
    geometry = robot.plant.geometry
    wheels = len(geometry.wheels)
    effects = chosen_effects(robot.effects)
    plant = changed_plant(robot.plant, body_of(scenario, "omni"), effects)
    bench.add("omni_plant", OmniPlant(plant, start, seed, "omni.plant", needs_ground(effects)))
    bench.add("omni_actuator", TorqueActuator(robot.actuator, wheels, seed, "omni.actuator"))
    bench.add("omni_encoder", WheelEncoder(robot.encoder, wheels))
    bench.add("omni_odometry", OmniOdometry(geometry, start))
    bench.add("omni_way_point", WayPoint(robot.trajectory, path, start[:2]))
    bench.add("omni_link", RoomLink(scenario.space.link, WAY_POINT, seed, "omni.link"))
    bench.add("omni_jacobian", JacobianTranspose(geometry))
    bench.add("omni_compensator", FrictionCompensator(robot.friction_compensation, wheels))
    bench.wire(
        ("omni_plant.wheel_angle", "omni_encoder.wheel_angle"),
        ("omni_plant.wheel_rate", "omni_encoder.wheel_rate"),
        ("omni_encoder.message", "omni_odometry.encoder"),
        ("omni_encoder.tick", "omni_link.robot_tick"),
        ("omni_way_point.way_point", "omni_link.order"),
        ("omni_jacobian.torque", "omni_compensator.torque"),
        ("omni_encoder.message", "omni_compensator.encoder"),
        ("omni_compensator.torque", "omni_actuator.command"),
        ("omni_actuator.torque", "omni_plant.torque"),
    )
    bench.show(
        omni_pose="omni_plant.pose", omni_velocity="omni_plant.velocity", omni_encoder="omni_encoder.message",
        omni_torque="omni_actuator.held_command", omni_fix="omni_link.fix", omni_odometry="omni_odometry.pose",
        omni_way_point="omni_way_point.way_point",
    )


def add_omni_multirate(bench: Bench, scenario: Scenario) -> None:
    """The whole robot with position estimator (6.6) and the feedback (6.23) on it."""
    add_omni_body(bench, scenario)
    oldest = oldest_fix_ticks(scenario, WAY_POINT)
    bench.add("omni_estimator", PositionEstimator(oldest, scenario.omni.control.estimator_as_printed))
    _close_multirate_loop(bench, scenario)


def _close_multirate_loop(bench, scenario):
    control = scenario.omni.control
    k_p, k_d = omni_gains(scenario.omni, TICK_S)
    bench.add("omni_controller", PoseController(
        k_p, k_d, np.diag(mass_matrix(scenario.omni.plant)), control.velocity_feed_forward,
        control.acceleration_feed_forward,
    ))
    bench.wire(
        ("omni_link.fix", "omni_estimator.fix"),
        ("omni_odometry.pose", "omni_estimator.odometry"),
        ("omni_estimator.pose", "omni_controller.estimate"),
        ("omni_odometry.body_velocity", "omni_controller.body_velocity"),
        ("omni_link.order", "omni_controller.way_point"),
        ("omni_controller.force", "omni_jacobian.force"),
        (f"{'omni_odometry' if control.estimator_as_printed else 'omni_estimator'}.pose", "omni_jacobian.estimate"),
    )
    bench.show(omni_estimate="omni_estimator.pose")


def omni_gains(robot: OmniRobot, period_s: float) -> tuple[np.ndarray, np.ndarray]:
    """(K_p, K_d), (3, 3) each: given, or DLQR at `period_s` from the plant's own linearisation, input F of (6.16)."""
    control = robot.control
    if control.gains == "given":
        return np.diag(control.k_p), np.diag(control.k_d)
    a, b = linear_model(robot.plant)
    gain = dlqr(a, b, control.q, control.r, period_s)
    return gain[:, :3], gain[:, 3:]


def linear_model(plant: OmniPlantParameters) -> tuple[np.ndarray, np.ndarray]:
    """(A (6, 6), B (6, 3)) of (6.15)-(6.16): x = [x, y, phi and rates], input force in W, no slip, no friction."""
    neutral = dataclasses.replace(plant, friction=Friction(), slip=Slip())
    block = OmniPlant(neutral)
    context = block.CreateDefaultContext()
    block.get_input_port().FixValue(context, np.zeros(len(plant.geometry.wheels)))
    model = Linearize(block, context, block.get_input_port().get_index(), block.GetOutputPort("pose").get_index())
    return model.A()[:6, :6], model.B()[:6] @ plant.geometry.forward.T


def start_pose(trajectory: Trajectory, path: Path) -> list[float]:
    """x, y [m], phi [rad] where the path begins; the origin for a path that is a single point."""
    if path.length_m == 0.0:
        return [0.0, 0.0, trajectory.heading_rad]
    _, x, y, along_x, along_y, _ = path.table[0]
    heading = np.arctan2(along_y, along_x) if trajectory.heading == "tangent" else trajectory.heading_rad
    return [float(x), float(y), float(heading)]
