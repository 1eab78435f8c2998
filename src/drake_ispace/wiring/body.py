"""The parts that every robot of a Diagram has: plant, sensors, odometry, way point and radio link."""

from typing import TYPE_CHECKING

from drake_ispace.control.estimate.position_estimator import PositionEstimator
from drake_ispace.control.guide.paths import build_path, check_inside, start_pose
from drake_ispace.control.guide.way_point import WayPoint
from drake_ispace.effects.effect import body_of
from drake_ispace.plants.actuator import TorqueActuator
from drake_ispace.robots.robot import TORQUE, Robot
from drake_ispace.room.link import RoomLink
from drake_ispace.sensing.encoder import WheelEncoder
from drake_ispace.sensing.imu import InertialSensor
from drake_ispace.sensing.tilt_filter import TiltKalmanFilter
from drake_ispace.wiring.bench import Bench, Part
from drake_ispace.wiring.effects import changed_plant, chosen_effects, needs_ground
from drake_ispace.wiring.room import oldest_fix_ticks

if TYPE_CHECKING:
    from drake_ispace.scenario import Scenario


def add_body(bench: Bench, scenario: "Scenario", robot: Robot, order_size: int) -> tuple[Part, list[float]]:
    """Add plant, actuator, sensors, odometry, way point and link of a robot.

    What is left to wire: the actuator's `command` (the plant's `velocity` where velocity is commanded), from the
    actuator's `torque` to the plant's, and the link's `order`.

    Args:
        order_size: of the message that the link carries besides the fix.

    Returns:
        The robot's Part of the Bench, and where it starts (x, y [m], phi [rad]).

    Raises:
        InputError: a path that leaves the space, or values of the plant that do not go together.
    """
    settings, seed, where = getattr(scenario, robot.name), scenario.seed, f"{robot.name}.trajectory"
    path = build_path(settings.trajectory, where)
    check_inside(path, scenario.space.width_m, scenario.space.depth_m, where)
    start = settings.initial_pose or start_pose(settings.trajectory, path)
    effects, body = chosen_effects(settings.effects), body_of(scenario, robot)
    part = Part(bench, robot.name, takes_fix=["link.fix"])
    plant = changed_plant(settings.plant, body, effects)
    part.add("plant", robot.plant_block(settings, plant, start, seed, needs_ground(effects)))
    if robot.driven == TORQUE:
        part.add("actuator", TorqueActuator(settings.actuator, body.wheels, seed, f"{robot.name}.actuator"))
        part.show(torque="actuator.held_command")
    part.add("encoder", WheelEncoder(settings.encoder, body.wheels))
    if robot.has_imu:
        part.add("imu", InertialSensor(settings.imu, seed, f"{robot.name}.imu"))
        part.add("tilt_filter", TiltKalmanFilter(settings.tilt_filter, settings.initial_tilt_rad))
        part.wire(
            ("plant.body_motion", "imu.body_motion"), ("imu.message", "tilt_filter.imu"),
            ("tilt_filter.tilt", "odometry.tilt"),
        )
        part.show(imu="imu.message", tilt="tilt_filter.tilt")
    part.add("odometry", robot.odometry(settings, start))
    part.add("way_point", WayPoint(settings.trajectory, path, start[:2], scenario.space.localizer.latency_ticks))
    part.add("link", RoomLink(scenario.space.link, order_size, seed, f"{robot.name}.link"))
    part.wire(
        ("plant.wheel_angle", "encoder.wheel_angle"),
        ("plant.wheel_rate", "encoder.wheel_rate"),
        ("encoder.message", "odometry.encoder"),
        ("encoder.tick", "link.robot_tick"),
    )
    part.show(
        pose="plant.pose", encoder="encoder.message", fix="link.fix", odometry="odometry.pose",
        way_point="way_point.way_point", **{robot.truth.signal: f"plant.{robot.truth.signal}"},
    )
    return part, start


def add_estimator(part: Part, scenario: "Scenario", order_size: int, as_printed: bool = False) -> None:
    """Add the position estimator (6.6) between odometry, link and whoever takes its `pose`."""
    part.add("estimator", PositionEstimator(oldest_fix_ticks(scenario, order_size), as_printed))
    part.wire(("link.fix", "estimator.fix"), ("odometry.pose", "estimator.odometry"))
    part.show(estimate="estimator.pose")
