"""Diagrams of robots that take a body-velocity command, with any wheels."""

from drake_ispace.blocks.errors import InputError
from drake_ispace.blocks.messages import WAY_POINT
from drake_ispace.control.feedback.velocity_command import VelocityCommand
from drake_ispace.robots.rover import Rover
from drake_ispace.scenario import Scenario
from drake_ispace.wiring.bench import Bench, Part
from drake_ispace.wiring.body import add_body, add_estimator
from drake_ispace.wiring.room import add_room


def velocity_base(scenario: Scenario, bench: Bench) -> None:
    """Any wheels, commanded by body velocity: pose estimated every 5 ms, corrected by the room every 95 ms."""
    part = _add_rover(bench, scenario)
    part.wire(("estimator.pose", "command.estimate"))
    add_room(bench, scenario, [part])


def odometry_replay(scenario: Scenario, bench: Bench) -> None:
    """Wheel angles to a pose: any wheels, driven along the path by odometry alone while the room looks on."""
    part = _add_rover(bench, scenario)
    part.wire(("odometry.pose", "command.estimate"))
    add_room(bench, scenario, [part], without=("velocity",))


def _add_rover(bench, scenario) -> Part:
    """Everything but the pose that the command corrects.

    Raises:
        InputError: a path that leaves the space, or a fixed heading for wheels that hold sideways.
    """
    settings = scenario.rover
    holds_sideways = settings.plant.nominal_geometry.holds_sideways
    if holds_sideways and settings.trajectory.heading == "fixed":
        raise InputError(
            f"{Rover.name}.trajectory.heading: expected tangent, the wheels of a {settings.plant.wheels} robot hold "
            "sideways"
        )
    part, _ = add_body(bench, scenario, Rover(), len(WAY_POINT))
    add_estimator(part, scenario, len(WAY_POINT))
    part.add("command", VelocityCommand(settings.control, holds_sideways))
    part.wire(
        ("way_point.way_point", "link.order"),
        ("link.order", "command.way_point"),
        ("command.velocity", "plant.velocity"),
    )
    part.show(command="command.velocity")
    return part
