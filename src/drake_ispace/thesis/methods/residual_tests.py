"""Does a model leave only noise? Whiteness of the residual and its independence of the regressors."""

from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from drake_ispace.thesis.methods.estimate import Estimate

_LAGS = 20


@dataclass(frozen=True)
class ResidualTest:
    """One output's residual.

    Attributes:
        output: its name; lags: of the sums.
        whiteness, whiteness_p: Ljung and Box's Q over `lags` and its p-value; small p: not white.
        cross_p: name of a regressor -> p-value of N * sum of squared cross-correlations over lags 0 .. `lags` (exact
            for white regressors; otherwise it errs on the side of refusing).
        white, independent: p >= 1 % (cross-correlations: with Bonferroni's correction).
    """

    output: str
    lags: int
    whiteness: float
    whiteness_p: float
    cross_p: dict[str, float]

    @property
    def white(self) -> bool:
        return self.whiteness_p >= 0.01

    @property
    def independent(self) -> bool:
        return min(self.cross_p.values()) >= 0.01 / len(self.cross_p)


def ljung_box(residual: np.ndarray, lags: int) -> tuple[float, float]:
    """Q = N (N + 2) sum_k r_k^2 / (N - k), k = 1 .. lags, and its chi-squared p-value, for a residual (N,)."""
    count = len(residual)
    correlation = _correlations(residual, residual, lags)[1:]
    q = float(count * (count + 2.0) * np.sum(correlation**2 / (count - np.arange(1, lags + 1))))
    return q, float(chi2.sf(q, lags))


def residual_tests(estimate: Estimate, skip: int = 0) -> list[ResidualTest]:
    """One per output; `skip`: samples at the beginning that are left out (a recursive method still converges)."""
    results = []
    for j, output in enumerate(estimate.outputs):
        residual = estimate.residual[skip:, j]
        cross = {}
        for i, name in enumerate(estimate.names[: estimate.regressor.shape[1]]):
            correlation = _correlations(residual, estimate.regressor[skip:, i], _LAGS)
            cross[name] = float(len(residual) * np.sum(correlation**2))
        p = {name: float(chi2.sf(value, _LAGS + 1)) for name, value in cross.items()}
        results.append(ResidualTest(output, _LAGS, *ljung_box(residual, _LAGS), p))
    return results


def _correlations(a, b, lags):
    """(lags + 1,) correlation of a(t) with b(t - k)."""
    a, b = a - a.mean(), b - b.mean()
    size = np.sqrt((a @ a) * (b @ b))
    if size == 0.0:
        return np.zeros(lags + 1)
    return np.array([a[k:] @ b[: len(b) - k] for k in range(lags + 1)]) / size
