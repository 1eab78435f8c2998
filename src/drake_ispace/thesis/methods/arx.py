"""ARX: the noise is the equation's error, (3.12); least squares in one batch or recursively, (3.20)-(3.26)."""

import numpy as np

from drake_ispace.control.adaptive.rwls import recursive_least_squares
from drake_ispace.thesis.methods.estimate import Estimate
from drake_ispace.thesis.structures import Problem


def arx(problem: Problem) -> Estimate:
    """Least squares over the whole record. Biased where the regressors carry noise that the target does not share, and
    in closed loop, where the noise comes back in the input."""
    scale = problem.scale
    phi = problem.regressor / scale
    theta, _, rank, _ = np.linalg.lstsq(phi, problem.target, rcond=None)
    residual = problem.target - phi @ theta
    std = least_squares_std(phi, residual) / scale[:, None]
    notes = () if rank == phi.shape[1] else (f"only {rank} of {phi.shape[1]} regressors are independent",)
    return Estimate(
        "arx", problem.names, problem.outputs, theta / scale[:, None], std, residual, problem.regressor, notes=notes
    )


def recursive_arx(problem: Problem, every: int = 1) -> Estimate:
    """The same, sample by sample; `history` holds one of `every` samples."""
    theta, p, history = recursive_least_squares(problem.regressor, problem.target, every=every, scale=problem.scale)
    residual = problem.target - problem.regressor @ theta
    std = np.sqrt(np.outer(np.diag(p), residual.var(axis=0)))
    return Estimate("arx", problem.names, problem.outputs, theta, std, residual, problem.regressor, history)


def least_squares_std(phi: np.ndarray, residual: np.ndarray) -> np.ndarray:
    """(n, m) standard deviations for white residuals (N, m) on regressors (N, n)."""
    variance = (residual**2).sum(axis=0) / max(len(phi) - phi.shape[1], 1)
    inverse = np.linalg.pinv(phi.T @ phi)
    return np.sqrt(np.outer(np.clip(np.diag(inverse), 0.0, None), variance))
