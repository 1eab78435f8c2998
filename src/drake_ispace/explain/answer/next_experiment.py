"""The next experiment, where these runs leave a question open."""

from drake_ispace.effects.effect import Effect
from drake_ispace.explain.answer.explanation import NamedEffect, Unknown, Untestable

_NEEDS = {
    "actuator": "{} and encoder", "transmission": "{} and encoder", "ground": "{}, encoder and kinect",
    "plant": "{}, encoder and kinect", "encoder": "encoder and kinect", "imu": "imu, {} and encoder",
    "camera": "kinect and encoder", "link": "kinect and encoder",
}
_MOST_LISTED = 3


def needs(effect: Effect, driven: str) -> str:
    """The channels and the motion that would show an effect; driven: channel of what drives the robot."""
    return f"channels {_NEEDS.get(effect.card.home, 'encoder').format(driven)}; {effect.card.excitation}"


def next_experiment(effects: list[NamedEffect], unknown: Unknown | None, untestable: list[Untestable]) -> str:
    """A sentence on the next experiment; empty where no question is open.

    unknown: None where no disagreement is unknown.
    """
    for effect in effects:
        if effect.equivalents:
            return f"to tell {effect.name} from {', '.join(effect.equivalents)}: {effect.excitation}"
    if unknown is not None:
        drive = f"drive so that {unknown.driver} changes while everything else stays as it is"
        if unknown.driver.startswith("time"):
            drive = "repeat one motion several times in a run, so that nothing but time changes"
        elif unknown.driver == "nothing":
            drive = "repeat one motion tilted or loaded otherwise, so that a constant force changes"
        elif unknown.driver == "place":
            drive = "repeat one motion in other parts of the room, so that nothing but the place changes"
        nearest = f"; nearest known effect: {unknown.nearest}" if unknown.nearest != "none" else ""
        return f"{drive}, and log the same channels{nearest}"
    if untestable:
        first, *others = untestable
        listed = [entry.said for entry in others[:_MOST_LISTED]]
        listed += [f"{len(others) - len(listed)} more"] if len(others) > len(listed) else []
        more = f" (nor {', '.join(listed)})" if others else ""
        return f"these runs cannot show {first.said}{more}: {first.needs}"
    return ""
