"""Friction compensation with on-line adaptation of its coefficients by a Lyapunov design, announced in section 4.1.

Let the friction be phi(w)'c with phi = [sgn w, w] and c = [c_cu, c_v] of (3.35), the feedback tau_c = -K x, and the
compensation phi'c^. The closed loop is dx/dt = A_c x + B Phi (c^ - c), where A_c = A - B K is stable and row i of
Phi (2, 2) is phi(w_i)'. Take P > 0 with A_c'P + P A_c = -Q, Q > 0, gains G > 0, and

    V = x'P x + (c^ - c)' G^-1 (c^ - c).

Then dV/dt = -x'Q x + 2 (c^ - c)'(Phi'B'P x + G^-1 dc^/dt). The adaptation law

    dc^/dt = -G Phi'B'P x

gives dV/dt = -x'Q x <= 0: x and c^ stay bounded and x goes to zero (Barbalat) for all friction coefficients. The
estimate c^ converges to c only under excitation. The bounds 0 <= c^ <= limit are a projection, which keeps dV/dt <= 0
as long as c lies within the bounds.

The proof neglects two effects. The sign of a slow wheel's speed is not known from counts, so phi is zero inside a dead
band. The errors from noise and from the 5 ms steps do not vanish, so adaptation stops while x'P x is below a threshold;
otherwise the coefficients would drift. Inside the dead band and below the threshold V may grow, by a bounded amount.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_continuous_lyapunov

from drake_ispace.blocks.block import Block, Output, Phase, Spec, Update
from drake_ispace.blocks.functions import tanh
from drake_ispace.blocks.kernels import copy, kernel
from drake_ispace.blocks.messages import ERROR, TILT, WHEEL_PAIR
from drake_ispace.blocks.rates import TICK_S
from drake_ispace.files.quantity import quantity


@dataclass
class Adaptation:
    """Settings of the adaptation of friction coefficients.

    Adaptation is off by default, because the thesis announces the method without giving numbers.
    """

    enabled: bool = quantity(False)
    # initial estimates
    coulomb_n_m: float = quantity(0.0, "N*m", minimum=0.0)
    viscous_n_m_s: float = quantity(0.0, "N*m*s/rad", minimum=0.0)
    # diagonal of G: coefficient per second and unit of Phi'B'P x, assumed
    coulomb_rate: float = quantity(2e-3, minimum=0.0)
    viscous_rate: float = quantity(2e-3, minimum=0.0)
    # upper bounds of the projection
    coulomb_limit_n_m: float = quantity(0.02, "N*m", above=0.0)
    viscous_limit_n_m_s: float = quantity(0.03, "N*m*s/rad", above=0.0)
    # diagonal of Q of the Lyapunov equation: weights of s, phi, theta and their rates
    q: list[float] = quantity([10.0, 1.0, 1.0, 1.0, 0.1, 0.01], above=0.0, length=6)
    # x'P x below which nothing adapts
    threshold: float = quantity(1e-3, minimum=0.0)


def lyapunov_matrix(a: np.ndarray, b: np.ndarray, gain: np.ndarray, q) -> np.ndarray:
    """Return P (6, 6) of A_c'P + P A_c = -diag(q) with A_c = A - B K.

    Args:
        a: A (6, 6).
        b: B (6, 2).
        gain: K (2, 6).
        q: (6,).

    Raises:
        ValueError: A_c is not stable, so no Lyapunov function of this form exists.
    """
    closed = a - b @ gain
    if np.linalg.eigvals(closed).real.max() >= 0.0:
        raise ValueError("the feedback does not stabilise the linear model in continuous time")
    return solve_continuous_lyapunov(closed.T, -np.diag(q))


TICK, COULOMB, VISCOUS, ENERGY = 0, 1, 2, 3  # x_d: tick of the last sample, c_cu, c_v, x'P x


@kernel
def faded_sign(rate, dead_band, scale):
    """Return the sign of `rate`, smoothed: zero inside the dead band, beyond it rising to +-1 over `scale`."""
    return np.sign(rate) * tanh(max(abs(rate) - dead_band, 0.0) / scale)


@kernel
def adapt(xd, encoder, error, tilt, velocity, p, pb, rates, limits, threshold, dead_band_rad_s, speed_scale_rad_s, out):
    """Adapt the coefficients over one tick; a sample whose tick is already stored changes nothing.

    p (36,), pb (12,): P and P B, row by row.
    """
    copy(xd, out)
    if encoder[WHEEL_PAIR.tick] == xd[TICK]:
        return
    out[TICK] = encoder[WHEEL_PAIR.tick]
    x = (
        -error[ERROR.s_e], -error[ERROR.phi_h], tilt[TILT.angle],
        velocity[0] - error[ERROR.speed], velocity[1], tilt[TILT.rate],
    )
    energy, right, left = 0.0, 0.0, 0.0
    for i in range(6):
        row = 0.0
        for j in range(6):
            row += p[6 * i + j] * x[j]
        energy += x[i] * row
        right += pb[2 * i] * x[i]
        left += pb[2 * i + 1] * x[i]
    out[ENERGY] = energy
    if energy < threshold:
        return
    omega_r, omega_l = encoder[WHEEL_PAIR.omega_r], encoder[WHEEL_PAIR.omega_l]
    sign_r = faded_sign(omega_r, dead_band_rad_s, speed_scale_rad_s)
    sign_l = faded_sign(omega_l, dead_band_rad_s, speed_scale_rad_s)
    moving_r = omega_r if abs(omega_r) > dead_band_rad_s else 0.0
    moving_l = omega_l if abs(omega_l) > dead_band_rad_s else 0.0
    coulomb = xd[COULOMB] - TICK_S * rates[0] * (sign_r * right + sign_l * left)
    viscous = xd[VISCOUS] - TICK_S * rates[1] * (moving_r * right + moving_l * left)
    out[COULOMB] = min(max(coulomb, 0.0), limits[0])
    out[VISCOUS] = min(max(viscous, 0.0), limits[1])


@kernel
def compensated(xd, torque, encoder, dead_band_rad_s, speed_scale_rad_s, out):
    """Write the torques [N m] plus the friction expected with the present coefficients."""
    for i in range(2):
        rate = encoder[WHEEL_PAIR.omega_r + i]
        moving = rate if abs(rate) > dead_band_rad_s else 0.0
        sign = faded_sign(rate, dead_band_rad_s, speed_scale_rad_s)
        out[i] = torque[i] + xd[COULOMB] * sign + xd[VISCOUS] * moving


@kernel
def coefficients(xd, out):
    copy(xd[COULOMB:], out)


class AdaptiveCompensator(Block):
    """Adds the expected friction to the wheel torques, with coefficients that adapt on line.

    The block takes the place of FrictionCompensator.

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

    torque (2,), input and output: right, left, without and with the compensation [N m]. encoder (5,): tick, theta (2)
    [rad], omega (2) [rad/s]. error (3,): s_e [m], phi_h [rad], speed fed forward [m/s]. tilt (4,): tick, tilt [rad],
    rate [rad/s], gyro bias [rad/s]. velocity (2,): s_dot [m/s], phi_dot [rad/s]. coefficients (3,): c_cu [N m],
    c_v [N m s/rad], x'P x. Section 4.1.

    Args:
        adaptation: initial estimates, rates and bounds.
        a, b: the linear model A (6, 6), B (6, 2) with x = [s, phi, theta, s_dot, phi_dot, theta_dot].
        gain: K (2, 6) of the feedback.
        dead_band_rad_s: wheel speed below which no friction is added.
        speed_scale_rad_s: range of wheel speed over which the sign rises to 1 beyond the dead band.

    Raises:
        ValueError: the feedback does not stabilise the model.
    """

    def __init__(self, adaptation: Adaptation, a, b, gain, dead_band_rad_s=0.1, speed_scale_rad_s=0.2):
        p = lyapunov_matrix(a, b, gain, adaptation.q)
        super().__init__(Spec(
            inputs={
                "torque": 2, "encoder": len(WHEEL_PAIR), "error": len(ERROR), "tilt": len(TILT), "velocity": 2,
            },
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
