"""Position-error estimator, (6.32)-(6.33): the room's tracking error, updated between fixes by odometry."""

import numpy as np

from drake_ispace.blocks.block import Block, Output, Phase, Spec, Update
from drake_ispace.blocks.kernels import copy, kernel
from drake_ispace.blocks.messages import ERROR, PATH, TRACKING_ERROR

TICK, ORDER = 0, 1  # x_d: tick of the last path; the last tracking error, then P_r,l[i], then the past paths
FIXED_S = ORDER + len(TRACKING_ERROR)
FIXED_PHI, RING = FIXED_S + 1, FIXED_S + 2


@kernel
def step(xd, path, error, out):
    """Store this tick's path and, for a new tracking error, P_r,l[i]: the path at the tick of capture of its fix.

    While the robot is not seen, the way point moves on but the fix stays the same. For such an error the stored
    P_r,l[i] remains valid. If the tick of the fix lies in the future, because the room's clock is ahead of the robot's,
    the present tick takes its place.
    """
    copy(xd, out)
    depth = (xd.shape[0] - RING) // len(PATH)
    now, fix_tick, way_point_tick = path[PATH.tick], error[TRACKING_ERROR.tick], error[TRACKING_ERROR.way_point_tick]
    if now != xd[TICK]:
        slot = RING + len(PATH) * (int(now) % depth)
        copy(path, out[slot : slot + len(PATH)])
        out[TICK] = now
        if xd[TICK] < 0.0:
            out[FIXED_S], out[FIXED_PHI] = path[PATH.s], path[PATH.phi]
    is_known = fix_tick == xd[ORDER + TRACKING_ERROR.tick]
    is_new = not is_known or way_point_tick != xd[ORDER + TRACKING_ERROR.way_point_tick]
    if is_new and fix_tick >= 0.0:
        captured = min(fix_tick, now)
        slot = RING + len(PATH) * (int(captured) % depth)
        is_kept = captured >= 0.0 and out[slot + PATH.tick] == captured
        if is_kept and not is_known:
            out[FIXED_S], out[FIXED_PHI] = out[slot + PATH.s], out[slot + PATH.phi]
        if is_kept or is_known:
            copy(error, out[ORDER : ORDER + len(TRACKING_ERROR)])


@kernel
def estimated(xd, path, out):
    """Write P_d,V[i] - P_r,h[k] with P_d,V[i] = P_e[i] + P_r,l[i], the estimated tracking error at tick k."""
    out[ERROR.s_e] = xd[ORDER + TRACKING_ERROR.s_e] + xd[FIXED_S] - path[PATH.s]
    out[ERROR.phi_h] = xd[ORDER + TRACKING_ERROR.phi_h] + xd[FIXED_PHI] - path[PATH.phi]
    out[ERROR.speed] = xd[ORDER + TRACKING_ERROR.speed]


@kernel
def held(error, out):
    """Write s_e, phi_h and speed of the measured tracking error."""
    out[ERROR.s_e], out[ERROR.phi_h] = error[TRACKING_ERROR.s_e], error[TRACKING_ERROR.phi_h]
    out[ERROR.speed] = error[TRACKING_ERROR.speed]


class ErrorEstimator(Block):
    """Estimates the tracking error at every tick from a measured one every 95 ms and odometry.

    .. pydrake_system::

        name: ErrorEstimator
        input_ports:
        - path
        - error
        output_ports:
        - error

    path (3,): tick, s [m], phi [rad] of odometry. Input error (5,): tick of capture of the fix, tick of the way point,
    s_e [m], phi_h [rad], speed to feed forward [m/s]. Output error (3,): s_e [m], phi_h [rad], speed to feed forward
    [m/s] at this tick, P_e,es of (6.32).

    Args:
        oldest_fix_ticks: largest age of a fix when it first arrives; a tracking error from an older fix is ignored.
    """

    def __init__(self, oldest_fix_ticks: int = 0):
        start = np.zeros(RING + len(PATH) * (oldest_fix_ticks + 1))
        start[TICK] = start[ORDER + TRACKING_ERROR.tick] = start[ORDER + TRACKING_ERROR.way_point_tick] = -1.0
        start[RING + PATH.tick :: len(PATH)] = -1.0
        super().__init__(Spec(
            inputs={"path": len(PATH), "error": len(TRACKING_ERROR)}, outputs={"error": Output(len(ERROR), estimated)},
            discrete_state=start, updates=(Update(step, Phase.COMPUTE, through=True),),
        ))


class HeldError(Block):
    """Passes on the room's tracking error unchanged, so that the position comes from vision only, every 95 ms.

    .. pydrake_system::

        name: HeldError
        input_ports:
        - error
        output_ports:
        - error

    Input error (5,): tick of capture of the fix, tick of the way point, s_e [m], phi_h [rad], speed to feed forward
    [m/s]. Output error (3,): s_e [m], phi_h [rad], speed to feed forward [m/s].
    """

    def __init__(self):
        super().__init__(Spec(
            inputs={"error": len(TRACKING_ERROR)}, outputs={"error": Output(len(ERROR), held)},
        ))
