"""The next experiment, where these runs leave a question open."""

from drake_ispace.effects.effect import Effect
from drake_ispace.explain.answer.explanation import NamedEffect, Unknown, Untestable

_NEEDS = {
    "actuator": "torque and encoder", "transmission": "torque and encoder", "ground": "torque, encoder and kinect",
    "plant": "torque, encoder and kinect", "encoder": "encoder and kinect", "imu": "imu, torque and encoder",
    "camera": "kinect and encoder", "link": "kinect and encoder",
}


def needs(effect: Effect) -> str:
    """The channels and the motion that would show an effect."""
    return f"channels {_NEEDS.get(effect.card.home, 'encoder')}; {effect.card.excitation}"


def next_experiment(effects: list[NamedEffect], unknown: Unknown | None, untestable: list[Untestable]) -> str:
    """A sentence on the next experiment; empty where no question is open.

    unknown: None where no disagreement is unknown.
    """
    for effect in effects:
        if effect.equivalents:
            return f"to tell {effect.name} from {', '.join(effect.equivalents)}: {effect.excitation}"
    if unknown is not None:
        return (
            f"drive so that {unknown.driver} changes while everything else stays as it is, and log the same channels; "
            f"nearest known effect: {unknown.nearest}"
        )
    if untestable:
        first, *others = untestable
        more = f" (nor {', '.join(entry.effect for entry in others)})" if others else ""
        return f"these runs cannot show {first.effect}{more}: {first.needs}"
    return ""
