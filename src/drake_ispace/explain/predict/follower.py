"""A steady-state Kalman filter that holds a model on a measured motion. What the model cannot predict: its innovations.

Plain replay of recorded torques drifts, and a balancing robot's replay falls. The follower therefore gives the model,
besides the recorded torque, an acceleration u computed from the error e between measured and modelled outputs:

    nu = e - C dx - D u,   dx+ = A (dx + L nu) - B u',   u' = K (dx + L nu).

dx is the filter's estimate of (true state - model's state), nu the innovation, u' the acceleration of the next tick.
e at t_k is predicted from measurements before t_k only: what correlates with nu is physics that the model lacks, not
noise that went round the feedback loop. u is an acceleration, not a force, so that a heavier model follows its
measurements no less.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import expm, solve_discrete_are

from drake_ispace.blocks.block import Block, Output, Phase, Spec, Update
from drake_ispace.blocks.kernels import copy, kernel
from drake_ispace.blocks.rates import TICK_S


@dataclass(frozen=True)
class Filter:
    """Matrices of the error system over one tick of 5 ms.

    Attributes:
        a, b, c, d: A (n, n), B (n, m), C (p, n), D (p, m).
        gain: L (n, p). feedback: K (m, n).
        weight: W (m, m), force per acceleration: W u acts on the plant.
        slips: how many states, the last ones, are no state of the model, such as a wheel's slip.
    """

    a: np.ndarray
    b: np.ndarray
    c: np.ndarray
    d: np.ndarray
    gain: np.ndarray
    feedback: np.ndarray
    weight: np.ndarray
    slips: int = 0

    @property
    def settling_ticks(self) -> int:
        """Ticks after which a thousandth is left of an error of the model's state, however it began.

        0 where no gain is used and the state has no error that could settle, or where it never does.
        """
        own = slice(len(self.a) - self.slips)
        loops = (self.a - self.b @ self.feedback)[own, own], self.a - self.a @ self.gain @ self.c  # model, estimate
        slowest = max(np.abs(np.linalg.eigvals(loop)).max() for loop in loops)
        return int(np.ceil(np.log(1e-3) / np.log(slowest))) if slowest < 1.0 else 0


def design(a, b, c, d, process, sensors, feedback, weight, ticks: int = 1, slips: int = 0) -> Filter:
    """The steady-state filter of dx/dt = a dx - b u + w, e = c dx + d u + v.

    Args:
        a, b, c, d: continuous, (n, n), (n, m), (p, n), (p, m).
        process: (n, n) spectral density of w.
        sensors: (p,) variance of a sample of each output; infinite: the filter does not use this output.
        feedback: K (m, n). weight: W (m, m). ticks: from one sample of the outputs to the next. slips: as of Filter.

    Raises:
        numpy.linalg.LinAlgError: the outputs in use do not show every state.
    """
    n = len(a)
    van_loan = expm(np.block([[-a, process], [np.zeros((n, n)), a.T]]) * ticks * TICK_S)
    noise = van_loan[n:, n:].T @ van_loan[:n, n:]
    used = np.isfinite(sensors)
    noise = noise + 1e-12 * np.trace(noise) * np.eye(n)
    covariance = solve_discrete_are(van_loan[n:, n:], c[used].T, 0.5 * (noise + noise.T), np.diag(sensors[used]))
    gain = np.zeros((n, len(c)))
    gain[:, used] = covariance @ c[used].T @ np.linalg.inv(c[used] @ covariance @ c[used].T + np.diag(sensors[used]))
    return Filter(*discrete(a, b), c, d, gain, np.asarray(feedback), np.asarray(weight), slips)


def discrete(a: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(A, B) over one tick, u held (zero-order hold), of the continuous a (n, n), b (n, m)."""
    n, m = b.shape
    both = expm(np.block([[a, b], [np.zeros((m, n + m))]]) * TICK_S)
    return both[:n, :n], both[:n, n:]


@kernel
def compare(xd, measured, modelled, out):
    """e, as the sensors see it, before this tick's commands act; x_d = [e (p), nu (p), dx (n), u (m), W u (m)]."""
    copy(xd, out)
    for i in range(measured.shape[0]):
        out[i] = measured[i] - modelled[i]


@kernel
def estimate(xd, measured, push, a, b, c, d, gain, feedback, weight, out):
    """nu, 0 where nothing was measured, then dx, u and W u of the next tick; x_d as in `compare`."""
    p, m = measured.shape[0], push.shape[0]
    n = xd.shape[0] - 2 * p - 2 * m
    x, u = 2 * p, 2 * p + n
    for i in range(p):
        out[i] = xd[i]
        nu = xd[i]
        for j in range(n):
            nu -= c[i * n + j] * xd[x + j]
        for j in range(m):
            nu -= d[i * m + j] * xd[u + j]
        out[p + i] = nu if nu == nu else 0.0
    for i in range(m):
        out[u + i] = 0.0
    # u' = K (dx + L nu), then dx+ = A (dx + L nu) - B u'
    for i in range(n):
        out[x + i] = 0.0
    for j in range(n):
        corrected = xd[x + j]
        for i in range(p):
            corrected += gain[j * p + i] * out[p + i]
        for i in range(m):
            out[u + i] += feedback[i * n + j] * corrected
        for i in range(n):
            out[x + i] += a[i * n + j] * corrected
    for i in range(n):
        for j in range(m):
            out[x + i] -= b[i * m + j] * out[u + j]
    for i in range(m):
        out[u + m + i] = 0.0
        for j in range(m):
            out[u + m + i] += weight[i * m + j] * out[u + j]


@kernel
def corrected(xd, push, out):
    """push + W u."""
    m = out.shape[0]
    for i in range(m):
        out[i] = push[i] + xd[xd.shape[0] - m + i]


@kernel
def innovation(xd, measured, out):
    """nu."""
    copy(xd[out.shape[0] : 2 * out.shape[0]], out)


@kernel
def error(xd, measured, out):
    """e."""
    copy(xd[: out.shape[0]], out)


def numbers_of(filter: Filter) -> dict[str, np.ndarray]:
    """The parameters of a Follower: the filter's matrices, flattened."""
    return {name: np.ravel(getattr(filter, name)) for name in ("a", "b", "c", "d", "gain", "feedback", "weight")}


class Follower(Block):
    """Holds a model on a robot's measured outputs, and gives the innovations.

    .. pydrake_system::

        name: Follower
        input_ports:
        - measured
        - modelled
        - push
        output_ports:
        - push
        - innovation
        - error

    measured, modelled (p,): outputs of the robot and of the model at t_k; no number where nothing was measured. push
    (m,): what acts on the plant, force of the ground, wheel torque of a user's own plant, or body velocity where that
    is commanded; the output has the correction added. innovation (p,), error (p,): nu and e of this tick, in the units
    of the outputs.

    Args:
        filter: matrices of the error system.
    """

    def __init__(self, filter: Filter):
        p, m, n = len(filter.c), filter.b.shape[1], len(filter.a)
        super().__init__(Spec(
            inputs={"measured": p, "modelled": p, "push": m},
            outputs={"push": Output(m, corrected), "innovation": Output(p, innovation), "error": Output(p, error)},
            parameters=numbers_of(filter),
            discrete_state=np.zeros(2 * p + n + 2 * m),
            updates=(Update(compare, Phase.SENSE), Update(estimate, Phase.COMPUTE)),
        ))
