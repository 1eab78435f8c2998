"""The room: one camera for all robots, and the wires to each robot's link."""

from collections.abc import Collection, Sequence
from typing import TYPE_CHECKING

from pydrake.systems.primitives import Demultiplexer, Multiplexer

from drake_ispace.blocks.messages import FIX
from drake_ispace.effects.effect import body_of
from drake_ispace.effects.places.link import CLOCK_TICKS
from drake_ispace.robots.library import robots
from drake_ispace.room.link import delay_ticks
from drake_ispace.room.localizer import KinectLocalizer
from drake_ispace.wiring.bench import Bench, Part
from drake_ispace.wiring.effects import splice_chosen

if TYPE_CHECKING:
    from drake_ispace.scenario import Scenario


def add_room(bench: Bench, scenario: "Scenario", parts: Sequence[Part], without: Collection[str] = ()) -> None:
    """Let the Kinect see the plants of `parts` and wire its fix to the inputs that take it; then put in the effects
    that the scenario lists for these robots, but for those in the wires named in `without`."""
    tilting = [part for part in parts if _tilts(part)] if scenario.space.localizer.mode == "image" else []
    bench.add("kinect", _localizer(scenario, [part.name for part in parts], [part.name for part in tilting]))
    if len(parts) == 1:
        seen, delivered = ["kinect.poses"], ["kinect.fixes"]
    else:
        bench.add("poses", Multiplexer([3] * len(parts)))
        bench.add("fixes", Demultiplexer([len(FIX)] * len(parts)))
        bench.wire(("poses.y0", "kinect.poses"), ("kinect.fixes", "fixes.u0"))
        seen = [f"poses.u{i}" for i in range(len(parts))]
        delivered = [f"fixes.y{i}" for i in range(len(parts))]
    for part, pose, fix in zip(parts, seen, delivered, strict=True):
        bench.wire((part.block("plant.pose"), pose), *[(fix, part.block(target)) for target in part.takes_fix])
    if len(tilting) == 1:
        bench.wire((_balance(tilting[0]), "kinect.balance"))
    elif tilting:
        bench.add("balances", Multiplexer([len(robots()[part.name].truth.columns) for part in tilting]))
        bench.wire(*((_balance(part), f"balances.u{i}") for i, part in enumerate(tilting)))
        bench.wire(("balances.y0", "kinect.balance"))
    for part, pose in zip(parts, seen, strict=True):
        ends = {"pose": [pose], "fix": [part.block(target) for target in part.takes_fix]}
        splice_chosen(part, body_of(scenario, robots()[part.name]), getattr(scenario, part.name).effects, ends, without)


def oldest_fix_ticks(scenario: "Scenario", order_size: int) -> int:
    """The age of a fix when it reaches a robot: of the camera's frame, camera latency, then the link, and what a wrong
    clock adds to it."""
    space = scenario.space
    age = space.localizer.latency_ticks + delay_ticks(space.link, order_size)
    if space.localizer.mode == "image":
        from drake_ispace.vision.image_localizer import oldest_frame_ticks

        age += oldest_frame_ticks(space.camera.frame_rate_hz)
    if any("clock_offset" in getattr(scenario, name).effects for name in robots()):
        age += CLOCK_TICKS
    return age


def _tilts(part):
    return "tilt" in robots()[part.name].truth.columns


def _balance(part):
    return part.block(f"plant.{robots()[part.name].truth.signal}")


def _localizer(scenario, names, tilting):
    """The block of `space.localizer.mode`; both have the same ports, but that pictures show a tilt as well."""
    if scenario.space.localizer.mode == "image":
        from drake_ispace.vision.image_localizer import ImageLocalizer

        axles_m = {name: getattr(scenario, name).plant.wheel_radius_m for name in tilting}
        return ImageLocalizer(scenario.space, names, scenario.seed, axles_m)
    return KinectLocalizer(scenario.space, len(names), scenario.seed)
