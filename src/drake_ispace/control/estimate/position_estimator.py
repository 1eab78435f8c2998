"""Position estimator (6.6): the room's fix, carried on by odometry.

P_es[i, k] = P_ev[i] + R(phi_ev[i] - phi_lo[i]) (P_lo[k] - P_lo[i]); the printed form leaves R away, so that increments
point along odometry's own, drifting heading. A fix is fused with the odometry of the tick it was *captured* in, so a
late one does no harm; one with a stamp that is yet to come, from a clock that is ahead, is fused with that of now.
"""

import numpy as np

from drake_ispace.blocks.block import Block, Output, Phase, Spec, Update
from drake_ispace.blocks.frames import wrap
from drake_ispace.blocks.kernels import copy, kernel
from drake_ispace.blocks.messages import FIX

TICK, SEEN_TICK, EV, LO, RING = 0, 1, 2, 5, 8  # x_d; EV: P_ev[i], LO: P_lo[i] of its capture, RING: past P_lo


@kernel
def step(xd, odometry, fix, rotate, out):
    """Remember this tick's odometry, then take in a new fix; samples seen before change nothing."""
    copy(xd, out)
    depth = (xd.shape[0] - RING) // 4
    if odometry[0] != xd[TICK]:
        slot = RING + 4 * (int(odometry[0]) % depth)
        copy(odometry[:4], out[slot : slot + 4])
        if xd[TICK] < 0.0 and xd[SEEN_TICK] < 0.0:  # until the first fix: odometry from where the robot starts
            copy(odometry[1:4], out[EV : EV + 3])
            copy(odometry[1:4], out[LO : LO + 3])
        out[TICK] = odometry[0]
    if fix[1] > 0.0 and fix[0] > xd[SEEN_TICK]:
        out[SEEN_TICK] = fix[0]
        captured = min(fix[0], odometry[0])
        slot = RING + 4 * (int(captured) % depth)
        if captured >= 0.0 and out[slot] == captured:
            for i in range(3):
                out[EV + i] = fix[2 + i]
                out[LO + i] = out[slot + 1 + i]


@kernel
def estimate(xd, odometry, rotate, out):
    turn = (xd[EV + 2] - xd[LO + 2]) if rotate > 0.0 else 0.0
    c, s = np.cos(turn), np.sin(turn)
    dx, dy = odometry[1] - xd[LO], odometry[2] - xd[LO + 1]
    out[0] = odometry[0]
    out[1] = xd[EV] + c * dx - s * dy
    out[2] = xd[EV + 1] + s * dx + c * dy
    out[3] = wrap(xd[EV + 2] + odometry[3] - xd[LO + 2])


class PositionEstimator(Block):
    """Estimates the pose every tick from a fix every 95 ms.

    .. pydrake_system::

        name: PositionEstimator
        input_ports:
        - odometry
        - fix
        output_ports:
        - pose

    odometry (4,): tick, x, y [m], phi [rad]. fix (5,): tick of capture, seen, x, y [m], phi [rad]; ignored unless seen.
    pose (4,): tick, x, y [m], phi [rad] in [-pi, pi). Equation (6.6), corrected.

    Args:
        oldest_fix_ticks: the greatest age of a fix on arrival; an older one is ignored.
        as_printed: leave the rotation away.
    """

    def __init__(self, oldest_fix_ticks: int = 0, as_printed: bool = False):
        ring = np.zeros(4 * (oldest_fix_ticks + 1))
        ring[::4] = -1.0
        start = np.concatenate([[-1.0, -1.0], np.zeros(6), ring])
        super().__init__(Spec(
            inputs={"odometry": 4, "fix": FIX}, outputs={"pose": Output(4, estimate)},
            parameters={"rotate": 0.0 if as_printed else 1.0},
            discrete_state=start, updates=(Update(step, Phase.COMPUTE, through=True),),
        ))
