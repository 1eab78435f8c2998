"""Position estimator (6.6): the room's fix, updated between fixes by odometry.

P_es[i, k] = P_ev[i] + R(phi_ev[i] - phi_lo[i]) (P_lo[k] - P_lo[i]). The printed form omits R, so that increments point
along odometry's own, drifting heading. A fix is fused with the odometry of the tick in which it was *captured*, so a
delayed fix does no harm. If the tick of a fix lies in the future, because the room's clock is ahead of the robot's, the
fix is fused with the present odometry.
"""

import numpy as np

from drake_ispace.blocks.block import Block, Output, Phase, Spec, Update
from drake_ispace.blocks.frames import wrap
from drake_ispace.blocks.functions import cos, sin
from drake_ispace.blocks.kernels import copy, kernel
from drake_ispace.blocks.messages import ESTIMATE, FIX, POSE

TICK, SEEN_TICK, EV, LO, RING = 0, 1, 2, 5, 8  # x_d; EV: P_ev[i], LO: P_lo[i] of its capture, RING: past P_lo


@kernel
def step(xd, odometry, fix, rotate, out):
    """Store this tick's odometry, then fuse a new fix; samples whose tick is already stored change nothing."""
    copy(xd, out)
    depth = (xd.shape[0] - RING) // len(ESTIMATE)
    if odometry[ESTIMATE.tick] != xd[TICK]:
        slot = RING + len(ESTIMATE) * (int(odometry[ESTIMATE.tick]) % depth)
        copy(odometry, out[slot : slot + len(ESTIMATE)])
        if xd[TICK] < 0.0 and xd[SEEN_TICK] < 0.0:  # until the first fix the estimate equals odometry
            copy(odometry[ESTIMATE.x :], out[EV:LO])
            copy(odometry[ESTIMATE.x :], out[LO:RING])
        out[TICK] = odometry[ESTIMATE.tick]
    if fix[FIX.seen] > 0.0 and fix[FIX.tick] > xd[SEEN_TICK]:
        out[SEEN_TICK] = fix[FIX.tick]
        captured = min(fix[FIX.tick], odometry[ESTIMATE.tick])
        slot = RING + len(ESTIMATE) * (int(captured) % depth)
        if captured >= 0.0 and out[slot + ESTIMATE.tick] == captured:
            for i in range(len(POSE)):
                out[EV + i] = fix[FIX.x + i]
                out[LO + i] = out[slot + ESTIMATE.x + i]


@kernel
def estimate(xd, odometry, rotate, out):
    """Write the tick and P_es[i, k] of (6.6), heading wrapped to [-pi, pi); rotate: 0 omits the rotation R."""
    turn = (xd[EV + POSE.phi] - xd[LO + POSE.phi]) if rotate > 0.0 else 0.0
    c, s = cos(turn), sin(turn)
    dx, dy = odometry[ESTIMATE.x] - xd[LO + POSE.x], odometry[ESTIMATE.y] - xd[LO + POSE.y]
    out[ESTIMATE.tick] = odometry[ESTIMATE.tick]
    out[ESTIMATE.x] = xd[EV + POSE.x] + c * dx - s * dy
    out[ESTIMATE.y] = xd[EV + POSE.y] + s * dx + c * dy
    out[ESTIMATE.phi] = wrap(xd[EV + POSE.phi] + odometry[ESTIMATE.phi] - xd[LO + POSE.phi])


class PositionEstimator(Block):
    """Estimates the pose at every tick from a fix every 95 ms and odometry.

    .. pydrake_system::

        name: PositionEstimator
        input_ports:
        - odometry
        - fix
        output_ports:
        - pose

    odometry (4,): tick, x, y [m], phi [rad] in W. fix (5,): tick of capture, seen, x, y [m], phi [rad] in W; ignored
    unless seen. pose (4,): tick, x, y [m], phi [rad] in [-pi, pi), in W. Equation (6.6), corrected.

    Args:
        oldest_fix_ticks: largest age of a fix on arrival; an older fix is ignored.
        as_printed: whether to omit the rotation R, as in print.
    """

    def __init__(self, oldest_fix_ticks: int = 0, as_printed: bool = False):
        start = np.zeros(RING + len(ESTIMATE) * (oldest_fix_ticks + 1))
        start[TICK] = start[SEEN_TICK] = -1.0
        start[RING + ESTIMATE.tick :: len(ESTIMATE)] = -1.0
        super().__init__(Spec(
            inputs={"odometry": len(ESTIMATE), "fix": len(FIX)}, outputs={"pose": Output(len(ESTIMATE), estimate)},
            parameters={"rotate": 0.0 if as_printed else 1.0},
            discrete_state=start, updates=(Update(step, Phase.COMPUTE, through=True),),
        ))
