"""Outputs of a plant whose state is the angle [rad] and the speed [rad/s] of one wheel."""

from drake_ispace.blocks.kernels import kernel


@kernel
def angle(xc, out):
    out[0] = xc[0]


@kernel
def rate(xc, out):
    out[0] = xc[1]
