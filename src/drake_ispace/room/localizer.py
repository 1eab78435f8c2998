"""The room's localiser: the robots' poses measured by the ceiling camera, with a zero-order hold at T_v = 95 ms.

This module holds the geometric mode. Each robot carries two markers. Noise is added to the true positions of the
markers, the sums are rounded to the camera's pixels on the floor, and the pose is computed from the rounded positions.
The image mode, which renders and evaluates camera images, is another block with the same ports.
"""

from dataclasses import dataclass

import numpy as np

from drake_ispace.blocks.block import Block, Output, Phase, Spec, Update
from drake_ispace.blocks.functions import atan2, cos, floor, sin
from drake_ispace.blocks.kernels import copy, kernel
from drake_ispace.blocks.messages import FIX, POSE
from drake_ispace.blocks.noise import normal, stream, uniform
from drake_ispace.blocks.rates import VISION_TICKS
from drake_ispace.files.quantity import quantity


@dataclass
class Localizer:
    """Resolution, noise, delay and dropouts with which the room's camera measures a robot's two markers."""

    # geometric: true marker positions at the camera's ground resolution; image: markers detected in rendered images
    mode: str = quantity("geometric", choices=("geometric", "image"))
    # metres per pixel of the top view along x and y, section 5.4
    pixel_m: list[float] = quantity([0.00487, 0.00551], "m/pixel", above=0.0, length=2)
    # whether the position of a marker is rounded to the centre of a pixel
    whole_pixels: bool = quantity(True)
    # standard deviation of a marker's position along each axis, before rounding; assumed
    noise_std_pixels: float = quantity(0.3, "pixels", minimum=0.0)
    # distance between a robot's front and rear marker; assumed
    marker_spacing_m: float = quantity(0.2, "m", above=0.0)
    # delay from capture to the room's computer
    latency_ticks: int = quantity(0, "ticks of 5 ms", minimum=0, maximum=2000)
    # share of captures in which a robot is not detected
    dropout: float = quantity(0.0, minimum=0.0, maximum=1.0)


@kernel
def marker(place, pixel, noise, whole):
    """Return the measured position [m] along one axis of a marker at `place` [m].

    pixel: size of a pixel [m]; noise: added before rounding [pixels]; whole: 1 to round to the centre of a pixel, or 0.
    """
    at = place / pixel + noise
    return pixel * (floor(at) + 0.5) if whole > 0.0 else pixel * at


@kernel
def see(tick, robot, x, y, phi, camera, noise_stream, out):
    """Write the fix of one robot at the true pose x, y [m], phi [rad] in W into `out`; camera: the parameter group."""
    pixel_x, pixel_y, whole, noise_std, spacing, dropout, half_width, half_depth = (
        camera[0], camera[1], camera[2], camera[3], camera[4], camera[5], camera[6], camera[7],
    )
    out[:] = 0.0
    out[FIX.tick] = tick
    if not (abs(x) <= half_width and abs(y) <= half_depth):
        return
    channel = 8 * robot
    if dropout > 0.0 and uniform(noise_stream, tick, channel + 4) < dropout:
        return
    if whole == 0.0 and noise_std == 0.0:
        out[FIX.seen], out[FIX.x], out[FIX.y], out[FIX.phi] = 1.0, x, y, phi
        return
    n0 = n1 = n2 = n3 = 0.0
    if noise_std > 0.0:
        n0 = noise_std * normal(noise_stream, tick, channel)
        n1 = noise_std * normal(noise_stream, tick, channel + 1)
        n2 = noise_std * normal(noise_stream, tick, channel + 2)
        n3 = noise_std * normal(noise_stream, tick, channel + 3)
    dx, dy = 0.5 * spacing * cos(phi), 0.5 * spacing * sin(phi)
    front_x, front_y = marker(x + dx, pixel_x, n0, whole), marker(y + dy, pixel_y, n1, whole)
    rear_x, rear_y = marker(x - dx, pixel_x, n2, whole), marker(y - dy, pixel_y, n3, whole)
    out[FIX.seen], out[FIX.x], out[FIX.y] = 1.0, 0.5 * (front_x + rear_x), 0.5 * (front_y + rear_y)
    out[FIX.phi] = atan2(front_y - rear_y, front_x - rear_x)


def camera_of(localizer: Localizer, half_width_m: float, half_depth_m: float) -> dict[str, float]:
    """The parameter group that `see` reads, of a camera that sees so far from the middle of the space."""
    return {
        "pixel_x_m": localizer.pixel_m[0], "pixel_y_m": localizer.pixel_m[1],
        "whole_pixels": float(localizer.whole_pixels), "noise_std_pixels": localizer.noise_std_pixels,
        "marker_spacing_m": localizer.marker_spacing_m, "dropout": localizer.dropout,
        "half_width_m": half_width_m, "half_depth_m": half_depth_m,
    }


@kernel
def capture(tick, xd, poses, camera, noise_stream, out):
    """Replace the oldest capture by a new one: x_d = [delivered messages, captured messages (oldest first)]."""
    robots = poses.shape[0] // len(POSE)
    size = len(FIX) * robots
    copy(xd[:size], out[:size])
    copy(xd[2 * size :], out[size:-size])
    for robot in range(robots):
        pose = len(POSE) * robot
        x, y, phi = poses[pose + POSE.x], poses[pose + POSE.y], poses[pose + POSE.phi]
        start = out.shape[0] - size + len(FIX) * robot
        see(tick, robot, x, y, phi, camera, noise_stream, out[start : start + len(FIX)])


@kernel
def deliver(tick, xd, poses, latency_ticks, out):
    """Deliver the newest captured messages that are at least `latency_ticks` old."""
    copy(xd, out)
    size = len(FIX) * (poses.shape[0] // len(POSE))
    for start in range(size, xd.shape[0], size):
        if 0.0 <= xd[start + FIX.tick] and xd[start + FIX.tick] <= tick - latency_ticks:
            copy(xd[start : start + size], out[:size])


@kernel
def fixes(xd, out):
    copy(xd[: out.shape[0]], out)


class KinectLocalizer(Block):
    """Measures the poses of all robots by the room's camera and holds them between vision ticks.

    .. pydrake_system::

        name: KinectLocalizer
        input_ports:
        - poses
        output_ports:
        - fixes

    poses (3 n,): true x, y [m], phi [rad] in W of each robot. fixes (5 n,): for each robot the tick of capture (-1
    before the first), seen (1 or 0), x, y [m], phi [rad] in W. A robot outside the space is not seen. Poses are
    captured in the sensing phase every 19 ticks and delivered `latency_ticks` later. P_ev of (6.6).

    Args:
        space: a room.Space, of which size and localiser are used.
        robots: number of robots n.
        seed: seed of noise and dropouts, which are drawn from the random stream `kinect`.
    """

    def __init__(self, space, robots: int = 1, seed=0):
        localizer = space.localizer
        latency = localizer.latency_ticks
        record = np.zeros(len(FIX) * robots)
        record[FIX.tick :: len(FIX)] = -1.0
        super().__init__(Spec(
            inputs={"poses": len(POSE) * robots}, outputs={"fixes": Output(len(FIX) * robots, fixes)},
            parameters={
                "camera": camera_of(localizer, space.width_m / 2.0, space.depth_m / 2.0),
                "latency_ticks": float(latency), "noise_stream": stream(seed, "kinect"),
            },
            noise_stream="kinect", discrete_state=np.tile(record, 2 + latency // VISION_TICKS),
            updates=(
                Update(capture, Phase.SENSE, VISION_TICKS),
                Update(deliver, Phase.SENSE, VISION_TICKS, offset_ticks=latency),
            ),
        ))
