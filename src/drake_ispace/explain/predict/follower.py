"""A model held on a measured motion by a steady-state Kalman filter: its innovations are what it cannot predict.

Plain replay of recorded torques drifts, a balancing robot's replay falls. Here the model gets the recorded torque and
an acceleration u that the filter finds from the error between measured and modelled outputs,

    nu = e - C dx - D u,   dx+ = A (dx + L nu) - B u',   u' = K (dx + L nu),

dx being the filter's estimate of (true state - model's state). nu at t_k depends on measurements before t_k only, so
what correlates with it is physics that the model lacks, not noise that went round the feedback loop. u is an
acceleration, not a force, so that a heavier model is not also one that follows its measurements less.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import expm, solve_discrete_are

from drake_ispace.blocks.block import Block, Output, Phase, Spec, Update
from drake_ispace.blocks.kernels import copy, kernel
from drake_ispace.blocks.rates import TICK_S


@dataclass(frozen=True)
class Filter:
    """Matrices of the error system at 5 ms: A (n, n), B (n, m), C (p, n), D (p, m), gain L (n, p), feedback K (m, n);
    weight W (m, m): what acts on the plant is W u, a force for an acceleration."""

    a: np.ndarray
    b: np.ndarray
    c: np.ndarray
    d: np.ndarray
    gain: np.ndarray
    feedback: np.ndarray
    weight: np.ndarray


def design(a, b, c, d, process, sensors, feedback, weight) -> Filter:
    """The filter of dx/dt = a dx - b u + w, e = c dx + d u + v.

    Args:
        a, b, c, d: continuous, (n, n), (n, m), (p, n), (p, m).
        process: (n, n) spectral density of w. sensors: (p,) variance of each sample, infinite for one that the filter
            shall not use.
        feedback: K (m, n). weight: W (m, m).

    Raises:
        numpy.linalg.LinAlgError: states that the sensors used do not show.
    """
    n = len(a)
    a_d, b_d = discrete(a, b)
    van_loan = expm(np.block([[-a, process], [np.zeros((n, n)), a.T]]) * TICK_S)
    noise = van_loan[n:, n:].T @ van_loan[:n, n:]
    used = np.isfinite(sensors)
    noise = noise + 1e-12 * np.trace(noise) * np.eye(n)
    covariance = solve_discrete_are(a_d.T, c[used].T, 0.5 * (noise + noise.T), np.diag(sensors[used]))
    gain = np.zeros((n, len(c)))
    gain[:, used] = covariance @ c[used].T @ np.linalg.inv(c[used] @ covariance @ c[used].T + np.diag(sensors[used]))
    return Filter(a_d, b_d, c, d, gain, np.asarray(feedback), np.asarray(weight))


def discrete(a: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(A, B) over one tick with u held."""
    n, m = b.shape
    both = expm(np.block([[a, b], [np.zeros((m, n + m))]]) * TICK_S)
    return both[:n, :n], both[:n, n:]


@kernel
def compare(xd, measured, modelled, out):
    """x_d = [e (p), nu (p), dx (n), u (m), W u (m)]; e as the sensors see it, before this tick's commands act."""
    copy(xd, out)
    for i in range(measured.shape[0]):
        out[i] = measured[i] - modelled[i]


@kernel
def estimate(xd, measured, push, a, b, c, d, gain, feedback, weight, out):
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
        out[p + i] = nu
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
    m = out.shape[0]
    for i in range(m):
        out[i] = push[i] + xd[xd.shape[0] - m + i]


@kernel
def innovation(xd, measured, out):
    copy(xd[out.shape[0] : 2 * out.shape[0]], out)


def numbers_of(filter: Filter) -> dict[str, np.ndarray]:
    """The block's parameters."""
    return {name: np.ravel(getattr(filter, name)) for name in ("a", "b", "c", "d", "gain", "feedback", "weight")}


class Follower(Block):
    """Keeps a plant on its measured outputs and says what it could not predict.

    .. pydrake_system::

        name: Follower
        input_ports:
        - measured
        - modelled
        - push
        output_ports:
        - push
        - innovation

    measured, modelled (p,): outputs of the robot and of the model at t_k. push (m,): force of the ground on the
    plant (for a rover: its body velocity), in, and out with the correction added. innovation (p,): nu of this tick, in
    the units of the outputs.

    Args:
        filter: its matrices.
    """

    def __init__(self, filter: Filter):
        p, m, n = len(filter.c), filter.b.shape[1], len(filter.a)
        super().__init__(Spec(
            inputs={"measured": p, "modelled": p, "push": m},
            outputs={"push": Output(m, corrected), "innovation": Output(p, innovation)},
            parameters=numbers_of(filter),
            discrete_state=np.zeros(2 * p + n + 2 * m),
            updates=(Update(compare, Phase.SENSE), Update(estimate, Phase.COMPUTE)),
        ))
