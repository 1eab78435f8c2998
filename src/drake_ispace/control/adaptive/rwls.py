"""Recursive weighted least squares with forgetting, (3.20)-(3.26) corrected, in square-root form.

In print, (3.24) has lambda on the wrong term and (3.26) lacks the innovation (docs/fidelity.md). With the regressor
phi (n), the parameters Theta (n, m), P (n, n) and the innovation e = Y - Theta'phi (m):

    K = P phi / (lambda + phi'P phi),   Theta += K e',   P = (P - K phi'P) / lambda.

In floating point P loses symmetry and definiteness. The recursion therefore runs on S with P = S S' (Potter's update):

    f = S'phi,  alpha = lambda + f'f,  S = (S - S f f' / (alpha (1 + sqrt(lambda / alpha)))) / sqrt(lambda).

Without excitation P grows as lambda^-k (wind-up). Two guards prevent this: nothing is forgotten for a sample with
little excitation, f'f <= (1 - lambda) / 100, and the trace of P is bounded.
"""

import numpy as np

from drake_ispace.blocks.kernels import kernel


@kernel
def update(phi, innovation, forgetting, trace_limit, theta, root, scratch):
    """Update Theta and S in place with one sample.

    Args:
        phi: regressor (n,).
        innovation: (m,) Y - Theta'phi, or the part of the innovation that drives the estimate.
        forgetting: lambda in (0, 1].
        trace_limit: largest trace of P.
        theta: Theta (n m), row by row.
        root: S (n n), row by row.
        scratch: working memory (n,).
    """
    n, m = phi.shape[0], innovation.shape[0]
    energy = 0.0
    for j in range(n):
        total = 0.0
        for i in range(n):
            total += root[i * n + j] * phi[i]
        scratch[j] = total
        energy += total * total
    lam = forgetting if energy > 0.01 * (1.0 - forgetting) else 1.0
    alpha = lam + energy
    shrink = 1.0 / (alpha * (1.0 + np.sqrt(lam / alpha)))
    grow = 1.0 / np.sqrt(lam)
    trace = 0.0
    for i in range(n):
        gain = 0.0
        for j in range(n):
            gain += root[i * n + j] * scratch[j]
        for j in range(m):
            theta[i * m + j] += gain / alpha * innovation[j]
        for j in range(n):
            value = (root[i * n + j] - shrink * gain * scratch[j]) * grow
            root[i * n + j] = value
            trace += value * value
    if trace > trace_limit:
        factor = np.sqrt(trace_limit / trace)
        for i in range(n * n):
            root[i] *= factor


@kernel(nogil=True)
def _run(regressor, target, forgetting, trace_limit, theta, root, every, history):
    n, m = regressor.shape[1], target.shape[1]
    scratch, innovation = np.empty(n), np.empty(m)
    for k in range(regressor.shape[0]):
        for j in range(m):
            predicted = 0.0
            for i in range(n):
                predicted += regressor[k, i] * theta[i * m + j]
            innovation[j] = target[k, j] - predicted
        update(regressor[k], innovation, forgetting, trace_limit, theta, root, scratch)
        if k % every == 0:
            history[k // every] = theta


def recursive_least_squares(
    regressor: np.ndarray, target: np.ndarray, forgetting: float = 1.0, initial_variance: float = 1e6,
    trace_limit: float = 1e12, every: int = 1, scale: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Identify Theta of Y = Theta'phi by recursive least squares over a record of N samples.

    Args:
        regressor: phi of each sample (N, n).
        target: Y of each sample (N, m).
        forgetting: lambda in (0, 1].
        initial_variance: P(0) = initial_variance times the identity, for the scaled regressors.
        trace_limit: largest trace of P, for the scaled regressors.
        every: the history keeps one of this many samples.
        scale: (n,) typical size of each regressor, by which the regressors are divided for the recursion; default ones.

    Returns:
        The final Theta (n, m) and P (n, n), and the history of Theta (ceil(N / every), n, m), all for the regressors as
        given.
    """
    scale = np.ones(regressor.shape[1]) if scale is None else scale
    rows, target = np.ascontiguousarray(regressor / scale, dtype=float), np.ascontiguousarray(target, dtype=float)
    n, m = rows.shape[1], target.shape[1]
    theta, root = np.zeros(n * m), np.sqrt(initial_variance) * np.eye(n).ravel()
    history = np.empty((-(-len(rows) // every), n * m))
    _run(rows, target, forgetting, trace_limit, theta, root, every, history)
    root = root.reshape(n, n) / scale[:, None]
    return theta.reshape(n, m) / scale[:, None], root @ root.T, history.reshape(-1, n, m) / scale[None, :, None]
