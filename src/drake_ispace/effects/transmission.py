"""Between motor and wheel: friction of gears and bearings in the wire `torque`, play in the wire `wheel_angle`."""

from drake_ispace.block import Output, Spec
from drake_ispace.effects.card import Card, Parameter
from drake_ispace.effects.effect import BlockEffect
from drake_ispace.kernels import kernel


@kernel
def viscous(torque, wheel_rate, coefficient_n_m_s, out):
    for i in range(out.shape[0]):
        out[i] = torque[i] - coefficient_n_m_s * wheel_rate[i]


class ViscousFriction(BlockEffect):
    """-c w on every wheel, beyond what the plant has."""

    wire = "torque"
    general = True
    card = Card(
        name="viscous_friction", title="Viscous friction", home="transmission", equation="tau' = tau - c w",
        source="(3.35), c_v",
        signature="an unmodelled torque against the wheel's speed and in proportion to it",
        look_alikes=("coulomb_friction", "soft_floor", "torque_gain_error"),
        excitation="several speeds: at one speed alone it equals Coulomb friction",
    )

    def parameters(self, body):
        return (Parameter("coefficient_n_m_s", "N*m*s/rad", 0.0, -0.1, 0.5, (1e-4, 1e-3)),)

    def spec(self, body, values):
        return Spec(
            inputs={"torque": body.wheels, "wheel_rate": body.wheels}, outputs={"torque": Output(body.wheels, viscous)},
            parameters={"coefficient_n_m_s": values["coefficient_n_m_s"]},
        )


EFFECTS = (ViscousFriction(),)
