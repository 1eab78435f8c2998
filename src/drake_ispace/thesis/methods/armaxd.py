"""ARMAXD, Figs. 3.5 and 3.7, section 3.2.3.3: a separator filter splits the output error.

    o(t) = Y(t) - Theta_AB'[x, u],   low = L(q) o,   d = o - low,   Theta += K (low - C'd)

The high-pass part d joins the regressor as the sensor's disturbance, (3.18), the low-pass part drives the estimate
(docs/fidelity.md: (3.17) and (3.19) use e and d for several things, the figures decide). L is a Butterworth low-pass.

Why it helps: least squares settles where the error no longer correlates with the noisy regressor. What the filter takes
from the error at the noise's frequency cannot correlate with it, so the bias shrinks by about |Re L| there. Where the
noise lies below the cut-off L passes it and nothing is gained; noise of any other frequency is biased as before.
"""

import numpy as np
from scipy.signal import butter

from drake_ispace.blocks.errors import InputError
from drake_ispace.blocks.kernels import kernel
from drake_ispace.control.adaptive.rwls import update
from drake_ispace.thesis.methods.estimate import Estimate
from drake_ispace.thesis.structures import Problem

_FORGETTING, _INITIAL_VARIANCE, _TRACE_LIMIT = 1.0, 1e4, 1e12  # of the recursion


@kernel
def _section(sos, index, memory, value):
    """One second-order section, transposed direct form II; memory (2,)."""
    y = sos[index, 0] * value + memory[0]
    memory[0] = sos[index, 1] * value - sos[index, 4] * y + memory[1]
    memory[1] = sos[index, 2] * value - sos[index, 5] * y
    return y


@kernel(nogil=True)
def _run(regressor, target, sos, forgetting, trace_limit, theta, root, every, history, residual, disturbance):
    n, m = regressor.shape[1], target.shape[1]
    sections, size = sos.shape[0], n + m
    memory = np.zeros((m, sections, 2))
    phi, innovation, scratch = np.zeros(size), np.empty(m), np.empty(size)
    low = np.empty(m)
    for k in range(regressor.shape[0]):
        phi[:n] = regressor[k]
        for j in range(m):
            error = target[k, j]
            for i in range(n):
                error -= phi[i] * theta[i * m + j]
            value = error
            for s in range(sections):
                value = _section(sos, s, memory[j, s], value)
            low[j] = value
            disturbance[k, j] = error - value
            phi[n + j] = error - value
        for j in range(m):
            innovation[j] = low[j]
            for i in range(m):
                innovation[j] -= phi[n + i] * theta[(n + i) * m + j]
            residual[k, j] = innovation[j]
        update(phi, innovation, forgetting, trace_limit, theta, root, scratch)
        if k % every == 0:
            history[k // every] = theta


def armaxd(problem: Problem, cut_off_hz: float = 740.0, order: int = 2, every: int = 1) -> Estimate:
    """Recursive least squares behind the separator.

    Args:
        problem: its rate must exceed twice the cut-off.
        cut_off_hz: 740 in section 3.4.1; order: of the Butterworth separator, not given in print.

    Raises:
        InputError: a cut-off at or above half the rate: the separator would pass everything.
    """
    if not 0.0 < cut_off_hz < problem.rate_hz / 2.0:
        raise InputError(
            f"a cut-off of {cut_off_hz:g} Hz needs more than {2 * cut_off_hz:g} samples a second, the data have "
            f"{problem.rate_hz:g}; expected a cut-off below {problem.rate_hz / 2:g} Hz"
        )
    scale, spread = problem.scale, np.maximum(problem.target.std(axis=0), 1e-12)
    n, m = problem.regressor.shape[1], problem.target.shape[1]
    size = n + m
    theta, root = np.zeros(size * m), np.sqrt(_INITIAL_VARIANCE) * np.eye(size).ravel()
    history = np.empty((-(-len(problem.target) // every), size * m))
    residual, disturbance = np.empty((len(problem.target), m)), np.empty((len(problem.target), m))
    sos = butter(order, cut_off_hz, fs=problem.rate_hz, output="sos")
    _run(
        np.ascontiguousarray(problem.regressor / scale), np.ascontiguousarray(problem.target / spread), sos,
        _FORGETTING, _TRACE_LIMIT, theta, root, every, history, residual, disturbance,
    )
    units = np.concatenate([scale, spread])[:, None]
    p = np.diag(root.reshape(size, size) @ root.reshape(size, size).T)
    half = len(residual) // 2
    std = np.sqrt(np.outer(p, residual[half:].var(axis=0))) * spread / units
    names = (*problem.names, *(f"d_{o}" for o in problem.outputs))
    return Estimate(
        "armaxd", names, problem.outputs, theta.reshape(size, m) * spread / units, std, residual * spread,
        problem.regressor, history.reshape(-1, size, m) * spread / units,
    )
