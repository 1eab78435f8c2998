"""The room: one camera for all robots, and the wires to each robot's link."""

from collections.abc import Collection

from pydrake.systems.primitives import Demultiplexer, Multiplexer

from drake_ispace.effects.link import CLOCK_TICKS
from drake_ispace.scenario import ROBOTS, Scenario, body_of
from drake_ispace.space.link import delay_ticks
from drake_ispace.space.localizer import FIX, KinectLocalizer
from drake_ispace.wiring.bench import Bench
from drake_ispace.wiring.effects import chosen_effects, splice_effects


def add_room(
    bench: Bench, scenario: Scenario, viewers: dict[str, list[str]], without: Collection[str] = (),
) -> None:
    """Let the Kinect see each plant named in `viewers` and wire its fix to the inputs listed there; then put in the
    effects that the scenario lists for these robots, but for those in the wires named in `without`."""
    robots = [plant.removesuffix("_plant") for plant in viewers]
    bench.add("kinect", _localizer(scenario, robots))
    if len(viewers) == 1:
        seen, delivered = ["kinect.poses"], ["kinect.fixes"]
    else:
        bench.add("poses", Multiplexer([3] * len(viewers)))
        bench.add("fixes", Demultiplexer([FIX] * len(viewers)))
        bench.wire(("poses.y0", "kinect.poses"), ("kinect.fixes", "fixes.u0"))
        seen = [f"poses.u{i}" for i in range(len(viewers))]
        delivered = [f"fixes.y{i}" for i in range(len(viewers))]
    for (plant, inputs), pose, fix in zip(viewers.items(), seen, delivered, strict=True):
        bench.wire((f"{plant}.pose", pose), *[(fix, target) for target in inputs])
    for robot, pose, inputs in zip(robots, seen, viewers.values(), strict=True):
        wires = {
            "torque": [f"{robot}_plant.torque"], "wheel_angle": [f"{robot}_encoder.wheel_angle"],
            "body_motion": [f"{robot}_imu.body_motion"], "pose": [pose], "fix": inputs,
            "velocity": [f"{robot}_plant.velocity"],
        }
        wires = {name: ends for name, ends in wires.items() if name not in without}
        splice_effects(bench, body_of(scenario, robot), chosen_effects(getattr(scenario, robot).effects), wires)


def oldest_fix_ticks(scenario: Scenario, order_size: int) -> int:
    """The age of a fix when it reaches a robot: of the camera's frame, camera latency, then the link, and what a wrong
    clock adds to it."""
    space = scenario.space
    age = space.localizer.latency_ticks + delay_ticks(space.link, order_size)
    if space.localizer.mode == "image":
        from drake_ispace.space.image_localizer import oldest_frame_ticks

        age += oldest_frame_ticks(space.camera.frame_rate_hz)
    if any("clock_offset" in getattr(scenario, robot).effects for robot in ROBOTS):
        age += CLOCK_TICKS
    return age


def _localizer(scenario, robots):
    """The block of `space.localizer.mode`; both have the same ports."""
    if scenario.space.localizer.mode == "image":
        from drake_ispace.space.image_localizer import ImageLocalizer

        return ImageLocalizer(scenario.space, robots, scenario.seed)
    return KinectLocalizer(scenario.space, len(robots), scenario.seed)
