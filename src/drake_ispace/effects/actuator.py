"""Between the commanded torque and what the motor gives: effects in the wire `torque`, all wheels alike or one.

Memory is kept in the sensing phase: at t_k+1 it stores what went through on [t_k, t_k+1), before the next command
acts. So the output follows the command of its own tick, and nothing is a tick late.
"""

import numpy as np

from drake_ispace.block import Output, Phase, Spec, Update
from drake_ispace.effects.card import Card, Parameter
from drake_ispace.effects.effect import BlockEffect
from drake_ispace.kernels import kernel
from drake_ispace.rates import TICK_S


@kernel
def scaled(torque, gain, out):
    for i in range(out.shape[0]):
        out[i] = gain[i] * torque[i]


class TorqueGainError(BlockEffect):
    """(1 + share) tau."""

    wire = "torque"
    general = True
    card = Card(
        name="torque_gain_error", title="Torque gain error", home="actuator", equation="tau' = (1 + share) tau",
        source="motor constant or amplifier gain other than assumed",
        signature="an unmodelled torque in proportion to the command, equal for all wheels",
        look_alikes=("mass_error", "inertia_error", "load_dependent_friction", "battery_sag_load"),
        excitation="acceleration along all axes and turning: a mass error scales forces only, not the yaw moment",
    )

    def parameters(self, body):
        return (Parameter("share", "1", 0.0, -0.7, 0.7, (0.05,)),)

    def spec(self, body, values):
        return Spec(
            inputs={"torque": body.wheels}, outputs={"torque": Output(body.wheels, scaled)},
            parameters={"gain": np.full(body.wheels, 1.0 + values["share"])},
        )


@kernel
def lagged(xd, torque, memory, out):
    for i in range(out.shape[0]):
        out[i] = memory * xd[i] + (1.0 - memory) * torque[i]


@kernel
def remember_lagged(xd, torque, memory, out):
    """x_d = [torque that went through (n)]."""
    for i in range(out.shape[0]):
        out[i] = memory * xd[i] + (1.0 - memory) * torque[i]


class MotorLag(BlockEffect):
    """First-order lag, constant over a tick: y_k = a y_k-1 + (1 - a) tau_k, a = exp(-T/time_constant)."""

    wire = "torque"
    general = True
    card = Card(
        name="motor_lag", title="Motor lag", home="actuator", equation="time_constant d(tau')/dt = tau - tau'",
        source="electrical time constant of winding and driver, M(q) of (3.27)",
        signature="torque missing where the command rises, too much where it falls",
        look_alikes=("command_delay", "torque_slew_limit"),
        excitation="steps and fast reversals of the command: a delay shifts them, a lag rounds them",
    )

    def parameters(self, body):
        return (Parameter("time_constant_s", "s", 0.0, 0.0, 0.3, (0.005, 0.02)),)

    def spec(self, body, values):
        constant = values["time_constant_s"]
        return Spec(
            inputs={"torque": body.wheels}, outputs={"torque": Output(body.wheels, lagged)},
            parameters={"memory": float(np.exp(-TICK_S / constant)) if constant > 0.0 else 0.0},
            discrete_state=np.zeros(body.wheels), updates=(Update(remember_lagged, Phase.SENSE),),
        )


EFFECTS = (TorqueGainError(), MotorLag())
