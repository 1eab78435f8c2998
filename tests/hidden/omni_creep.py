"""The omni robot on wheels that creep, with arctan friction, in the midpoint rule, under the same controller.

A wheel that drives turns faster than the floor passes below it. The force F that it passes on is

    F = mu N 2/pi atan(c / C),  c = (r w - u) / (|u| + u_0),

with the creep c, u the speed of the floor along the wheel. F follows from torque and friction,
and c from F.
"""

import numpy as np
from numba import njit

from hidden import omni_truth as truth
from hidden.effects_truth import (
    GRAVITY,
    Effects,
    dry_friction,
    ground_force,
    motor_torque,
    rub,
    soft_sign,
    steady_torque,
)
from hidden.motions import TICK_S
from hidden.noise_truth import between

SUBSTEPS = 20
STEP_S = TICK_S / SUBSTEPS
_MU, _CREEP, _LEAST_M_S = 0.6, 0.02, 0.003  # friction, C, u_0
_WIDTH_RAD_S = 0.15  # of arctan friction


@njit(cache=True)
def rates(time_s, z, torque, push, body, e, out):
    """d/dt of the state of omni_truth; torque (4) [N m], push (3) [N, N, N m]."""
    c, s = np.cos(z[truth.PHI]), np.sin(z[truth.PHI])
    vx, vy, wz = z[truth.VX], z[truth.VY], z[truth.WZ]
    qx, qy, qz = push[0], push[1], push[2]
    for i in range(4):
        radius = 1.0 / np.hypot(body.g[i, 0], body.g[i, 1])
        rate = body.g[i, 0] * vx + body.g[i, 1] * vy + body.g[i, 2] * wz
        dry = body.coulomb + dry_friction(i, torque[i], rate, z[truth.THETA + i], time_s, e)
        dry *= 2.0 / np.pi * np.arctan(rate / _WIDTH_RAD_S)
        net = torque[i] + steady_torque(i, rate, z[truth.THETA + i], e) - dry - body.viscous * rate
        share = min(max(net / radius / (_MU * 0.25 * body.mass_kg * GRAVITY), -0.95), 0.95)
        creep = _CREEP * np.tan(0.5 * np.pi * share)
        qx, qy, qz = qx + body.g[i, 0] * net, qy + body.g[i, 1] * net, qz + body.g[i, 2] * net
        out[truth.THETA + i] = rate + creep * (abs(rate) + _LEAST_M_S / radius)
    out[truth.X], out[truth.Y], out[truth.PHI] = c * vx - s * vy, s * vx + c * vy, wz
    gx, gy = ground_force(z[truth.X], z[truth.Y], out[truth.X], out[truth.Y], body.mass_kg, e)
    qx, qy = qx + c * gx + s * gy, qy - s * gx + c * gy
    qz -= e.scrub_n_m * soft_sign(wz, 0.02)
    qx, qy = qx + wz * body.mass_kg * vy, qy - wz * body.mass_kg * vx
    out[truth.SLIP], out[truth.SLIP + 1] = 0.0, 0.0
    for i in range(3):
        out[truth.VX + i] = body.inverse[i, 0] * qx + body.inverse[i, 1] * qy + body.inverse[i, 2] * qz


@njit(cache=True)
def run(ticks, start, told, way_points, push, body, law, encoder, camera, e: Effects):
    """As omni_truth.run, without random slip."""
    z, half, rate = np.zeros(truth.SIZE), np.zeros(truth.SIZE), np.zeros(truth.SIZE)
    loop = truth.fresh(ticks, told, encoder)
    z[:3] = start
    torque, force = np.zeros(4), np.zeros(3)
    for tick in range(ticks + 1):
        shown = z[truth.THETA:] + loop.gap
        if not truth.sense_and_command(tick, z, shown, loop, way_points, law, encoder, camera, e):
            break
        for step in range(SUBSTEPS):
            share = (step + 0.5) / SUBSTEPS
            between(push, tick, share, force)
            time_s = (tick + share) * TICK_S
            motor_torque(loop.held, time_s, STEP_S, TICK_S, e, loop.lagged, loop.gap, torque)
            rub(z[truth.THETA:], loop.turned, loop.bent, e, torque)
            rates(time_s, z, torque, force, body, e, rate)
            half[:] = z + 0.5 * STEP_S * rate
            rates(time_s, half, torque, force, body, e, rate)
            z += STEP_S * rate
    return loop.commanded, loop.angles, loop.fixes[: loop.seen[0]], loop.truth
