"""Candidates: effects with the wheel chosen, and their parameters as the coordinates of a fit."""

import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Protocol

from drake_ispace.effects.card import Parameter
from drake_ispace.effects.effect import Body, Effect


class Cause(Protocol):
    """The cause that a Candidate stands for: an Effect of the library, or a Generic disagreement that has no card."""

    @property
    def name(self) -> str:
        """Name in tables, unlike that of any other cause."""


@dataclass(frozen=True)
class Candidate:
    """An effect with every choice made, and the place at which its fit begins.

    Attributes:
        effect: of the library, or a Generic disagreement.
        choices: (name, wheel number from 1) of each choice.
        parameters: those that a fit moves; coordinates are in their order.
        among: number of ways in which the choices, and the place at which the fit begins, can be made.
    """

    effect: Cause
    choices: tuple[tuple[str, int], ...]
    parameters: tuple[Parameter, ...]
    among: int = 1

    @property
    def name(self) -> str:
        """The effect's name."""
        return self.effect.name

    @property
    def label(self) -> str:
        """The effect's name, and the number of each chosen wheel in brackets."""
        return self.name + "".join(f"[{value}]" for _, value in self.choices)

    def values(self, z) -> dict[str, float]:
        """Name -> value of every choice and parameter at the coordinates `z`."""
        moved = {p.name: value_of(p, at) for p, at in zip(self.parameters, z, strict=True)}
        return dict(self.choices) | moved

    @property
    def neutral(self) -> list[float]:
        """Coordinates at which the effect changes nothing."""
        return [coordinate(p, p.neutral) for p in self.parameters]

    @property
    def shifts(self) -> bool:
        """Whether its parameter moves steps in time."""
        return any(parameter.shifts for parameter in self.parameters)

    def generalises(self, other: "Candidate") -> bool:
        """Whether it becomes the other effect at a bound of its shape."""
        return other.name in self.effect.generalises

    def has_become_another(self, z) -> bool:
        """Whether it is at the bound of its shape where it is another effect."""
        at_bound = any(p.shape and at in ends for p, at, ends in zip(self.parameters, z, self.bounds, strict=True))
        return at_bound and bool(self.effect.generalises)

    def makes_sense(self, z) -> bool:
        """Whether a robot that drives about may have every parameter at the coordinates `z`."""
        return all(p.makes_sense(value_of(p, at)) for p, at in zip(self.parameters, z, strict=True))

    def sensible(self, z) -> list[float]:
        """The coordinates nearest to `z` at which every parameter makes sense."""
        values = [value_of(p, at) for p, at in zip(self.parameters, z, strict=True)]
        within = [min(max(v, p.sensible[0]), p.sensible[1]) for p, v in zip(self.parameters, values, strict=True)]
        return [coordinate(p, value) for p, value in zip(self.parameters, within, strict=True)]

    def within(self, z) -> list[float]:
        """The coordinates nearest to `z` that a fit may reach: within bounds, and where no sum goes below zero.

        Below zero a sum is taken for zero, so that nothing would tell a fit the way back.
        """
        found = [float(min(max(at, low), high)) for at, (low, high) in zip(z, self.bounds, strict=True)]
        for i, parameter in enumerate(self.parameters):
            if parameter.added_to:
                other = next(at for p, at in zip(self.parameters, found, strict=True) if p.name == parameter.added_to)
                found[i] = max(found[i], -other)
        return found

    def tolerances(self, scales: Mapping[str, float]) -> list[float]:
        """By how much each coordinate of a sound robot may be off (standard deviations); scales: as of `probes`."""
        return [tolerance_of(p, scales) for p in self.parameters]

    @property
    def bounds(self) -> list[tuple[float, float]]:
        """(low, high) of every coordinate."""
        return [tuple(sorted((coordinate(p, p.low), coordinate(p, p.high)))) for p in self.parameters]


def coordinate(parameter: Parameter, value: float) -> float:
    """The coordinate of a value: the value itself, or its reciprocal for a limit."""
    if not parameter.reciprocal:
        return value
    return math.inf if value == 0.0 else 1.0 / value


def value_of(parameter: Parameter, at: float) -> float:
    """The value at the coordinate `at`; a limit is infinite at 0 and below."""
    if not parameter.reciprocal:
        return at
    return math.inf if at <= 0.0 else 1.0 / at


def tolerance_of(parameter: Parameter, scales: Mapping[str, float]) -> float:
    """By how much the coordinate of a sound robot may be off (standard deviation); scales: as of `probes`."""
    return parameter.tolerance * scales.get(parameter.scale, 1.0)


def candidates(effects: Mapping[str, Effect], body: Body) -> list[Candidate]:
    """A Candidate for every effect with every choice of wheels and every place at which a fit may begin."""
    result = []
    for effect in effects.values():
        wheels = [[(name, w) for w in range(1, body.wheels + 1)] for name in effect.choices]
        every = list(itertools.product(itertools.product(*wheels), effect.starts(body)))
        for picked, start in every:
            parameters = tuple(replace(p, neutral=start.get(p.name, p.neutral)) for p in effect.parameters_of(body))
            result.append(Candidate(effect, picked, parameters, len(every)))
    return result


def probes(candidate: Candidate, scales: Mapping[str, float]) -> list[list[float]]:
    """Coordinates at which the candidate's signature is taken: each probe of each parameter, the others neutral.

    scales: "torque" [N m], "speed" [rad/s] -> root mean square of the runs.
    """
    points = []
    for i, parameter in enumerate(candidate.parameters):
        for size in parameter.probes:
            z, (low, high) = list(candidate.neutral), candidate.bounds[i]
            origin = parameter.neutral if math.isfinite(parameter.neutral) else 0.0
            value = origin + size * scales.get(parameter.scale, 1.0)
            z[i] = min(max(coordinate(parameter, value), low), high)
            points.append(z)
    return points
