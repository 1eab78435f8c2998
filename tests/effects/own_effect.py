"""An effect of one's own, in one file outside of the package: a motor whose torque fades with speed."""

from drake_ispace.blocks.kernels import kernel
from drake_ispace.effects.card import Card, Parameter
from drake_ispace.effects.wires import TorqueEffect


@kernel
def softened(torque, wheel_rate, loss_s_rad, out):
    for i in range(out.shape[0]):
        out[i] = torque[i] * (1.0 - loss_s_rad * abs(wheel_rate[i]))


class TorqueFade(TorqueEffect):
    """tau (1 - loss |w|): the faster the wheel, the less is left of the torque."""

    card = Card(
        name="torque_fade", title="Torque fade", home="actuator", equation="tau' = tau (1 - loss |w|)",
        source="back electromotive force of a motor that is driven by voltage",
        signature="a share of the torque missing that grows with speed, driving and braking",
        look_alikes=("viscous_friction", "torque_gain_error"),
        excitation="braking at speed: friction helps there, a fading torque does not",
    )
    parameters = (Parameter("loss_s_rad", "s/rad", 0.0, 0.0, 0.1, (0.001, 0.01)),)
    output = softened


EFFECTS = [TorqueFade()]
