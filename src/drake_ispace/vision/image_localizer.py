"""The room's localiser on images: rendered camera pictures, top views, thresholds, poses; chapter 5.

It has the ports, the messages and the timing of the geometric KinectLocalizer and stands in its place when
`space.localizer.mode` is `image`. Its maths are no kernels: a compiled rollout refuses it.
"""

import itertools
from collections.abc import Mapping, Sequence

import numpy as np

from drake_ispace.blocks.block import Block, Output, Phase, Spec, Update
from drake_ispace.blocks.messages import FIX, POSE, TICK
from drake_ispace.blocks.noise import stream
from drake_ispace.blocks.rates import TICK_S, VISION_TICKS
from drake_ispace.robots.library import robots as library
from drake_ispace.room.room import Space
from drake_ispace.vision.drawing.renderer import Renderer
from drake_ispace.vision.drawing.scene import marker_height, obstacles, robot_box
from drake_ispace.vision.finding.eye import Eye, Look
from drake_ispace.vision.finding.markers import Colour
from drake_ispace.vision.finding.patterns import Target, pair
from drake_ispace.vision.optics.camera import view_of
from drake_ispace.vision.optics.top_view import top_view_of

#: The markers' colours (scene.PAINTS) as ranges of HSV; orange and purple things lie between them.
COLOURS = {
    "red": Colour((171.0, 7.0), 130.0, 90.0), "blue": Colour((100.0, 117.0), 130.0, 90.0),
    "yellow": Colour((20.0, 35.0), 130.0, 95.0), "green": Colour((55.0, 82.0), 130.0, 80.0),
}


_SHOWN = len(POSE) + 1  # of each robot: its pose, and how far it has tilted


def targets(space: Space, names: Sequence[str]) -> list[Target]:
    """The targets of the search: the robots called `names` with the markers of `space`."""
    markers = space.markers
    area = markers.side_m**2
    limits = (area * (1.0 - markers.area_tolerance), area * (1.0 + markers.area_tolerance))
    return [
        Target(name, pair(
            *library()[name].colours, space.localizer.marker_spacing_m, markers.spacing_tolerance_m, limits
        )) for name in names
    ]


def room_eye(space: Space, names: Sequence[str]) -> Eye:
    """The eye that finds the robots called `names` in images of the room's camera: a top view per height of markers."""
    view, looks = view_of(space.camera), []
    for height in sorted({marker_height(name, space) for name in names}):
        top = top_view_of(view, space.width_m, space.depth_m, space.localizer.pixel_m, height)
        looks.append(Look(top, tuple(targets(space, [name for name in names if marker_height(name, space) == height]))))
    return Eye(view.size, looks, COLOURS)


def room_renderer(space: Space, seed: int = 0):
    """The renderer that `space.scenery.renderer` names, of the room with its obstacles.

    Raises:
        InputError: no libEGL for the second renderer, or bad obstacles.
    """
    view, static = view_of(space.camera), obstacles(space)
    if space.scenery.renderer == "vtk":
        from drake_ispace.vision.drawing.vtk_renderer import VtkRenderer

        return VtkRenderer(view, space.scenery, static, seed=seed)
    return Renderer(view, space.scenery, static, space.width_m, seed)


def frame_ticks(rate_hz: float) -> tuple[int, list[int]]:
    """(period, offsets) in ticks at which frames of `rate_hz` are there: 30 Hz gives 20 ticks and 0, 7, 14.

    A frame that falls between two ticks is taken at the later one. Rates are kept to whole ticks over a second.
    """
    if rate_hz == 0.0:
        return VISION_TICKS, [0]
    ticks_a_second = round(1.0 / TICK_S)
    if rate_hz >= ticks_a_second:
        return 1, [0]
    frames = max(round(rate_hz), 1)
    common = np.gcd(frames, ticks_a_second)
    period, frames = ticks_a_second // common, frames // common
    return int(period), [-(-i * period // frames) for i in range(frames)]


def oldest_frame_ticks(rate_hz: float) -> int:
    """The largest age of the latest frame, in ticks."""
    period, offsets = frame_ticks(rate_hz)
    return 0 if rate_hz == 0.0 else int(max(np.diff([*offsets, period]))) - 1


class ImageLocalizer(Block):
    """Poses of all robots as found in the camera's images, held between vision ticks.

    .. pydrake_system::

        name: ImageLocalizer
        input_ports:
        - poses
        - balance
        output_ports:
        - fixes

    poses (3 n,): true x, y [m], phi [rad] in W of each robot. balance, only with `axles_m`: of each robot in it the
    `truth` of its plant, of which the picture shows the tilt [rad]. fixes (5 n,): for each robot the tick of the frame
    (-1 before the first), seen (1 or 0), x, y [m], phi [rad]; zeros where it is not seen. Each frame of the camera is
    exposed in the sensing phase, the latest is looked at every 19 ticks, and what was found is delivered
    `latency_ticks` later. P_ev of (6.6).

    x_d = [frame's tick, its poses with tilts, those of the frame before (for motion blur), delivered messages, messages
    under way, oldest first].

    Args:
        space: the room, its camera and scenery.
        names: of the robots, in the order of the ports; seed: of carpet and noise, stream `kinect`.
        axles_m: robots that tilt, in the order of `names` -> the height of the axle about which they do.
    """

    def __init__(self, space: Space, names: Sequence[str], seed: int = 0, axles_m: Mapping[str, float] | None = None):
        robots, latency = len(names), space.localizer.latency_ticks
        self.names, self.space = list(names), space
        eye, renderer, dropout = room_eye(space, names), room_renderer(space, seed), space.localizer.dropout
        period, offsets = frame_ticks(space.camera.frame_rate_hz)
        poses_size, size = _SHOWN * robots, len(FIX) * robots
        axles_m, truths = dict(axles_m or {}), [library()[name].truth.columns for name in axles_m or ()]
        tilting = [_SHOWN * names.index(name) + len(POSE) for name in axles_m]
        tilts = [i for i, column in enumerate(itertools.chain(*truths)) if column == "tilt"]
        now, before = slice(1, 1 + poses_size), slice(1 + poses_size, 1 + 2 * poses_size)
        start = before.stop
        exposure_ticks = space.camera.exposure_s / TICK_S

        def expose(tick, xd, poses, balance, out):
            out[:] = xd
            shown = np.zeros((robots, _SHOWN))
            shown[:, : len(POSE)] = poses.reshape(robots, len(POSE))
            shown = shown.ravel()
            shown[tilting] = balance[tilts]
            last = xd[now] if xd[TICK] >= 0.0 else shown
            last = np.where(np.isnan(last), shown, last)  # a robot that was hidden
            out[TICK], out[now], out[before] = tick, shown, _per_tick(shown, last, tick - xd[TICK])

        def look(xd, noise_stream, out):
            out[:] = xd
            out[start + size : -size], messages = xd[start + 2 * size :], out[-size:]
            frame, poses = int(xd[TICK]), xd[now].reshape(robots, _SHOWN)
            motion = xd[before].reshape(robots, _SHOWN)[:, : len(POSE)] * exposure_ticks
            shown = np.isfinite(poses).all(axis=1)
            boxes = [
                robot_box(name, space, (x, y, phi), tilt, axles_m.get(name, 0.0))
                for name, (x, y, phi, tilt) in zip(names, poses, strict=True)
            ]
            boxes = [box for box, is_shown in zip(boxes, shown, strict=True) if is_shown]
            image = renderer.render(boxes, motion[shown], frame).colour
            sightings = eye.locate(image)
            lost = np.random.default_rng([*noise_stream.astype(np.int64), frame]).random(robots) < dropout
            messages[:] = 0.0
            for i, message in enumerate(messages.reshape(robots, len(FIX))):
                message[FIX.tick], sighting = frame, sightings[names[i]]
                if sighting is not None and not lost[i]:
                    message[FIX.seen], message[FIX.x], message[FIX.y] = 1.0, sighting.x, sighting.y
                    message[FIX.phi] = sighting.phi

        def deliver(tick, xd, out):
            out[:] = xd
            for at in range(start + size, len(xd), size):
                if 0.0 <= xd[at + FIX.tick] and captured(xd[at + FIX.tick]) <= tick - latency:
                    out[start : start + size] = xd[at : at + size]

        def captured(frame):
            """The tick of the message made of the frame."""
            return -(-frame // VISION_TICKS) * VISION_TICKS

        def fixes(xd, out):
            out[:] = xd[start : start + size]

        empty = np.zeros(size)
        empty[FIX.tick :: len(FIX)] = -1.0
        super().__init__(Spec(
            inputs={"poses": len(POSE) * robots} | ({"balance": sum(map(len, truths))} if tilting else {}),
            outputs={"fixes": Output(size, fixes)},
            parameters={"noise_stream": stream(seed, "kinect")} | ({} if tilting else {"balance": np.zeros(0)}),
            noise_stream="kinect",
            discrete_state=np.concatenate(
                [[-1.0], np.zeros(2 * poses_size), np.tile(empty, 2 + latency // VISION_TICKS)]
            ),
            updates=(
                *(Update(expose, Phase.SENSE, period, offset) for offset in offsets),
                Update(look, Phase.SENSE, VISION_TICKS),
                Update(deliver, Phase.SENSE, VISION_TICKS, offset_ticks=latency),
            ),
        ))


def _per_tick(poses, before, ticks):
    """Motion in one tick, headings by the short way round."""
    change = np.asarray(poses) - before
    headings = slice(POSE.phi, None, _SHOWN)
    change[headings] = np.angle(np.exp(1j * change[headings]))
    return change / ticks
