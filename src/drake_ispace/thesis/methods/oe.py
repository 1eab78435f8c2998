"""OE: the noise is the output's own, y = B(q)/F(q) u + e; the model is simulated from the inputs alone."""

import numpy as np
from scipy.optimize import least_squares
from scipy.signal import lfilter

from drake_ispace.thesis.methods.arx import arx, least_squares_std
from drake_ispace.thesis.methods.estimate import Estimate
from drake_ispace.thesis.structures import time_series


def simulate_oe(u: np.ndarray, b: np.ndarray, f: np.ndarray, delay: int = 1) -> np.ndarray:
    """(N,) output of B(q) q^-delay / (1 + f_1 q^-1 + ...) for inputs u (N, l); b (l, nb), f (nf,)."""
    denominator = np.concatenate([[1.0], f])
    return sum(lfilter(np.concatenate([np.zeros(delay), row]), denominator, u[:, i]) for i, row in enumerate(b))


def oe(y: np.ndarray, u: np.ndarray, nf: int, nb: int, delay: int = 1) -> Estimate:
    """Output-error estimate by Gauss-Newton on the simulated output, from ARX's estimate, stable or mirrored.

    Args:
        y: (N,) one output; u: (N, l) inputs; nf, nb: numbers of coefficients; delay: of the first input, in samples.
    """
    y, u = np.ravel(y).astype(float), np.asarray(u, dtype=float).reshape(len(y), -1)
    first = arx(time_series(y, u, nf, nb, delay))
    l = u.shape[1]
    roots = np.roots(np.concatenate([[1.0], first.theta[:nf, 0]]))
    roots = np.where(np.abs(roots) > 1.0, 1.0 / np.conj(roots), roots)
    start = np.concatenate([np.real(np.poly(roots))[1:], first.theta[nf:, 0]])

    def residual(x):
        with np.errstate(all="ignore"):
            gap = simulate_oe(u, x[nf:].reshape(nb, l).T, x[:nf], delay) - y
        return np.clip(np.nan_to_num(gap, nan=1e6), -1e6, 1e6)

    found = least_squares(residual, start, x_scale="jac", method="trf")
    left = -found.fun[:, None]
    return Estimate(
        "oe", first.names, first.outputs, found.x[:, None], least_squares_std(found.jac, left), left,
        found.jac, notes=() if found.success else ("the search did not converge",),
    )
