"""Instrumental variables for closed-loop data: the reference moves the regressors and knows nothing of the noise.

Two-stage least squares: the regressors are projected on a bank of low-passes of the reference, and Y is regressed on
the projection. Refined: the loop is simulated without noise at the first estimate, and those noise-free regressors are
the instruments, Theta = (Z'Phi)^-1 Z'Y; repeated until it stays.
"""

from collections.abc import Callable

import numpy as np
from scipy.signal import lfilter

from drake_ispace.blocks.errors import InputError
from drake_ispace.thesis.methods.estimate import Estimate
from drake_ispace.thesis.structures import Problem

_TIMES_S = (0.02, 0.04, 0.08, 0.15, 0.3, 0.6, 1.2, 2.5)
_ROUNDS = 3  # of refinement
_LONGEST_S = 0.1  # over which residuals may be correlated


def reference_instruments(reference: np.ndarray, rate_hz: float, times_s=_TIMES_S) -> np.ndarray:
    """(N, 1 + 2 k): 1, and the reference through low-passes of one and of two of each time constant."""
    columns = [np.ones(len(reference))]
    for time_s in times_s:
        keep = np.exp(-1.0 / (rate_hz * time_s))
        once = lfilter([1.0 - keep], [1.0, -keep], reference)
        columns += [reference - once, once - lfilter([1.0 - keep], [1.0, -keep], once)]
    return np.column_stack(columns)


def instrumental(
    problem: Problem, simulate: Callable[[np.ndarray], np.ndarray] | None = None, spread: bool = True,
) -> Estimate:
    """Two-stage least squares, refined where a simulation is at hand.

    Args:
        problem: with a reference.
        simulate: theta (n, m) -> noise-free regressors (N, n) of the same loop.
        spread: compute the standard deviations, which takes longest.

    Raises:
        InputError: no reference, or one that does not move.
    """
    if problem.reference is None or np.ptp(problem.reference) == 0.0:
        raise InputError(
            "instrumental variables need a reference that moves: expected the channel reference in the run"
        )
    instruments = reference_instruments(problem.reference, problem.rate_hz)
    scale = problem.scale
    phi = problem.regressor / scale
    q, r = np.linalg.qr(instruments / np.maximum(np.sqrt(np.mean(instruments**2, axis=0)), 1e-300))
    q = q[:, np.abs(np.diag(r)) > 1e-9 * np.abs(np.diag(r)).max()]
    projected = q @ (q.T @ phi)
    theta = np.linalg.lstsq(projected, problem.target, rcond=None)[0]
    notes = _weak(phi, projected, problem.names)
    if simulate is not None:
        for _ in range(_ROUNDS):
            projected = simulate(theta / scale[:, None]) / scale
            theta = np.linalg.lstsq(projected.T @ phi, projected.T @ problem.target, rcond=None)[0]
    residual = problem.target - phi @ theta
    std = _std(projected, phi, residual, problem.rate_hz) if spread else np.full_like(theta, np.nan)
    return Estimate(
        "iv", problem.names, problem.outputs, theta / scale[:, None], std / scale[:, None], residual, problem.regressor,
        notes=notes,
    )


def _weak(phi, projected, names):
    """The reference explains too little of these regressors for their coefficients to mean much."""
    share = (projected**2).sum(axis=0) / np.maximum((phi**2).sum(axis=0), 1e-300)
    return tuple(f"weak instrument: the reference explains {100 * s:.1f} % of {n}"
                 for n, s in zip(names, share, strict=True) if s < 0.02)


def _std(z, phi, residual, rate_hz):
    """(n, m), for residuals that are not white: Newey and West's sum over lags up to 0.1 s, at most 200 samples."""
    inverse = np.linalg.pinv(z.T @ phi)
    lags = min(int(_LONGEST_S * rate_hz), 200, len(z) - 1)
    std = np.empty((phi.shape[1], residual.shape[1]))
    for j in range(residual.shape[1]):
        moment = z * residual[:, j : j + 1]
        meat = moment.T @ moment
        for lag in range(1, lags + 1):
            cross = moment[lag:].T @ moment[:-lag]
            meat += (1.0 - lag / (lags + 1)) * (cross + cross.T)
        std[:, j] = np.sqrt(np.clip(np.diag(inverse @ meat @ inverse.T), 0.0, None))
    return std
