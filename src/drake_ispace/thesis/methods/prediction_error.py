"""Prediction error by simulation error: the compiled Diagram, its unknown parameters fitted to what was measured.

The whole loop is simulated from its reference, without the noise of its sensors, so nothing measured enters the model
and the loop's noise cannot bias it. It is the one method here that needs neither accelerations nor a linear model, and
the one that needs the Diagram.
"""

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from scipy.optimize import least_squares

from drake_ispace.rollout.compile import Rollout
from drake_ispace.thesis.methods.arx import least_squares_std
from drake_ispace.thesis.methods.estimate import Estimate

_NOISE = ("noise_std", "amplitude", "white_share")


def silence(rollout: Rollout, parameters: np.ndarray | None = None) -> np.ndarray:
    """The parameters with every noise of sensors and actuators at zero."""
    values = np.array(rollout.parameters if parameters is None else parameters, dtype=float)
    for i, name in enumerate(rollout.parameter_names):
        if name.partition(".")[2].startswith(_NOISE):
            values[i] = 0.0
    return values


def prediction_error(
    simulate: Callable[[np.ndarray], np.ndarray], start: Mapping[str, float], measured: np.ndarray,
    weights: Sequence[float], positive: bool = False, step: float = 1e-4,
) -> Estimate:
    """Gauss-Newton on the difference between simulated and measured outputs.

    Args:
        simulate: coefficients (n,) -> outputs (N, m), rollouts without noise.
        start: name of a coefficient -> first guess.
        measured: (N, m); weights: (m,) 1 / standard deviation of each output.
        positive: the coefficients cannot be negative (friction).
        step: relative step of the differences; encoder counts make outputs a staircase, a step must span many.

    Returns:
        theta (n, 1): the coefficients; the residual is weighted. The spread takes it as white, which the loop's own
        noise is not: it is a lower bound.
    """
    x0, weights = np.array(list(start.values()), dtype=float), np.asarray(weights)
    unit = np.maximum(np.abs(x0), 1e-3)

    def residual(x):
        gap = (simulate(x * unit) - measured) * weights
        return np.clip(np.nan_to_num(gap, nan=1e4), -1e4, 1e4).ravel()

    bounds = (0.0, np.inf) if positive else (-np.inf, np.inf)
    found = least_squares(residual, x0 / unit, diff_step=step, bounds=bounds, xtol=1e-8, ftol=1e-8, max_nfev=40)
    std = least_squares_std(found.jac, found.fun[:, None]) * unit[:, None]
    return Estimate(
        "pem", tuple(start), ("value",), (found.x * unit)[:, None], std, -found.fun.reshape(measured.shape), found.jac,
        notes=() if found.success else ("the search did not converge",),
    )
