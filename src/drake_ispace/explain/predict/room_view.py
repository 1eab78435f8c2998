"""Innovations of the camera's fixes, each at its own instant: measured less predicted from the model's motion.

The prediction of a fix is the estimate at the last fix plus the model's motion since. The next estimate is the
prediction plus a share of the innovation. A fix is compared `LEAD_TICKS` after its capture, so that a clock that is
ahead or behind can be tried without poses of the future.
"""

import numpy as np

from drake_ispace.blocks.block import Block, Output, Phase, Spec, Update
from drake_ispace.blocks.frames import wrap
from drake_ispace.blocks.functions import cos, floor, sin
from drake_ispace.blocks.kernels import copy, kernel
from drake_ispace.blocks.messages import POSE, layout
from drake_ispace.blocks.rates import TICK_S

LEAD_TICKS = 40

#: A fix that was recorded, LEAD_TICKS after the tick nearest to its capture: there is one (1 or 0), x, y [m], phi [rad]
#: in W, by how much it was captured after that tick [s].
SIGHTING = layout("Sighting", "is_there x y phi after_s")

_RING = 2 * LEAD_TICKS + 2
_GAIN = (0.25, 0.15)  # shares of the innovation that the estimate takes over, of place and of heading
_ESTIMATE = len(POSE) * _RING
_MODEL = _ESTIMATE + len(POSE)
_STARTED = _MODEL + len(POSE)
_INNOVATION = _STARTED + 1


@kernel
def look(tick, xd, pose, sighting, gain, offset_s, out):
    """Store the pose; where there is a fix, compare it.

    x_d = [ring of modelled poses (3 each), estimate at the last fix (3), modelled pose at that fix (3), started,
    innovation (3)].
    """
    copy(xd, out)
    slot = len(POSE) * (tick % _RING)
    copy(pose, out[slot : slot + len(POSE)])
    if sighting[SIGHTING.is_there] == 0.0:
        return
    back = LEAD_TICKS - (sighting[SIGHTING.after_s] - offset_s) / TICK_S
    back = min(max(back, 0.0), _RING - 2.0, float(tick))  # no pose is known before the run
    whole = int(floor(back))
    share = back - whole
    late = len(POSE) * ((tick - whole + _RING) % _RING)
    early = len(POSE) * ((tick - whole - 1 + 2 * _RING) % _RING)
    x = out[late + POSE.x] + share * (out[early + POSE.x] - out[late + POSE.x])
    y = out[late + POSE.y] + share * (out[early + POSE.y] - out[late + POSE.y])
    phi = out[late + POSE.phi] + share * (out[early + POSE.phi] - out[late + POSE.phi])
    px, py, pphi = x, y, phi
    if xd[_STARTED] > 0.0:
        turn = xd[_ESTIMATE + POSE.phi] - xd[_MODEL + POSE.phi]
        c, s = cos(turn), sin(turn)
        dx, dy = x - xd[_MODEL + POSE.x], y - xd[_MODEL + POSE.y]
        px = xd[_ESTIMATE + POSE.x] + c * dx - s * dy
        py = xd[_ESTIMATE + POSE.y] + s * dx + c * dy
        pphi = xd[_ESTIMATE + POSE.phi] + phi - xd[_MODEL + POSE.phi]
    nx, ny, nphi = sighting[SIGHTING.x] - px, sighting[SIGHTING.y] - py, wrap(sighting[SIGHTING.phi] - pphi)
    kp, kphi = gain[0], gain[1]
    if xd[_STARTED] == 0.0:
        kp, kphi = 1.0, 1.0
    out[_ESTIMATE + POSE.x], out[_ESTIMATE + POSE.y] = px + kp * nx, py + kp * ny
    out[_ESTIMATE + POSE.phi] = pphi + kphi * nphi
    out[_MODEL + POSE.x], out[_MODEL + POSE.y], out[_MODEL + POSE.phi] = x, y, phi
    out[_STARTED] = 1.0
    out[_INNOVATION + POSE.x], out[_INNOVATION + POSE.y], out[_INNOVATION + POSE.phi] = nx, ny, nphi


@kernel
def innovation(xd, out):
    """The innovation of the latest fix."""
    copy(xd[_INNOVATION:], out)


class RoomView(Block):
    """Compares the model's pose with what the camera reported.

    .. pydrake_system::

        name: RoomView
        input_ports:
        - pose
        - sighting
        output_ports:
        - innovation

    pose (3,): what the camera would report now, x, y [m], phi [rad] in W. sighting (5,): whether there is one (1 or
    0), x, y [m], phi [rad] in W, and the time [s] from the tick that lies LEAD_TICKS back to its capture. innovation
    (3,): of the latest sighting [m, m, rad]; that of the first is against the model's start.
    """

    def __init__(self):
        super().__init__(Spec(
            inputs={"pose": len(POSE), "sighting": len(SIGHTING)},
            outputs={"innovation": Output(len(POSE), innovation)},
            parameters={"gain": np.array(_GAIN), "offset_s": 0.0},
            discrete_state=np.zeros(_INNOVATION + len(POSE)), updates=(Update(look, Phase.SENSE, in_place=True),),
        ))
