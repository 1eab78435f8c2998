"""State feedback for the pendulum, (6.39) with corrected signs.

tau = -K x with x = [-s_e, -phi_h, theta, s_dot - speed fed forward, phi_dot, theta_dot].
"""

import numpy as np

from drake_ispace.blocks.block import Block, Output, Spec
from drake_ispace.blocks.kernels import kernel
from drake_ispace.blocks.messages import ERROR, TILT


@kernel
def feedback(error, tilt, velocity, gain, out):
    """Write tau = -K x [N m] with x = [-s_e, -phi_h, theta, s_dot - speed, phi_dot, theta_dot]; gain: K row by row."""
    for i in range(2):
        out[i] = (
            gain[6 * i] * error[ERROR.s_e] + gain[6 * i + 1] * error[ERROR.phi_h] - gain[6 * i + 2] * tilt[TILT.angle]
            - gain[6 * i + 3] * (velocity[0] - error[ERROR.speed]) - gain[6 * i + 4] * velocity[1]
            - gain[6 * i + 5] * tilt[TILT.rate]
        )


class BalanceController(Block):
    """Linear state feedback that balances the pendulum and drives it to the way point, Fig. 6.6.

    .. pydrake_system::

        name: BalanceController
        input_ports:
        - error
        - tilt
        - velocity
        output_ports:
        - torque

    error (3,): s_e [m], phi_h [rad], speed fed forward [m/s]. tilt (4,): tick, tilt [rad], rate [rad/s], gyro bias
    [rad/s]. velocity (2,): s_dot [m/s], phi_dot [rad/s]. torque (2,): right, left [N m]. Equation (6.39).

    Args:
        gain: K (2, 6) for x = [s, phi, theta, s_dot, phi_dot, theta_dot].
    """

    def __init__(self, gain):
        super().__init__(Spec(
            inputs={"error": len(ERROR), "tilt": len(TILT), "velocity": 2}, outputs={"torque": Output(2, feedback)},
            parameters={"gain": np.asarray(gain, dtype=float).ravel()},
        ))


def from_printed(k: np.ndarray, f1: np.ndarray) -> np.ndarray:
    """Return K (2, 6) of tau = -K x from the thesis's K (2, 2), here `k`, and F1 (2, 4), here `f1`, (6.42)-(6.43).

    The thesis's gains are read as tau = -k (P_d - P) + f1 x2 with x2 = [theta, s_dot, phi_dot, theta_dot]
    (docs/fidelity.md, row 9).
    """
    k, f1 = np.asarray(k, dtype=float), np.asarray(f1, dtype=float)
    return -np.column_stack([k, f1[:, 0], f1[:, 1], f1[:, 2], f1[:, 3]])
