"""A multi-rate loop without trigonometry, as Blocks: three axes in W, each a double integrator.

Every 5 ms an encoder that runs `scale` too far is read and a force from state feedback is held; every 95 ms a camera
with a bias and a drift sees the position, and the estimator (6.6), as printed, carries that fix on by the encoder.
Everything is linear, so that other simulators can express it and be compared with it to the last digits.
"""

import numpy as np
from pydrake.systems.framework import Diagram

from drake_ispace.blocks.block import Block, Output, Phase, Spec, Update
from drake_ispace.blocks.kernels import copy, kernel
from drake_ispace.blocks.rates import TICK_S, VISION_TICKS
from drake_ispace.wiring.bench import Bench

AXES = 3
MASS = np.array([7.31, 7.31, 0.0729])
SCALE = np.array([1.05, 1.05, 1.1])
BIAS = np.array([0.01, -0.02, 0.03])
DRIFT = np.array([1e-6, 2e-6, -1e-6])  # per tick
GOAL = np.array([0.8, -0.5, 0.3])
K_P = np.array([77.0, 77.0, 11.9])
K_D = np.array([33.7, 33.7, 4.0])
MEMORY = 0.25  # of the encoder's velocity filter


@kernel
def derivatives(xc, force, mass, out):
    """x_c = [position (3), velocity (3)]."""
    for i in range(3):
        out[i] = xc[3 + i]
        out[3 + i] = force[i] / mass[i]


@kernel
def position(xc, out):
    copy(xc[:3], out)


@kernel
def read_encoder(tick, xd, position, scale, memory, out):
    """x_d = [tick, position (3), velocity (3)]."""
    for i in range(3):
        place = scale[i] * position[i]
        difference = 0.0 if xd[0] < 0.0 else (place - xd[1 + i]) / TICK_S
        out[1 + i] = place
        out[4 + i] = memory * xd[4 + i] + (1.0 - memory) * difference
    out[0] = tick


@kernel
def see(tick, position, bias, drift, out):
    """x_d = [tick of capture, position (3)]."""
    out[0] = tick
    for i in range(3):
        out[1 + i] = position[i] + bias[i] + drift[i] * tick


@kernel
def take_fix(xd, message, fix, out):
    """x_d = [tick of the fix, fix (3), encoder at its capture (3)]."""
    out[0] = max(xd[0], fix[0])
    for i in range(3):
        out[1 + i] = fix[1 + i] if fix[0] > xd[0] else xd[1 + i]
        out[4 + i] = message[1 + i] if fix[0] > xd[0] else xd[4 + i]


@kernel
def estimate(xd, message, out):
    for i in range(3):
        out[i] = xd[1 + i] + (message[1 + i] - xd[4 + i])


@kernel
def feedback(estimate, message, goal, k_p, k_d, out):
    for i in range(3):
        out[i] = k_p[i] * (goal[i] - estimate[i]) - k_d[i] * message[4 + i]


@kernel
def hold(command, out):
    copy(command, out)


@kernel
def show(xd, out):
    copy(xd, out)


def plain_loop() -> Diagram:
    """The Diagram: plant, encoder, camera, estimator, feedback, hold."""
    empty = np.zeros(7)
    empty[0] = -1.0
    bench = Bench()
    bench.add("plant", Block(Spec(
        inputs={"force": 3}, outputs={"position": Output(3, position)}, parameters={"mass": MASS},
        continuous_state=np.zeros(6), derivatives=derivatives,
    )))
    bench.add("encoder", Block(Spec(
        inputs={"position": 3}, outputs={"message": Output(7, show)}, parameters={"scale": SCALE, "memory": MEMORY},
        discrete_state=empty, updates=(Update(read_encoder, Phase.SENSE),),
    )))
    bench.add("camera", Block(Spec(
        inputs={"position": 3}, outputs={"fix": Output(4, show)}, parameters={"bias": BIAS, "drift": DRIFT},
        discrete_state=empty[:4], updates=(Update(see, Phase.SENSE, VISION_TICKS),),
    )))
    bench.add("estimator", Block(Spec(
        inputs={"message": 7, "fix": 4}, outputs={"estimate": Output(3, estimate)}, discrete_state=empty,
        updates=(Update(take_fix, Phase.COMPUTE, through=True),),
    )))
    bench.add("feedback", Block(Spec(
        inputs={"estimate": 3, "message": 7}, outputs={"force": Output(3, feedback)},
        parameters={"goal": GOAL, "k_p": K_P, "k_d": K_D},
    )))
    bench.add("hold", Block(Spec(
        inputs={"command": 3}, outputs={"force": Output(3, show)}, discrete_state=np.zeros(3),
        updates=(Update(hold, Phase.COMPUTE),),
    )))
    bench.wire(
        ("plant.position", "encoder.position"), ("plant.position", "camera.position"),
        ("encoder.message", "estimator.message"), ("camera.fix", "estimator.fix"),
        ("encoder.message", "feedback.message"), ("estimator.estimate", "feedback.estimate"),
        ("feedback.force", "hold.command"), ("hold.force", "plant.force"),
    )
    bench.show(position="plant.position", message="encoder.message", fix="camera.fix", force="hold.force")
    return bench.build("plain_loop")


def scalar_python(ticks: int, log: list | None = None) -> list[float]:
    """The same loop as plain Python over floats, the same operations in the same order; returns [position, velocity].

    log: is given [position, velocity] of every tick before its updates.
    """
    axes = range(AXES)
    mass, scale, bias, drift, goal, k_p, k_d = (v.tolist() for v in (MASS, SCALE, BIAS, DRIFT, GOAL, K_P, K_D))
    p, v, force = [0.0] * 3, [0.0] * 3, [0.0] * 3
    place, speed, fix, captured = [0.0] * 3, [0.0] * 3, [0.0] * 3, [0.0] * 3
    for k in range(ticks):
        if log is not None:
            log.append(p + v)
        for i in axes:
            now = scale[i] * p[i]
            difference = 0.0 if k == 0 else (now - place[i]) / TICK_S
            speed[i] = MEMORY * speed[i] + (1.0 - MEMORY) * difference
            place[i] = now
        if k % VISION_TICKS == 0:
            for i in axes:
                fix[i] = p[i] + bias[i] + drift[i] * k
                captured[i] = place[i]
        h = (k + 1) * TICK_S - k * TICK_S
        h6 = h / 6.0
        for i in axes:
            force[i] = k_p[i] * (goal[i] - (fix[i] + (place[i] - captured[i]))) - k_d[i] * speed[i]
            a, v0 = force[i] / mass[i], v[i]
            v1 = v0 + (0.5 * h) * a
            v2 = v0 + (-h * a + (2.0 * h) * a)
            p[i] = p[i] + ((h6 * v0 + (4.0 * h6) * v1) + h6 * v2)
            v[i] = v0 + ((h6 * a + (4.0 * h6) * a) + h6 * a)
    if log is not None:
        log.append(p + v)
    return p + v
