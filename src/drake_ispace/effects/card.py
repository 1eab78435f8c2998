"""An effect's card: all that is known of the effect before any data."""

import math
from dataclasses import dataclass

#: Where an effect can enter, in the order from command to camera.
HOMES = ("actuator", "transmission", "ground", "plant", "encoder", "imu", "camera", "link")


#: Names of scales, and what they are.
SCALES = {
    "torque": "RMS commanded torque", "1/torque": "1 / RMS commanded torque", "speed": "RMS wheel speed",
    "torque/speed": "RMS commanded torque / RMS wheel speed", "top speed": "largest wheel speed",
}


@dataclass(frozen=True)
class Parameter:
    """A number of an effect.

    Attributes:
        name: with its unit, as in a scenario. unit: for people and reports.
        neutral: the value at which the model is the base model, bit for bit; infinite for limits.
        low, high: what is physically possible.
        probes: sizes at which a search begins, in units of `scale`.
        scale: "" (SI units), or one of SCALES: of the runs' own root mean squares of commanded torque and wheel speed,
            or of the largest wheel speed in them.
        reciprocal: fitted as 1 / value, which is 0 where there is no limit.
        tolerance: by how much, in units of `scale`, a robot may be off without anything being wrong (a standard
            deviation): a floor is never level to a tenth of a milliradian, and no model exact. Of a limit it is the
            reciprocal of one that is so high that it hardly shows.
        sensible: what a robot that drives about may have. A fit may go beyond, but its result is then not named.
        shape: whether it changes nothing while the other parameters are neutral: where, or at which speed, they act.
        shifts: whether it moves steps in time. A small change of it then says nothing of a step that is far off, and a
            fit must begin near the best value.
        added_to: name of a parameter that it is added to, the sum being at least zero; "": none.
    """

    name: str
    unit: str
    neutral: float = 0.0
    low: float = -math.inf
    high: float = math.inf
    probes: tuple[float, ...] = (0.01,)
    scale: str = ""
    reciprocal: bool = False
    tolerance: float = 0.0
    sensible: tuple[float, float] = (-math.inf, math.inf)
    shape: bool = False
    shifts: bool = False
    added_to: str = ""

    def makes_sense(self, value: float) -> bool:
        """Whether a robot that drives about may have this value."""
        least, most = self.sensible
        return least <= value <= most


@dataclass(frozen=True)
class Card:
    """An effect on one page.

    Attributes:
        name: in scenarios and verdicts; title: for people. home: one of HOMES.
        equation: in the symbols of docs/effects.md; source: where it comes from.
        signature: what it leaves in the residuals.
        look_alikes: names of the effects with the nearest signature; excitation: the motion that separates them.
        same: what else is the same to all sensors of a robot whose velocity is commanded, in a sentence.
    """

    name: str
    title: str
    home: str
    equation: str
    source: str
    signature: str
    look_alikes: tuple[str, ...]
    excitation: str
    same: str = ""
