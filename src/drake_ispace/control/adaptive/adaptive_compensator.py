"""Friction compensation whose coefficients adapt on line under a Lyapunov function, announced in section 4.1.

With the friction phi(w)'c, phi = [sgn w, w], c = [c_cu, c_v] of (3.35), the feedback tau_c = -K x and the compensation
phi'c^, the closed loop is dx/dt = A_c x + B Phi (c^ - c), A_c = A - B K stable, row i of Phi (2, 2) = phi(w_i)'.
Take P > 0 with A_c'P + P A_c = -Q, Q > 0, gains G > 0, and

    V = x'P x + (c^ - c)' G^-1 (c^ - c).

Then dV/dt = -x'Q x + 2 (c^ - c)'(Phi'B'P x + G^-1 dc^/dt), so that the law

    dc^/dt = -G Phi'B'P x

leaves dV/dt = -x'Q x <= 0: x and c^ stay bounded and x goes to zero (Barbalat), whatever the friction coefficients are.
c^ goes to c only under excitation. Bounds 0 <= c^ <= limit are a projection and keep dV/dt <= 0 while c lies inside.

What this leaves out, and what stands in for it: the sign of a slow wheel is not known from counts, so phi is zero
inside a dead band; the error from noise and 5 ms steps does not vanish, so nothing adapts while x'P x is below a
threshold (else the coefficients drift). Inside both, V may grow by the bounded amount that the neglected terms bring.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_continuous_lyapunov

from drake_ispace.blocks.block import Block, Output, Phase, Spec, Update
from drake_ispace.blocks.kernels import copy, kernel
from drake_ispace.blocks.rates import TICK_S
from drake_ispace.files.quantity import quantity


@dataclass
class Adaptation:
    """Settings of the adaptation of friction coefficients; off, for the thesis announces it without numbers."""

    enabled: bool = quantity(False)
    # what it starts from
    coulomb_n_m: float = quantity(0.0, "N*m", minimum=0.0)
    viscous_n_m_s: float = quantity(0.0, "N*m*s/rad", minimum=0.0)
    # G: N*m per s and unit of Phi'B'P x, assumed
    coulomb_rate: float = quantity(2e-3, minimum=0.0)
    viscous_rate: float = quantity(2e-3, minimum=0.0)
    # projection
    coulomb_limit_n_m: float = quantity(0.02, "N*m", above=0.0)
    viscous_limit_n_m_s: float = quantity(0.03, "N*m*s/rad", above=0.0)
    # Q of the Lyapunov equation: s, phi, theta and rates
    q: list[float] = quantity([10.0, 1.0, 1.0, 1.0, 0.1, 0.01], above=0.0, length=6)
    # x'P x below which nothing adapts
    threshold: float = quantity(1e-3, minimum=0.0)


def lyapunov_matrix(a: np.ndarray, b: np.ndarray, gain: np.ndarray, q) -> np.ndarray:
    """P (6, 6) of A_c'P + P A_c = -diag(q), A_c = A - B K.

    Raises:
        ValueError: A_c is not stable, no Lyapunov function of this form exists.
    """
    closed = a - b @ gain
    if np.linalg.eigvals(closed).real.max() >= 0.0:
        raise ValueError("the feedback does not stabilise the linear model in continuous time")
    return solve_continuous_lyapunov(closed.T, -np.diag(q))


@kernel
def faded_sign(rate, dead_band, scale):
    """sgn that is zero inside the dead band and fades in beyond it."""
    return np.sign(rate) * np.tanh(max(abs(rate) - dead_band, 0.0) / scale)


@kernel
def adapt(xd, encoder, error, tilt, velocity, p, pb, rates, limits, threshold, dead_band_rad_s, speed_scale_rad_s, out):
    """x_d = [tick, c_cu, c_v, x'P x]; p (36,), pb (12,): P and P B row by row; a stamp seen before changes nothing."""
    copy(xd, out)
    if encoder[0] == xd[0]:
        return
    out[0] = encoder[0]
    x = (-error[0], -error[1], tilt[1], velocity[0] - error[2], velocity[1], tilt[2])
    energy, right, left = 0.0, 0.0, 0.0
    for i in range(6):
        row = 0.0
        for j in range(6):
            row += p[6 * i + j] * x[j]
        energy += x[i] * row
        right += pb[2 * i] * x[i]
        left += pb[2 * i + 1] * x[i]
    out[3] = energy
    if energy < threshold:
        return
    sign_r = faded_sign(encoder[3], dead_band_rad_s, speed_scale_rad_s)
    sign_l = faded_sign(encoder[4], dead_band_rad_s, speed_scale_rad_s)
    moving_r = encoder[3] if abs(encoder[3]) > dead_band_rad_s else 0.0
    moving_l = encoder[4] if abs(encoder[4]) > dead_band_rad_s else 0.0
    coulomb = xd[1] - TICK_S * rates[0] * (sign_r * right + sign_l * left)
    viscous = xd[2] - TICK_S * rates[1] * (moving_r * right + moving_l * left)
    out[1] = min(max(coulomb, 0.0), limits[0])
    out[2] = min(max(viscous, 0.0), limits[1])


@kernel
def compensated(xd, torque, encoder, dead_band_rad_s, speed_scale_rad_s, out):
    for i in range(2):
        rate = encoder[3 + i]
        moving = rate if abs(rate) > dead_band_rad_s else 0.0
        out[i] = torque[i] + xd[1] * faded_sign(rate, dead_band_rad_s, speed_scale_rad_s) + xd[2] * moving


@kernel
def coefficients(xd, out):
    copy(xd[1:4], out)


class AdaptiveCompensator(Block):
    """Adds the expected friction, its coefficients adapted on line; takes the place of FrictionCompensator.

    .. pydrake_system::

        name: AdaptiveCompensator
        input_ports:
        - torque
        - encoder
        - error
        - tilt
        - velocity
        output_ports:
        - torque
        - coefficients

    torque (2,): in and out [N m]. encoder (5,): tick, theta [rad] (2), omega [rad/s] (2). error (3,): s_e [m], phi_h
    [rad], speed fed forward [m/s]. tilt (4,): tick, theta, rate, bias. velocity (2,): s_dot [m/s], phi_dot [rad/s].
    coefficients (3,): c_cu [N m], c_v [N m s/rad], x'P x. Section 4.1; stability: see the module.

    Args:
        adaptation: rates and bounds; a, b, gain: the linear model (6, 6), (6, 2) and K (2, 6) of the feedback.
        dead_band_rad_s, speed_scale_rad_s: of the sign, as FrictionCompensation.

    Raises:
        ValueError: the feedback does not stabilise the model.
    """

    def __init__(self, adaptation: Adaptation, a, b, gain, dead_band_rad_s=0.1, speed_scale_rad_s=0.2):
        p = lyapunov_matrix(a, b, gain, adaptation.q)
        super().__init__(Spec(
            inputs={"torque": 2, "encoder": 5, "error": 3, "tilt": 4, "velocity": 2},
            outputs={"torque": Output(2, compensated), "coefficients": Output(3, coefficients)},
            parameters={
                "p": p.ravel(), "pb": (p @ b).ravel(),
                "rates": np.array([adaptation.coulomb_rate, adaptation.viscous_rate]),
                "limits": np.array([adaptation.coulomb_limit_n_m, adaptation.viscous_limit_n_m_s]),
                "threshold": adaptation.threshold,
                "dead_band_rad_s": dead_band_rad_s, "speed_scale_rad_s": speed_scale_rad_s,
            },
            discrete_state=np.array([-1.0, adaptation.coulomb_n_m, adaptation.viscous_n_m_s, 0.0]),
            updates=(Update(adapt, Phase.COMPUTE, through=True),),
        ))
