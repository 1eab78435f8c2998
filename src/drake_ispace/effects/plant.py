"""The robot's own numbers, other than controller and odometry believe."""

import dataclasses

from drake_ispace.effects.card import Card, Parameter
from drake_ispace.effects.effect import PlantEffect


class MassError(PlantEffect):
    """The body's mass times (1 + share)."""

    card = Card(
        name="mass_error", title="Mass error", home="plant", equation="m = (1 + share) m_nominal",
        source="payload, battery, cables",
        signature="an unmodelled force against acceleration, none against turning",
        look_alikes=("torque_gain_error", "inertia_error"),
        excitation="straight acceleration and turning, both",
    )

    def parameters(self, body):
        return (Parameter("share", "1", 0.0, -0.6, 2.0, (0.05,)),)

    def change(self, plant, values):
        name = "mass_kg" if hasattr(plant, "mass_kg") else "body_mass_kg"
        return dataclasses.replace(plant, **{name: getattr(plant, name) * (1.0 + values["share"])})


EFFECTS = (MassError(),)
