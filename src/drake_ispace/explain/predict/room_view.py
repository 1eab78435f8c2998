"""Innovations of the camera's fixes, each at its own instant: measured less predicted from the model's motion.

The prediction of a fix is the estimate at the last fix plus the model's motion since. The next estimate is the
prediction plus a share of the innovation. A fix is compared `LEAD_TICKS` after its capture, so that a clock that is
ahead or behind can be tried without poses of the future.
"""

import numpy as np

from drake_ispace.blocks.block import Block, Output, Phase, Spec, Update
from drake_ispace.blocks.frames import wrap
from drake_ispace.blocks.kernels import copy, kernel
from drake_ispace.blocks.rates import TICK_S

LEAD_TICKS = 40
_RING = 2 * LEAD_TICKS + 2
_GAIN = (0.25, 0.15)  # share of the innovation in the next estimate, of place and of heading
_ESTIMATE, _MODEL, _STARTED, _INNOVATION = 3 * _RING, 3 * _RING + 3, 3 * _RING + 6, 3 * _RING + 7


@kernel
def look(tick, xd, pose, fix, gain, offset_s, out):
    """Store the pose; where there is a fix, compare it.

    x_d = [ring of modelled poses (3 each), estimate at the last fix (3), modelled pose at that fix (3), started,
    innovation (3)].
    """
    copy(xd, out)
    slot = 3 * (tick % _RING)
    out[slot], out[slot + 1], out[slot + 2] = pose[0], pose[1], pose[2]
    if fix[0] == 0.0:
        return
    back = LEAD_TICKS - (fix[4] - offset_s) / TICK_S
    back = min(max(back, 0.0), _RING - 2.0, float(tick))  # no pose is known before the run
    whole = int(np.floor(back))
    share = back - whole
    late, early = 3 * ((tick - whole + _RING) % _RING), 3 * ((tick - whole - 1 + 2 * _RING) % _RING)
    x = out[late] + share * (out[early] - out[late])
    y = out[late + 1] + share * (out[early + 1] - out[late + 1])
    phi = out[late + 2] + share * (out[early + 2] - out[late + 2])
    px, py, pphi = x, y, phi
    if xd[_STARTED] > 0.0:
        turn = xd[_ESTIMATE + 2] - xd[_MODEL + 2]
        c, s = np.cos(turn), np.sin(turn)
        dx, dy = x - xd[_MODEL], y - xd[_MODEL + 1]
        px = xd[_ESTIMATE] + c * dx - s * dy
        py = xd[_ESTIMATE + 1] + s * dx + c * dy
        pphi = xd[_ESTIMATE + 2] + phi - xd[_MODEL + 2]
    nx, ny, nphi = fix[1] - px, fix[2] - py, wrap(fix[3] - pphi)
    kp, kphi = gain[0], gain[1]
    if xd[_STARTED] == 0.0:
        kp, kphi = 1.0, 1.0
    out[_ESTIMATE], out[_ESTIMATE + 1], out[_ESTIMATE + 2] = px + kp * nx, py + kp * ny, pphi + kphi * nphi
    out[_MODEL], out[_MODEL + 1], out[_MODEL + 2] = x, y, phi
    out[_STARTED] = 1.0
    out[_INNOVATION], out[_INNOVATION + 1], out[_INNOVATION + 2] = nx, ny, nphi


@kernel
def innovation(xd, out):
    """The innovation of the latest fix."""
    copy(xd[_INNOVATION:], out)


class RoomView(Block):
    """Compares the model's pose with the camera's fixes.

    .. pydrake_system::

        name: RoomView
        input_ports:
        - pose
        - fix
        output_ports:
        - innovation

    pose (3,): what the camera would report now, x, y [m], phi [rad] in W. fix (5,): whether there is one (1 or 0), x, y
    [m], phi [rad] in W, and the time [s] from the tick that lies LEAD_TICKS back to its capture. innovation (3,): of
    the latest fix [m, m, rad]; that of the first fix is against the model's start.
    """

    def __init__(self):
        super().__init__(Spec(
            inputs={"pose": 3, "fix": 5}, outputs={"innovation": Output(3, innovation)},
            parameters={"gain": np.array(_GAIN), "offset_s": 0.0},
            discrete_state=np.zeros(_INNOVATION + 3), updates=(Update(look, Phase.SENSE),),
        ))
