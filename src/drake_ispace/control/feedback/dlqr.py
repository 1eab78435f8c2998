"""Discrete linear-quadratic design through python-control, on the plant block's own linearisation."""

import numpy as np
from scipy.linalg import expm


def zero_order_hold(a: np.ndarray, b: np.ndarray, period_s: float) -> tuple[np.ndarray, np.ndarray]:
    """(A_d, B_d) of dx/dt = A x + B u with u held over `period_s`; (6.17)-(6.19) and (6.34), exactly."""
    n, m = b.shape
    block = np.zeros((n + m, n + m))
    block[:n, :n], block[:n, n:] = a, b
    exponential = expm(block * period_s)
    return exponential[:n, :n], exponential[:n, n:]


def dlqr(a: np.ndarray, b: np.ndarray, q, r, period_s: float) -> np.ndarray:
    """The gain K (m, n) of u = -K x that minimises sum x'Qx + u'Ru; q, r: diagonals or matrices."""
    import control  # half of a second process's start-up, and needed by those alone who design

    a_d, b_d = zero_order_hold(a, b, period_s)
    q, r = (np.diag(w) if np.ndim(w) == 1 else np.asarray(w) for w in (q, r))
    gain, _, _ = control.dlqr(a_d, b_d, q, r)
    return np.asarray(gain)


def spectral_radius(a: np.ndarray, b: np.ndarray, gain: np.ndarray, period_s: float) -> float:
    """The spectral radius of A_d - B_d K; the loop is stable below 1."""
    a_d, b_d = zero_order_hold(a, b, period_s)
    return float(np.abs(np.linalg.eigvals(a_d - b_d @ gain)).max())
