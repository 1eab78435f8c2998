"""Discrete-time linear-quadratic design for continuous-time linear models."""

import numpy as np
from scipy.linalg import expm


def zero_order_hold(a: np.ndarray, b: np.ndarray, period_s: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the exact zero-order-hold discretisation (A_d (n, n), B_d (n, m)) of dx/dt = A x + B u.

    period_s: sampling period [s]. Equations (6.17)-(6.19), (6.34).
    """
    n, m = b.shape
    block = np.zeros((n + m, n + m))
    block[:n, :n], block[:n, n:] = a, b
    exponential = expm(block * period_s)
    return exponential[:n, :n], exponential[:n, n:]


def dlqr(a: np.ndarray, b: np.ndarray, q, r, period_s: float) -> np.ndarray:
    """Return the gain K (m, n) of u = -K x that minimises the sum of x'Q x + u'R u over the samples.

    a (n, n), b (n, m): continuous-time model; q, r: diagonals (n,), (m,) or matrices of the weights; period_s: sampling
    period [s].
    """
    import control  # imported here, because the import is slow and only a design needs it

    a_d, b_d = zero_order_hold(a, b, period_s)
    q, r = (np.diag(w) if np.ndim(w) == 1 else np.asarray(w) for w in (q, r))
    gain, _, _ = control.dlqr(a_d, b_d, q, r)
    return np.asarray(gain)


def spectral_radius(a: np.ndarray, b: np.ndarray, gain: np.ndarray, period_s: float) -> float:
    """Return the spectral radius of A_d - B_d K at the sampling period `period_s`; the loop is stable below 1."""
    a_d, b_d = zero_order_hold(a, b, period_s)
    return float(np.abs(np.linalg.eigvals(a_d - b_d @ gain)).max())
