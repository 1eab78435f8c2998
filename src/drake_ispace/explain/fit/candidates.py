"""What can be tried: an effect with its choice of wheel, and its parameters as numbers that a fit can move."""

import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

from drake_ispace.effects.card import Parameter
from drake_ispace.effects.effect import Body, Effect


class Cause(Protocol):
    """What a Candidate stands for: an Effect of the library, or a Generic disagreement that has no card."""

    @property
    def name(self) -> str:
        """Name in tables, unlike that of any other cause."""


@dataclass(frozen=True)
class Candidate:
    """An effect with every choice made.

    Attributes:
        effect: of the library, or a Generic disagreement. choices: parameter -> wheel number.
        parameters: those that a fit moves.
    """

    effect: Cause
    choices: tuple[tuple[str, int], ...]
    parameters: tuple[Parameter, ...]

    @property
    def name(self) -> str:
        return self.effect.name

    @property
    def label(self) -> str:
        """The name, with its choices where there are any."""
        return self.name + "".join(f"[{value}]" for _, value in self.choices)

    def values(self, z) -> dict[str, float]:
        """Parameters from coordinates."""
        moved = {p.name: value_of(p, at) for p, at in zip(self.parameters, z, strict=True)}
        return dict(self.choices) | moved

    @property
    def neutral(self) -> list[float]:
        """Coordinates at which it changes nothing."""
        return [coordinate(p, p.neutral) for p in self.parameters]

    @property
    def bounds(self) -> list[tuple[float, float]]:
        """(low, high) of every coordinate."""
        return [tuple(sorted((coordinate(p, p.low), coordinate(p, p.high)))) for p in self.parameters]


def coordinate(parameter: Parameter, value: float) -> float:
    """Where a fit is at this value: the value itself, or its reciprocal for a limit."""
    if not parameter.reciprocal:
        return value
    return math.inf if value == 0.0 else 1.0 / value


def value_of(parameter: Parameter, at: float) -> float:
    if not parameter.reciprocal:
        return at
    return math.inf if at <= 0.0 else 1.0 / at


def candidates(effects: Mapping[str, Effect], body: Body) -> list[Candidate]:
    """Every effect with every choice of wheels."""
    found = []
    for effect in effects.values():
        wheels = [[(name, w) for w in range(1, body.wheels + 1)] for name in effect.choices]
        found += [Candidate(effect, picked, effect.parameters_of(body)) for picked in itertools.product(*wheels)]
    return found


def probes(candidate: Candidate, scales: Mapping[str, float]) -> list[list[float]]:
    """Coordinates at which its signature is looked at: each parameter moved alone, then all together where the first
    alone does nothing (a Stribeck bump and its speed).

    scales: "torque", "speed" -> root mean square of the runs.
    """
    found = []
    for i, parameter in enumerate(candidate.parameters):
        for size in parameter.probes:
            z = list(candidate.neutral)
            z[i] = coordinate(parameter, parameter.neutral + size * scales.get(parameter.scale, 1.0)) \
                if math.isfinite(parameter.neutral) else coordinate(parameter, size * scales.get(parameter.scale, 1.0))
            low, high = candidate.bounds[i]
            z[i] = min(max(z[i], low), high)
            found.append(z)
    return found
