"""Conventional multi-rate feedback without estimator, section 6.7.2.

The thesis's figure and reference are missing. Our reading of its words "the robot position from both sources are
directly used": P_ev in the ticks in which a fix arrives, raw P_lo in all others.
"""

import numpy as np

from drake_ispace.blocks.block import Block, Output, Phase, Spec, Update
from drake_ispace.blocks.kernels import copy, kernel
from drake_ispace.blocks.messages import FIX


@kernel
def step(xd, odometry, fix, out):
    """x_d = [tick, tick of the last fix, pose used (3)]."""
    copy(xd, out)
    if odometry[0] == xd[0]:
        return
    out[0] = odometry[0]
    copy(odometry[1:], out[2:])
    if fix[1] > 0.0 and fix[0] > xd[1]:
        out[1] = fix[0]
        copy(fix[2:], out[2:])


@kernel
def used(xd, out):
    out[0] = xd[0]
    copy(xd[2:], out[1:])


class ConventionalMerge(Block):
    """The room's pose when it arrives, odometry's otherwise.

    .. pydrake_system::

        name: ConventionalMerge
        input_ports:
        - odometry
        - fix
        output_ports:
        - pose

    Ports as PositionEstimator: odometry (4,), fix (5,), pose (4,).
    """

    def __init__(self):
        super().__init__(Spec(
            inputs={"odometry": 4, "fix": FIX}, outputs={"pose": Output(4, used)},
            discrete_state=np.array([-1.0, -1.0, 0.0, 0.0, 0.0]),
            updates=(Update(step, Phase.COMPUTE, through=True),),
        ))
