"""Friction coefficients from identified matrices, (4.8)-(4.9).

B^ is 2 x 1 and has no inverse; C_cu = B^+ (B C_cu)^ is its least-squares solution. Where B^ is badly known
or badly conditioned the quotient means nothing, and that is said.
"""

from dataclasses import dataclass

import numpy as np

from drake_ispace.thesis.methods.estimate import Estimate

_MARGIN = 0.2  # by which a coefficient may exceed the friction found, beyond three standard deviations


@dataclass(frozen=True)
class FrictionCoefficients:
    """(3.35)'s coefficients.

    Attributes:
        coulomb_n_m, viscous_n_m_s: C_cu [N m] and C_v [N m s/rad].
        coulomb_std, viscous_std: first order, from the estimate's own spread, coefficients taken as independent.
        condition: largest singular value of B^ over the smallest.
        relative_error_of_b: standard deviation of B^ over its size; above 0.3 the quotient means little.
    """

    coulomb_n_m: float
    viscous_n_m_s: float
    coulomb_std: float
    viscous_std: float
    condition: float
    relative_error_of_b: float

    @property
    def trustworthy(self) -> bool:
        """Well conditioned and B^ known to 30 %."""
        return self.condition < 1e3 and self.relative_error_of_b < 0.3


def friction_coefficients(estimate: Estimate) -> FrictionCoefficients:
    """From rows sgn, omega and tau of Table 4.1's regression; rows of Y are weighted by how well B is known in each."""
    index = {name: estimate.names.index(name) for name in ("sgn", "omega", "tau")}
    weight = 1.0 / np.maximum(estimate.std[index["tau"]], 1e-12 * np.abs(estimate.theta).max() + 1e-300)
    b = (estimate.theta[index["tau"]] * weight)[:, None]
    size = float(np.linalg.norm(b))
    values, spreads = [], []
    for name in ("sgn", "omega"):
        row, std = estimate.theta[index[name]] * weight, estimate.std[index[name]] * weight
        value = -float((np.linalg.pinv(b) @ row)[0])
        spread = np.sqrt((b[:, 0] ** 2 @ std**2) / size**4 + value**2 * (b[:, 0] ** 2 @ np.ones(len(b))) / size**4)
        values.append(value)
        spreads.append(float(spread))
    return FrictionCoefficients(*values, *spreads, float(np.linalg.cond(b)), float(np.sqrt(len(b)) / size))


def over_compensated(found: FrictionCoefficients, coulomb_n_m: float, viscous_n_m_s: float) -> dict:
    """Whether a compensation adds more than the friction found from the run's total torque.

    A compensation above the friction pushes the wheel on: what is left of the friction is negative.

    Args:
        found: coefficients identified from a run, with or without compensation; coulomb_n_m, viscous_n_m_s: those used.

    Returns:
        {"coulomb_ratio", "viscous_ratio": used / found, "over": either is too much, "certain": found is trustworthy}.
    """
    pairs = (
        (coulomb_n_m, found.coulomb_n_m, found.coulomb_std),
        (viscous_n_m_s, found.viscous_n_m_s, found.viscous_std),
    )
    ratios = [used / value if value > 0.0 else float("inf") for used, value, _ in pairs]
    over = [used > (1.0 + _MARGIN) * max(value, 0.0) + 3.0 * std for used, value, std in pairs]
    return {"coulomb_ratio": ratios[0], "viscous_ratio": ratios[1], "over": any(over), "certain": found.trustworthy}
