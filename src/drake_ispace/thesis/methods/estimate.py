"""The result of every method."""

from dataclasses import dataclass

import numpy as np
from scipy.stats import norm


@dataclass(frozen=True)
class Estimate:
    """Coefficients with their spread.

    Attributes:
        method: its name.
        names: of the coefficients' rows (n,); outputs: of the columns (m,).
        theta: (n, m); std: (n, m) standard deviation, by the method's own assumptions on the noise.
        residual: (N, m) what the model leaves; regressor: (N, n) what it should not correlate with.
        history: (k, n, m) theta over time, None for a batch method.
        notes: what the user should know.
    """

    method: str
    names: tuple[str, ...]
    outputs: tuple[str, ...]
    theta: np.ndarray
    std: np.ndarray
    residual: np.ndarray
    regressor: np.ndarray
    history: np.ndarray | None = None
    notes: tuple[str, ...] = ()

    def interval(self, level: float = 0.95) -> tuple[np.ndarray, np.ndarray]:
        """Lower and upper bounds (n, m) of the coefficients."""
        half = norm.ppf(0.5 + level / 2.0) * self.std
        return self.theta - half, self.theta + half
