"""In the wire `pose`, between the robot and what the room's camera says of it.

The pose is that of B in W: x, y [m] from the room's middle, phi [rad]. Rounding to pixels and noise come later, in the
localiser, and so does the room's edge, beyond which nothing is seen: what counts is the pose as reported.
"""

import math
from dataclasses import replace

import numpy as np

from drake_ispace.blocks.frames import wrap
from drake_ispace.blocks.functions import atan2, cos, floor, sin
from drake_ispace.blocks.kernels import copy, kernel
from drake_ispace.blocks.noise import stream, uniform
from drake_ispace.blocks.rates import TICK_S, VISION_TICKS
from drake_ispace.effects.card import Card, Parameter
from drake_ispace.effects.wires import PoseEffect

_LONGEST_S = 0.25
_RING = math.ceil(_LONGEST_S / TICK_S) + 2  # poses, from this tick's own to the two around the oldest instant


@kernel
def delayed(tick, xd, pose, latency_ticks, out):
    """The pose of tick - latency; before tick 0 the robot stands where it starts."""
    ring = xd.shape[0] // 3
    back = min(latency_ticks, float(tick))
    whole = int(floor(back))
    share = back - whole
    copy(pose, out)
    if whole > 0:
        late = 3 * ((tick - whole) % ring)
        out[0], out[1], out[2] = xd[late], xd[late + 1], xd[late + 2]
    if share > 0.0:
        early = 3 * ((tick - whole - 1) % ring)
        out[0] += share * (xd[early] - out[0])
        out[1] += share * (xd[early + 1] - out[1])
        out[2] += share * wrap(xd[early + 2] - out[2])


@kernel
def remember_pose(tick, xd, pose, out):
    """x_d = [pose of a tick (3)] of the latest ticks, that of tick k at k modulo their number."""
    copy(xd, out)
    slot = 3 * (tick % (xd.shape[0] // 3))
    out[slot], out[slot + 1], out[slot + 2] = pose[0], pose[1], pose[2]


@kernel
def placed(pose, place, out):
    """A point of the robot instead of its middle; place: x, y [m] in B."""
    c, s = cos(pose[2]), sin(pose[2])
    out[0] = pose[0] + (c * place[0] - s * place[1])
    out[1] = pose[1] + (s * place[0] + c * place[1])
    out[2] = pose[2]


@kernel
def mounted(pose, place, yaw_rad, out):
    """`placed`, with the markers turned by `yaw_rad` as well."""
    c, s = cos(pose[2]), sin(pose[2])
    out[0] = pose[0] + (c * place[0] - s * place[1])
    out[1] = pose[1] + (s * place[0] + c * place[1])
    out[2] = pose[2] + yaw_rad


@kernel
def stretched(pose, gain, out):
    out[0], out[1], out[2] = gain * pose[0], gain * pose[1], pose[2]


@kernel
def distorted(pose, per_m2, out):
    """Places times 1 + k |p|^2; the heading follows two markers close to each other."""
    if per_m2 == 0.0:
        copy(pose, out)
        return
    x, y = pose[0], pose[1]
    stretch = 1.0 + per_m2 * (x * x + y * y)
    c, s = cos(pose[2]), sin(pose[2])
    more = 2.0 * per_m2 * (c * x + s * y)
    out[0], out[1] = stretch * x, stretch * y
    out[2] = pose[2] + atan2(more * (c * y - s * x), stretch + more * (c * x + s * y))


@kernel
def keystoned(pose, x_per_m, y_per_m, out):
    """Places over 1 - a x - b y; the heading follows two markers close to each other."""
    if x_per_m == 0.0 and y_per_m == 0.0:
        copy(pose, out)
        return
    c, s = cos(pose[2]), sin(pose[2])
    gain = 1.0 / (1.0 - (x_per_m * pose[0] + y_per_m * pose[1]))
    more = gain * (x_per_m * c + y_per_m * s)
    out[0], out[1] = gain * pose[0], gain * pose[1]
    out[2] = pose[2] + atan2(more * (c * pose[1] - s * pose[0]), 1.0 + more * (c * pose[0] + s * pose[1]))


@kernel
def rotated(pose, angle_rad, out):
    c, s = cos(angle_rad), sin(angle_rad)
    out[0] = c * pose[0] - s * pose[1]
    out[1] = s * pose[0] + c * pose[1]
    out[2] = pose[2] + angle_rad


@kernel
def shifted(pose, shift, out):
    out[0], out[1], out[2] = pose[0] + shift[0], pose[1] + shift[1], pose[2]


@kernel
def hidden(tick, pose, share, noise_stream, out):
    """NaN, which no camera sees, during a vision instant that is lost: of the ticks that lead up to it and its own."""
    copy(pose, out)
    instant = (tick + VISION_TICKS - 1) // VISION_TICKS
    if share > 0.0 and uniform(noise_stream, instant, 0) < share:
        out[0], out[1], out[2] = np.nan, np.nan, np.nan


class CameraLatency(PoseEffect):
    """The pose of `latency` ago under the stamp of now; between two ticks a straight line, angles the short way."""

    card = Card(
        name="camera_latency", title="Camera latency", home="camera", equation="pose reported(t) = pose(t - latency)",
        source="exposure, transfer and image processing before the message is stamped",
        signature="the room's pose lags behind odometry: an error against the motion in proportion to the speed, and "
        "of the heading in proportion to the yaw rate; none while standing",
        look_alikes=("clock_offset", "command_delay", "constant_slip", "marker_offset"),
        excitation="several speeds, stops and turns: slip leaves an error of the way after a stop, a latency none; "
        "from clock_offset of the same size it differs in the delay of feedback alone",
    )
    parameters = (Parameter("latency_s", "s", 0.0, 0.0, _LONGEST_S, (0.02, 0.08), tolerance=1e-3),)
    output, update, in_place = delayed, remember_pose, True

    def memory_size(self, body):
        return 3 * _RING

    def block_parameters(self, body, values):
        return {"latency_ticks": values["latency_s"] / TICK_S}


class MarkerOffset(PoseEffect):
    """p + R(phi) (x, y): the middle of the markers is not the middle of the robot.

    Where a robot's markers may be mounted at any angle they may be turned as well: phi + yaw.
    """

    card = Card(
        name="marker_offset", title="Marker offset", home="camera", equation="p' = p + R(phi) (x, y)",
        source="markers glued on off-centre, or high markers seen at an angle",
        signature="turning on the spot, the reported point goes round a circle; an offset that turns with the heading",
        look_alikes=("camera_offset", "centre_of_gravity_offset", "camera_latency", "clock_offset", "cornering_slip"),
        excitation="at least half a turn: camera_offset stays with the room; several speeds against a latency, or slip "
        "in bends",
    )
    parameters = tuple(Parameter(f"{axis}_m", "m", 0.0, -1.0, 1.0, (0.01, 0.05), tolerance=1e-3) for axis in "xy")
    yaw = (Parameter("yaw_rad", "rad", 0.0, -0.3, 0.3, (0.01, 0.05), tolerance=1e-3),)

    def parameters_of(self, body):
        return self.parameters + self.yaw if body.robot.markers_may_turn else self.parameters

    def output_of(self, body):
        return mounted if body.robot.markers_may_turn else placed

    def block_parameters(self, body, values):
        yaw = {"yaw_rad": values["yaw_rad"]} if body.robot.markers_may_turn else {}
        return {"place": np.array([values["x_m"], values["y_m"]])} | yaw


class CameraScale(PoseEffect):
    """(1 + share) (x, y) about the room's middle, headings as they are."""

    card = Card(
        name="camera_scale", title="Camera scale", home="camera", equation="x' = (1 + share) x, y' = (1 + share) y",
        source="focal length, height of the camera, or height of the markers other than calibrated",
        signature="every way longer for the room than for odometry by one share, headings right",
        look_alikes=("wheel_radius_error", "encoder_scale", "constant_slip", "camera_rotation"),
        excitation="driving and turning, both: a wrong radius or encoder scale changes turns too, a camera does not; "
        "slip follows the robot's own axes, the camera's scale is equal in all directions",
        same="a robot all of whose wheels and distances between them are larger by this share looks the same: measure "
        "one of them",
    )
    parameters = (Parameter("share", "1", 0.0, -0.6, 1.0, (0.01, 0.05), tolerance=1e-3, sensible=(-0.2, 0.2)),)
    output = stretched

    def block_parameters(self, body, values):
        return {"gain": 1.0 + values["share"]}


class CameraDistortion(PoseEffect):
    """p (1 + k |p|^2), from the room's middle, over which the camera hangs."""

    card = Card(
        name="camera_distortion", title="Lens distortion", home="camera",
        equation="p' = (1 + k |p|^2) p, phi' along the picture of the heading",
        source="a lens that is not corrected; k > 0: pincushion, k < 0: barrel",
        signature="places off in proportion to the cube of their distance from the room's middle",
        look_alikes=("camera_scale", "camera_keystone"),
        excitation="the middle and the corners of the room: a scale error is the same share everywhere",
    )
    parameters = (Parameter("per_m2", "1/m^2", 0.0, -0.2, 0.5, (0.01, 0.05), tolerance=1e-3),)
    output = distorted


class CameraKeystone(PoseEffect):
    """p / (1 - a x - b y): the camera does not look straight down, and its picture was not rectified."""

    card = Card(
        name="camera_keystone", title="Keystone of the camera", home="camera",
        equation="p' = p / (1 - a x - b y), phi' along the picture of the heading",
        source="a camera that hangs askew, or a floor calibrated by too few points",
        signature="places too far out on one side of the room and too far in on the other",
        look_alikes=("camera_scale", "camera_distortion", "camera_rotation"),
        excitation="all four sides of the room: a scale error is the same share on all of them",
    )
    parameters = tuple(
        Parameter(f"{axis}_per_m", "1/m", 0.0, -0.3, 0.3, (0.01, 0.05), tolerance=1e-3) for axis in "xy"
    )
    output = keystoned


class CameraRotation(PoseEffect):
    """x, y turned about the room's middle, and the heading with them."""

    in_motion = False
    card = Card(
        name="camera_rotation", title="Camera rotation", home="camera", equation="p' = R(angle) p, phi' = phi + angle",
        source="the room's axes marked askew, or a camera that was touched",
        signature="a constant difference between the room's heading and odometry's, the same from the first fix on, "
        "and places off in proportion to their distance from the room's middle",
        look_alikes=("camera_offset", "gyro_bias", "camera_scale", "marker_offset"),
        excitation="a known start, far from the room's middle: where only the room says where the robot starts, it is "
        "no more than another choice of axes",
    )
    parameters = (Parameter("angle_rad", "rad", 0.0, -0.5, 0.5, (0.01, 0.05), tolerance=3e-3),)
    output = rotated


class CameraOffset(PoseEffect):
    """A constant added to the reported place."""

    in_motion = False
    card = Card(
        name="camera_offset", title="Camera offset", home="camera", equation="p' = p + (x, y)",
        source="the room's middle marked wrongly, or a camera that was touched",
        signature="a constant difference between the room's place and odometry's in the room's axes, from the start",
        look_alikes=("marker_offset", "camera_rotation", "camera_scale", "clock_offset"),
        excitation="a known start and at least half a turn: marker_offset turns with the heading; without a known "
        "start it is no more than another choice of axes",
    )
    parameters = tuple(Parameter(f"{axis}_m", "m", 0.0, -0.5, 0.5, (0.01, 0.05), tolerance=2e-3) for axis in "xy")
    output = shifted

    def block_parameters(self, body, values):
        return {"shift": np.array([values["x_m"], values["y_m"]])}


class CameraDropouts(PoseEffect):
    """A share of the vision instants, drawn each on its own, in which the robot is not seen.

    The random stream is `{robot}.camera_dropouts` under the seed of the body.
    """

    in_motion = replayed = False
    card = Card(
        name="camera_dropouts", title="Camera dropouts and lost packets", home="camera",
        equation="not seen at a vision instant with the probability share",
        source="hidden markers, glare, packets lost between room and robot, which a recording cannot tell from them",
        signature="fixes that are missing in the recording: their count alone gives the share; between fixes the "
        "estimate drifts longer, with no direction of its own",
        look_alikes=("camera_latency", "clock_offset"),
        excitation="none needed: the fixes that a recording lacks are counted",
    )
    parameters = (Parameter("share", "1", 0.0, 0.0, 0.9, (0.1, 0.4), tolerance=0.005),)
    output = hidden

    def spec(self, body, values):
        name, spec = f"{body.name}.{self.name}", super().spec(body, values)
        parameters = {**spec.parameters, "noise_stream": stream(body.seed, name)}
        return replace(spec, parameters=parameters, noise_stream=name)


#: From the robot to the message: when, which point of the robot, how it is mapped, whether it is seen.
EFFECTS = (
    CameraLatency(), MarkerOffset(), CameraScale(), CameraDistortion(), CameraKeystone(), CameraRotation(),
    CameraOffset(), CameraDropouts(),
)
