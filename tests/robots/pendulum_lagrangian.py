"""The pendulum's equations of motion derived from its energies, (2.2)-(2.48), as a check on the plant.

Read it top to bottom: positions, velocities, inertias, energies, Lagrange's equations, rolling constraints, reduction
to v = [s_dot, phi_dot, theta_dot]. Corrections to the print (docs/fidelity.md, rows 1 to 4): the body's mass is m_b
everywhere, each wheel has its mass m_w at its own centre, and (2.27) is differentiated by machine, not by hand.

Frames: W the room's floor, V the axle's middle (turned by the yaw phi), B the body (V tilted by theta, forward
positive). Wheel angles are relative to the body. All lengths m, masses kg, angles rad.
"""

import functools
from dataclasses import dataclass

import numpy as np
from pydrake.symbolic import Evaluate, Expression, Jacobian, Variable, cos, sin

from drake_ispace.plants.pendulum import MOTIONS, PendulumPlantParameters
from drake_ispace.plants.slip import GRAVITY

# q = [x, y, phi, theta_b, theta_wr, theta_wl], its rates and the constants of Table 2.1
Q = np.array([Variable(name) for name in ("x", "y", "phi", "theta", "theta_r", "theta_l")])
Q_DOT = np.array([Variable(f"{q.get_name()}_dot") for q in Q])
CONSTANTS = {name: Variable(name) for name in (
    "m_b", "m_w", "I_xx", "I_yy", "I_zz", "I_w", "I_wz", "I_r", "I_rz", "J", "z", "b", "r", "n", "g",
    "kappa"
)}
m_b, m_w, I_xx, I_yy, I_zz, I_w, I_wz, I_r, I_rz, J, z, b, r, n, g, kappa = CONSTANTS.values()
x, y, phi, theta, _, _ = Q
_, _, phi_dot, theta_dot, theta_r_dot, theta_l_dot = Q_DOT

quiet = np.errstate(invalid="ignore")  # NumPy takes the inside of an Expression for a not-a-number


@quiet
def rate(value: np.ndarray) -> np.ndarray:
    """d/dt of expressions in q."""
    return Jacobian(value, Q) @ Q_DOT


def vee(matrix: np.ndarray) -> np.ndarray:
    """The vector of a skew-symmetric matrix, (2.6) with the sign of entry (2, 3) corrected."""
    return np.array([matrix[2, 1], matrix[0, 2], matrix[1, 0]])


def angular_velocity(rotation: np.ndarray) -> np.ndarray:
    """(R_dot R')^vee, (2.5)."""
    rotation_dot = np.array([rate(row) for row in rotation])
    return vee(rotation_dot @ rotation.T)


# -- Positions and velocities, (2.2)-(2.9)
R_WV = np.array([[cos(phi), -sin(phi), 0], [sin(phi), cos(phi), 0], [0, 0, 1]])
R_VB = np.array([[cos(theta), 0, sin(theta)], [0, 1, 0], [-sin(theta), 0, cos(theta)]])
R_WB = R_WV @ R_VB
p_WV = np.array([x, y, r])  # middle of the axle
p_WC = p_WV + R_WB @ np.array([0, 0, z])  # the body's centre of gravity, (2.3)
v_WC = rate(p_WC)  # (2.4)
w_WB = angular_velocity(R_WB)  # (2.7)
p_WR, p_WL = p_WV + R_WV @ np.array([0, -b, 0]), p_WV + R_WV @ np.array([0, b, 0])  # wheel centres, right and left


def spin(speed) -> np.ndarray:
    """Angular velocity in W of a part that turns at `speed` about the axle and yaws with the robot, (2.20)."""
    return R_WV @ np.array([0, speed, phi_dot])


# -- Inertias in W, (2.11), (2.13), (2.14). A wheel is a disk: about x it has I_wz; the rotor likewise.
I_BODY = R_WB @ np.diag([I_xx, I_yy, I_zz]) @ R_WB.T
I_WHEEL = R_WV @ np.diag([I_wz, I_w, I_wz]) @ R_WV.T
I_ROTOR = R_WV @ np.diag([I_rz, I_r, I_rz]) @ R_WV.T


@dataclass(frozen=True)
class Part:
    """A rigid part: mass, velocity of its centre in W (3,), inertia in W (3, 3), angular velocity in W (3,)."""

    mass: object
    velocity: np.ndarray
    inertia: np.ndarray
    spin: np.ndarray

    @property
    @quiet
    def translation(self) -> Expression:
        return 0.5 * self.mass * (self.velocity @ self.velocity)

    @property
    @quiet
    def rotation(self) -> Expression:
        return 0.5 * (self.spin @ (self.inertia @ self.spin))


# The rotors' mass is part of the body's; a rotor turns at n theta_w + theta_b, (2.24).
BODY = Part(m_b, v_WC, I_BODY, w_WB)  # (2.18), (2.19)
WHEELS = [Part(m_w, rate(p), I_WHEEL, spin(w + theta_dot)) for p, w in ((p_WR, theta_r_dot), (p_WL, theta_l_dot))]
ROTORS = [Part(0, 0 * v_WC, I_ROTOR, spin(n * w + theta_dot)) for w in (theta_r_dot, theta_l_dot)]
# What turns with a wheel against the body, seen at the wheel: it knows of no yaw.
I_DRIVE = R_WV @ np.diag([0, J, 0]) @ R_WV.T
DRIVES = [Part(0, 0 * v_WC, I_DRIVE, R_WV @ np.array([0, w, 0])) for w in (theta_r_dot, theta_l_dot)]
PARTS = [BODY, *WHEELS, *ROTORS, *DRIVES]

# -- Constraints A(q) q_dot = 0, (2.40), and S(q) with A S = 0, (2.41); kappa = 0 is the literature's (2.34)-(2.36).
A = np.array([
    [sin(phi), -cos(phi), 0, 0, 0, 0],
    [cos(phi), sin(phi), b, -kappa * r, -r, 0],
    [cos(phi), sin(phi), -b, -kappa * r, 0, -r],
])
S = np.array([
    [cos(phi), 0, 0],
    [sin(phi), 0, 0],
    [0, 1, 0],
    [0, 0, 1],
    [1 / r, b / r, -kappa],
    [1 / r, -b / r, -kappa],
])
E = np.vstack([np.zeros((4, 2)), np.eye(2)])  # (2.30)


@functools.cache
@quiet
def lagrangian() -> tuple[Expression, Expression, np.ndarray, np.ndarray, np.ndarray]:
    """(T, U, M (6, 6), V (6,), G (6,)) of M q_ddot + V + G = E tau, (2.24)-(2.28)."""
    kinetic = sum((part.translation + part.rotation for part in PARTS), Expression(0.0))
    potential = m_b * g * p_WC[2]  # (2.25)
    momentum = Jacobian([kinetic], Q_DOT)[0]
    mass = Jacobian(momentum, Q_DOT)
    velocity_terms = Jacobian(momentum, Q) @ Q_DOT - Jacobian([kinetic], Q)[0]
    return kinetic, potential, mass, velocity_terms, Jacobian([potential], Q)[0]


@functools.cache
@quiet
def newton_euler() -> tuple[np.ndarray, np.ndarray]:
    """(M (6, 6), V + G (6,)) without energies: d/dt of each part's momenta along the motions that q_dot allows.

    Sum over parts of (dv/dq_dot)' (d(m v)/dt - m g) + (dw/dq_dot)' d(I w)/dt, the principle of Jourdain.
    """
    mass, rest = np.zeros((6, 6)), np.zeros(6)
    for part in PARTS:
        weight = np.array([0, 0, -part.mass * g])
        for velocity, momentum, force in (
            (part.velocity, part.mass * part.velocity, weight), (part.spin, part.inertia @ part.spin, np.zeros(3)),
        ):
            along = Jacobian(velocity, Q_DOT).T
            mass = mass + along @ Jacobian(momentum, Q_DOT)
            rest = rest + along @ (Jacobian(momentum, Q) @ Q_DOT - force)
    return mass, rest


def environment(parameters: PendulumPlantParameters, q=None, q_dot=None) -> dict[Variable, float]:
    """Numbers for the constants and, where given, for q (6,) and q_dot (6,)."""
    values = (
        parameters.body_mass_kg, parameters.wheel_mass_kg, parameters.body_inertia_roll_kg_m2,
        parameters.body_inertia_pitch_kg_m2, parameters.body_inertia_yaw_kg_m2, parameters.wheel_inertia_kg_m2,
        parameters.wheel_inertia_yaw_kg_m2, parameters.rotor_inertia_kg_m2, parameters.rotor_inertia_yaw_kg_m2,
        parameters.drive_inertia_kg_m2, parameters.centre_of_gravity_m, parameters.half_track_m,
        parameters.wheel_radius_m, parameters.gear_ratio, GRAVITY, float(MOTIONS.index(parameters.motion)),
    )
    where = dict(zip(CONSTANTS.values(), values, strict=True))
    for names, given in ((Q, q), (Q_DOT, q_dot)):
        where |= {} if given is None else dict(zip(names, map(float, given), strict=True))
    return where


def numbers(expressions, where: dict[Variable, float]) -> np.ndarray:
    """An array of expressions, evaluated."""
    array = np.asarray(expressions, dtype=object)
    column = np.array([Expression(0.0) + entry for entry in array.ravel()]).reshape(-1, 1)
    return Evaluate(column, where).reshape(array.shape)


@quiet
def reduced(
    parameters: PendulumPlantParameters, tilt: float, rates, yaw: float = 0.0, route: str = "lagrange"
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(M_bar (3, 3), velocity and gravity terms (3,), E_bar (3, 2)) of M_bar v_dot + h = E_bar tau, (2.46)-(2.48).

    Args:
        parameters: of the plant; friction and slip are not part of these equations.
        tilt: theta_b [rad]; rates: v = [s_dot, phi_dot, theta_dot] [m/s, rad/s, rad/s].
        yaw: phi [rad], on which the result does not depend.
        route: lagrange (from the energies) or newton_euler (from the momenta).
    """
    q = np.array([0.0, 0.0, yaw, tilt, 0.0, 0.0])
    s = numbers(S, environment(parameters, q))
    q_dot = s @ np.asarray(rates, dtype=float)
    where = environment(parameters, q, q_dot)
    s_dot = numbers(np.array([rate(row) for row in S]), where)
    if route == "lagrange":
        _, _, mass, velocity_terms, gravity = lagrangian()
        rest = velocity_terms + gravity
    else:
        mass, rest = newton_euler()
    mass, rest = numbers(mass, where), numbers(rest, where)
    return s.T @ mass @ s, s.T @ (mass @ s_dot @ rates + rest), s.T @ E


def accelerations(parameters: PendulumPlantParameters, tilt: float, rates, torque, route="lagrange") -> np.ndarray:
    """v_dot (3,) = [s_ddot, phi_ddot, theta_ddot] under the torques [right, left] [N m]."""
    mass, rest, effort = reduced(parameters, tilt, rates, route=route)
    return np.linalg.solve(mass, effort @ torque - rest)
