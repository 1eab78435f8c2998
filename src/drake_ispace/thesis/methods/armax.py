"""ARMAX, (3.13): the equation's error is a moving average of a white one, estimated with the rest (extended least
squares): the last a-posteriori residuals join the regressor."""

import numpy as np

from drake_ispace.blocks.kernels import kernel
from drake_ispace.control.adaptive.rwls import update
from drake_ispace.thesis.methods.estimate import Estimate
from drake_ispace.thesis.structures import Problem

_FORGETTING, _INITIAL_VARIANCE, _TRACE_LIMIT = 1.0, 1e4, 1e12  # of the recursion


@kernel(nogil=True)
def _run(regressor, target, order, forgetting, trace_limit, theta, root, past, every, history, residual):
    n, m = regressor.shape[1], target.shape[1]
    size = n + order * m
    phi, innovation, scratch = np.zeros(size), np.empty(m), np.empty(size)
    for k in range(regressor.shape[0]):
        phi[:n] = regressor[k]
        phi[n:] = past
        for j in range(m):
            innovation[j] = target[k, j]
            for i in range(size):
                innovation[j] -= phi[i] * theta[i * m + j]
        update(phi, innovation, forgetting, trace_limit, theta, root, scratch)
        for i in range(order * m - 1, m - 1, -1):
            past[i] = past[i - m]
        for j in range(m):
            after = target[k, j]
            for i in range(size):
                after -= phi[i] * theta[i * m + j]
            past[j] = after
            residual[k, j] = innovation[j]
        if k % every == 0:
            history[k // every] = theta


def armax(problem: Problem, order: int = 1, every: int = 1) -> Estimate:
    """Recursive extended least squares with `order` past residuals of every output, coefficients C of (3.13)."""
    scale, spread = problem.scale, np.maximum(problem.target.std(axis=0), 1e-12)
    n, m = problem.regressor.shape[1], problem.target.shape[1]
    size = n + order * m
    theta, root = np.zeros(size * m), np.sqrt(_INITIAL_VARIANCE) * np.eye(size).ravel()
    history = np.empty((-(-len(problem.target) // every), size * m))
    residual = np.empty_like(problem.target, dtype=float)
    _run(
        np.ascontiguousarray(problem.regressor / scale), np.ascontiguousarray(problem.target / spread), order,
        _FORGETTING, _TRACE_LIMIT, theta, root, np.zeros(order * m), every, history, residual,
    )
    units = np.concatenate([scale, np.tile(spread, order)])[:, None]
    p = np.diag(root.reshape(size, size) @ root.reshape(size, size).T)
    half = len(residual) // 2  # the first half still converges
    theta = theta.reshape(size, m) * spread / units
    std = np.sqrt(np.outer(p, residual[half:].var(axis=0))) * spread / units
    names = (*problem.names, *(f"e_{o}(t-{lag})" for lag in range(1, order + 1) for o in problem.outputs))
    return Estimate(
        "armax", names, problem.outputs, theta, std, residual * spread, problem.regressor,
        history.reshape(-1, size, m) * spread / units,
    )
