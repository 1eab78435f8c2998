"""Diagrams of robots that take a body-velocity command, with any wheels."""

from pydrake.systems.framework import Diagram

from drake_ispace.control.base_command import BaseCommand
from drake_ispace.control.odometry import OmniOdometry
from drake_ispace.control.paths import build_path, check_inside
from drake_ispace.control.position_estimator import PositionEstimator
from drake_ispace.control.trajectory import WAY_POINT, WayPoint
from drake_ispace.errors import InputError
from drake_ispace.robots.base import VelocityBase
from drake_ispace.scenario import Scenario, body_of
from drake_ispace.sensing.encoder import WheelEncoder
from drake_ispace.space.link import RoomLink
from drake_ispace.wiring.bench import Bench
from drake_ispace.wiring.effects import changed_plant, chosen_effects
from drake_ispace.wiring.omni import start_pose
from drake_ispace.wiring.room import add_room, oldest_fix_ticks

#: The inputs that take this robot's fix from the room.
BASE_VIEW = {"base_plant": ["base_link.fix"]}


def velocity_base(scenario: Scenario) -> Diagram:
    """Any wheels, commanded by body velocity: pose estimated every 5 ms, corrected by the room every 95 ms."""
    bench = Bench()
    add_base(bench, scenario)
    bench.wire(("base_estimator.pose", "base_command.estimate"))
    add_room(bench, scenario, BASE_VIEW)
    return bench.build("velocity_base")


def odometry_replay(scenario: Scenario) -> Diagram:
    """Wheel angles to a pose: any wheels, driven along the path by odometry alone while the room looks on."""
    bench = Bench()
    add_base(bench, scenario)
    bench.wire(("base_odometry.pose", "base_command.estimate"))
    add_room(bench, scenario, BASE_VIEW, without=("velocity",))
    return bench.build("odometry_replay")


def add_base(bench: Bench, scenario: Scenario) -> None:
    """Everything but the pose that the command corrects.

    Raises:
        InputError: a path that leaves the space, or a fixed heading for wheels that hold sideways.
    """
    robot, seed = scenario.base, scenario.seed
    path = build_path(robot.trajectory, "base.trajectory")
    check_inside(path, scenario.space.width_m, scenario.space.depth_m, "base.trajectory")
    geometry = robot.plant.nominal_geometry
    holds_sideways = len(geometry.sideways) > 0
    if holds_sideways and robot.trajectory.heading == "fixed":
        raise InputError(
            f"base.trajectory.heading: expected tangent, the wheels of a {robot.plant.wheels} robot hold sideways"
        )
    start = robot.initial_pose or start_pose(robot.trajectory, path)
    wheels = len(geometry.wheels)
    plant = changed_plant(robot.plant, body_of(scenario, "base"), chosen_effects(robot.effects))
    bench.add("base_plant", VelocityBase(plant, start, "base.plant"))
    bench.add("base_encoder", WheelEncoder(robot.encoder, wheels))
    bench.add("base_odometry", OmniOdometry(geometry, start))
    bench.add("base_way_point", WayPoint(robot.trajectory, path, start[:2]))
    bench.add("base_link", RoomLink(scenario.space.link, WAY_POINT, seed, "base.link"))
    bench.add("base_estimator", PositionEstimator(oldest_fix_ticks(scenario, WAY_POINT)))
    bench.add("base_command", BaseCommand(robot.control, holds_sideways))
    bench.wire(
        ("base_plant.wheel_angle", "base_encoder.wheel_angle"),
        ("base_plant.wheel_rate", "base_encoder.wheel_rate"),
        ("base_encoder.message", "base_odometry.encoder"),
        ("base_encoder.tick", "base_link.robot_tick"),
        ("base_way_point.way_point", "base_link.order"),
        ("base_link.fix", "base_estimator.fix"),
        ("base_odometry.pose", "base_estimator.odometry"),
        ("base_link.order", "base_command.way_point"),
        ("base_command.velocity", "base_plant.velocity"),
    )
    bench.show(
        base_pose="base_plant.pose", base_velocity="base_plant.velocity", base_encoder="base_encoder.message",
        base_command="base_command.velocity", base_fix="base_link.fix", base_odometry="base_odometry.pose",
        base_estimate="base_estimator.pose", base_way_point="base_way_point.way_point",
    )
