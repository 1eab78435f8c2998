"""The effect NAME of one's own, here a motor whose torque fades with speed. Replace the four parts by those of yours.

Run this file: it hides the effect in two simulated runs, and looks whether `explain` names it.
"""

from drake_ispace.blocks.kernels import kernel
from drake_ispace.effects.card import Card, Parameter
from drake_ispace.effects.wires import TorqueEffect


# 1. The maths: what comes out of the wire, written into `out`. Arguments are found by name: the wire that is changed
#    (torque [N m]), other signals of the robot (wheel_rate [rad/s]), then the parameters below.
@kernel
def changed(torque, wheel_rate, loss_s_rad, out):
    for i in range(out.shape[0]):
        out[i] = torque[i] * (1.0 - loss_s_rad * abs(wheel_rate[i]))


class Own(TorqueEffect):
    """tau (1 - loss |w|): the faster the wheel, the less is left of the torque."""

    # 2. What a report says of it.
    card = Card(
        name="NAME", title="Torque fade", home="actuator", equation="tau' = tau (1 - loss |w|)",
        source="back electromotive force of a motor that is driven by voltage",
        signature="a share of the torque missing that grows with speed, driving and braking",
        look_alikes=("viscous_friction", "torque_gain_error"),
        excitation="braking at speed: friction helps there, a fading torque does not",
    )
    # 3. Its numbers: name, unit, neutral value (at which the robot is as without it), bounds, sizes to begin at.
    parameters = (Parameter("loss_s_rad", "s/rad", 0.0, 0.0, 0.1, (0.001, 0.01)),)
    output = changed


# 4. What an entry point of the group drake_ispace.effects names, so that every command knows the effect:
#    [project.entry-points."drake_ispace.effects"]
#    NAME = "NAME:EFFECTS"
EFFECTS = [Own()]


def main():
    from unittest import mock

    from drake_ispace.effects.library import library
    from drake_ispace.explain.explain import explain
    from drake_ispace.hiding import hide
    from drake_ispace.scenario import load_scenario

    scenario, (own,) = load_scenario("omni_multirate"), EFFECTS
    with mock.patch.dict(library(), {own.card.name: own}):  # as if it were registered
        runs = hide(scenario, "omni", {own.card.name: {"loss_s_rad": 0.02}}, ["square", "figure_eight"], seconds=8.0)
    rivals = [library()[name] for name in ("mass_error", "viscous_friction")]
    print(explain(scenario, list(runs.values()), effects=[own, *rivals]))


if __name__ == "__main__":
    main()
