"""Conventional multi-rate feedback without estimator, section 6.7.2.

The thesis lacks the figure and the reference. The words "the robot position from both sources are directly used" are
read as follows: the pose is P_ev in the ticks in which a fix arrives, and raw P_lo in all other ticks.
"""

import numpy as np

from drake_ispace.blocks.block import Block, Output, Phase, Spec, Update
from drake_ispace.blocks.kernels import copy, kernel
from drake_ispace.blocks.messages import ESTIMATE, FIX

TICK, SEEN_TICK, USED = 0, 1, 2  # x_d: ticks of the last odometry and of the last fix, the pose in use


@kernel
def step(xd, odometry, fix, out):
    """Store odometry's pose, or the room's if a new fix has arrived; a known odometry tick changes nothing."""
    copy(xd, out)
    if odometry[ESTIMATE.tick] == xd[TICK]:
        return
    out[TICK] = odometry[ESTIMATE.tick]
    copy(odometry[ESTIMATE.x :], out[USED:])
    if fix[FIX.seen] > 0.0 and fix[FIX.tick] > xd[SEEN_TICK]:
        out[SEEN_TICK] = fix[FIX.tick]
        copy(fix[FIX.x :], out[USED:])


@kernel
def used(xd, out):
    out[ESTIMATE.tick] = xd[TICK]
    copy(xd[USED:], out[ESTIMATE.x :])


class ConventionalMerge(Block):
    """Passes on the room's pose in the ticks in which a fix arrives, and odometry's pose otherwise.

    .. pydrake_system::

        name: ConventionalMerge
        input_ports:
        - odometry
        - fix
        output_ports:
        - pose

    odometry (4,): tick, x, y [m], phi [rad] in W. fix (5,): tick of capture, seen, x, y [m], phi [rad] in W; ignored
    unless seen. pose (4,): tick, x, y [m], phi [rad] in W. Section 6.7.2.
    """

    def __init__(self):
        super().__init__(Spec(
            inputs={"odometry": len(ESTIMATE), "fix": len(FIX)}, outputs={"pose": Output(len(ESTIMATE), used)},
            discrete_state=np.array([-1.0, -1.0, 0.0, 0.0, 0.0]),
            updates=(Update(step, Phase.COMPUTE, through=True),),
        ))
