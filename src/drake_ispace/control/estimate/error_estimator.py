"""Position-error estimator (6.32)-(6.33): the room's tracking error, carried on by odometry."""

import numpy as np

from drake_ispace.blocks.block import Block, Output, Phase, Spec, Update
from drake_ispace.blocks.kernels import copy, kernel
from drake_ispace.blocks.messages import TRACKING_ERROR

TICK, ORDER, FIXED, RING = 0, 1, 6, 8  # x_d; ORDER: last message (5), FIXED: P_r,l[i], RING: past (tick, s, phi)


@kernel
def step(xd, path, error, out):
    """Remember this tick's path and, for a new error, P_r,l[i]: the path in the tick its fix was captured in.

    While the robot is not seen, the way point moves on and the fix stays: such an error finds P_r,l[i] still there.
    A stamp that is yet to come, from a clock that is ahead, is taken as that of now.
    """
    copy(xd, out)
    depth = (xd.shape[0] - RING) // 3
    if path[0] != xd[TICK]:
        slot = RING + 3 * (int(path[0]) % depth)
        copy(path, out[slot : slot + 3])
        out[TICK] = path[0]
        if xd[TICK] < 0.0:
            out[FIXED], out[FIXED + 1] = path[1], path[2]
    is_new = error[0] != xd[ORDER] or error[1] != xd[ORDER + 1]
    if is_new and error[0] >= 0.0:
        captured = min(error[0], path[0])
        slot = RING + 3 * (int(captured) % depth)
        is_known = xd[ORDER] == error[0]
        is_kept = captured >= 0.0 and out[slot] == captured
        if is_kept and not is_known:
            out[FIXED], out[FIXED + 1] = out[slot + 1], out[slot + 2]
        if is_kept or is_known:
            copy(error, out[ORDER : ORDER + 5])


@kernel
def estimated(xd, path, out):
    """P_d,V[i] - P_r,h[k] with P_d,V[i] = P_e[i] + P_r,l[i]."""
    out[0] = xd[ORDER + 2] + xd[FIXED] - path[1]
    out[1] = xd[ORDER + 3] + xd[FIXED + 1] - path[2]
    out[2] = xd[ORDER + 4]


@kernel
def held(error, out):
    out[0], out[1], out[2] = error[2], error[3], error[4]


class ErrorEstimator(Block):
    """The error to the way point at every tick.

    .. pydrake_system::

        name: ErrorEstimator
        input_ports:
        - path
        - error
        output_ports:
        - error

    path (3,): tick, s [m], phi [rad] of odometry. Input error (5,): see TrajectoryTracker. Output error (3,): s_e [m],
    phi_h [rad], speed to feed forward [m/s]. P_e,es of (6.32).

    Args:
        oldest_fix_ticks: the greatest age of a fix on its first arrival; an error from an older one is ignored.
    """

    def __init__(self, oldest_fix_ticks: int = 0):
        ring = np.zeros(3 * (oldest_fix_ticks + 1))
        ring[::3] = -1.0
        start = np.concatenate([[-1.0], [-1.0, -1.0, 0.0, 0.0, 0.0], np.zeros(2), ring])
        super().__init__(Spec(
            inputs={"path": 3, "error": TRACKING_ERROR}, outputs={"error": Output(3, estimated)},
            discrete_state=start, updates=(Update(step, Phase.COMPUTE, through=True),),
        ))


class HeldError(Block):
    """The room's tracking error as it came, held for 95 ms: position from vision only.

    .. pydrake_system::

        name: HeldError
        input_ports:
        - error
        output_ports:
        - error

    Ports as ErrorEstimator's, without odometry.
    """

    def __init__(self):
        super().__init__(Spec(inputs={"error": TRACKING_ERROR}, outputs={"error": Output(3, held)}))
