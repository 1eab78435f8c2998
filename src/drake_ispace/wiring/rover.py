"""Diagrams of robots that take a body-velocity command, with any wheels."""

from pydrake.systems.framework import Diagram

from drake_ispace.control.odometry import OmniOdometry
from drake_ispace.control.paths import build_path, check_inside
from drake_ispace.control.position_estimator import PositionEstimator
from drake_ispace.control.trajectory import WAY_POINT, WayPoint
from drake_ispace.control.velocity_command import VelocityCommand
from drake_ispace.errors import InputError
from drake_ispace.robots.plants.rover import RoverPlant
from drake_ispace.scenario import Scenario, body_of
from drake_ispace.sensing.encoder import WheelEncoder
from drake_ispace.space.link import RoomLink
from drake_ispace.wiring.bench import Bench
from drake_ispace.wiring.effects import changed_plant, chosen_effects
from drake_ispace.wiring.omni import start_pose
from drake_ispace.wiring.room import add_room, oldest_fix_ticks

#: The inputs that take this robot's fix from the room.
ROVER_VIEW = {"rover_plant": ["rover_link.fix"]}


def velocity_base(scenario: Scenario) -> Diagram:
    """Any wheels, commanded by body velocity: pose estimated every 5 ms, corrected by the room every 95 ms."""
    bench = Bench()
    add_rover(bench, scenario)
    bench.wire(("rover_estimator.pose", "rover_command.estimate"))
    add_room(bench, scenario, ROVER_VIEW)
    return bench.build("velocity_base")


def odometry_replay(scenario: Scenario) -> Diagram:
    """Wheel angles to a pose: any wheels, driven along the path by odometry alone while the room looks on."""
    bench = Bench()
    add_rover(bench, scenario)
    bench.wire(("rover_odometry.pose", "rover_command.estimate"))
    add_room(bench, scenario, ROVER_VIEW, without=("velocity",))
    return bench.build("odometry_replay")


def add_rover(bench: Bench, scenario: Scenario) -> None:
    """Everything but the pose that the command corrects.

    Raises:
        InputError: a path that leaves the space, or a fixed heading for wheels that hold sideways.
    """
    robot, seed = scenario.rover, scenario.seed
    path = build_path(robot.trajectory, "rover.trajectory")
    check_inside(path, scenario.space.width_m, scenario.space.depth_m, "rover.trajectory")
    geometry = robot.plant.nominal_geometry
    holds_sideways = len(geometry.sideways) > 0
    if holds_sideways and robot.trajectory.heading == "fixed":
        raise InputError(
            f"rover.trajectory.heading: expected tangent, the wheels of a {robot.plant.wheels} robot hold sideways"
        )
    start = robot.initial_pose or start_pose(robot.trajectory, path)
    wheels = len(geometry.wheels)
    plant = changed_plant(robot.plant, body_of(scenario, "rover"), chosen_effects(robot.effects))
    bench.add("rover_plant", RoverPlant(plant, start, "rover.plant"))
    bench.add("rover_encoder", WheelEncoder(robot.encoder, wheels))
    bench.add("rover_odometry", OmniOdometry(geometry, start))
    bench.add("rover_way_point", WayPoint(robot.trajectory, path, start[:2]))
    bench.add("rover_link", RoomLink(scenario.space.link, WAY_POINT, seed, "rover.link"))
    bench.add("rover_estimator", PositionEstimator(oldest_fix_ticks(scenario, WAY_POINT)))
    bench.add("rover_command", VelocityCommand(robot.control, holds_sideways))
    bench.wire(
        ("rover_plant.wheel_angle", "rover_encoder.wheel_angle"),
        ("rover_plant.wheel_rate", "rover_encoder.wheel_rate"),
        ("rover_encoder.message", "rover_odometry.encoder"),
        ("rover_encoder.tick", "rover_link.robot_tick"),
        ("rover_way_point.way_point", "rover_link.order"),
        ("rover_link.fix", "rover_estimator.fix"),
        ("rover_odometry.pose", "rover_estimator.odometry"),
        ("rover_link.order", "rover_command.way_point"),
        ("rover_command.velocity", "rover_plant.velocity"),
    )
    bench.show(
        rover_pose="rover_plant.pose", rover_velocity="rover_plant.velocity", rover_encoder="rover_encoder.message",
        rover_command="rover_command.velocity", rover_fix="rover_link.fix", rover_odometry="rover_odometry.pose",
        rover_estimate="rover_estimator.pose", rover_way_point="rover_way_point.way_point",
    )
