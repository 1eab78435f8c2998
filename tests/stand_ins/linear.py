"""Runs whose residuals are linear in the sizes of a few made-up effects, on which deciding takes milliseconds."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np

from drake_ispace.effects.card import Card, Parameter
from drake_ispace.effects.effect import Effect
from drake_ispace.explain.decide.survey.generic import Generic
from drake_ispace.explain.decide.survey.signatures import Signature
from drake_ispace.explain.fit.candidates import Candidate

RUNS, ROWS = 2, 400


def pattern(seed: int) -> np.ndarray:
    """(RUNS, ROWS) random ones and minus ones, white and nearly orthogonal to the pattern of any other seed."""
    return np.random.default_rng([seed, 1]).choice([-1.0, 1.0], size=(RUNS, ROWS))


def wave(cycles: float) -> np.ndarray:
    """(RUNS, ROWS) a sine of amplitude one, with so many cycles in each run."""
    return np.tile(np.sin(2.0 * np.pi * cycles * np.arange(ROWS) / ROWS), (RUNS, 1))


def noise(seed: int = 0) -> np.ndarray:
    """(RUNS, ROWS) independent numbers of unit variance."""
    return np.random.default_rng(seed).standard_normal((RUNS, ROWS))


class Made(Effect):
    """An effect with one parameter, its size, which is at least `low`."""

    def __init__(self, name: str, low: float):
        self.card = Card(name, name, "plant", "", "", "", (), "")
        self.parameters = (Parameter("size", "", low=low, high=100.0, probes=(1.0,)),)


@dataclass(frozen=True)
class Linear:
    """A Prediction as far as `survey` needs one: residuals are `measured` less size times shape of every effect.

    Attributes:
        measured: (RUNS, ROWS). shapes: effect -> (RUNS, ROWS) change by a size of one. offsets: (run, (ROWS,))
            nuisances of single runs, one standard deviation long.
    """

    measured: np.ndarray
    shapes: Mapping[str, np.ndarray]
    offsets: tuple[tuple[int, np.ndarray], ...] = ()

    replay = SimpleNamespace(body=SimpleNamespace(wheels=1, robot=SimpleNamespace(driven="torque", in_room=True)))
    row_ticks = 1
    tracks = (SimpleNamespace(
        ticks=ROWS, command=np.ones((ROWS, 1)), measured=np.arange(ROWS)[:, None], fix_ticks=20 * np.arange(ROWS),
    ),)

    def residuals(self, values):
        explained = sum(parameters["size"] * self.shapes[name] for name, parameters in values.items())
        return streams(self.measured - explained)

    def labels(self, stream):
        return ["kinect: x"]

    def nuisances(self, values):
        return [(run, {"room": shape[:, None]}) for run, shape in self.offsets]

    def under_other_noise(self, values):
        return []

    def under_other_timing(self, values):
        return []

    def modulations(self):
        return []

    def classes(self, values, speeds=None):
        return [{}] * RUNS


def streams(rows: np.ndarray) -> list[dict[str, np.ndarray]]:
    """(RUNS, ROWS) numbers as Residuals of one stream."""
    return [{"room": run[:, None]} for run in rows]


def made(*names: str, low: float = -100.0) -> list[Candidate]:
    """A Candidate for each name, its size at least `low`."""
    effects = [Made(name, low) for name in names]
    return [Candidate(effect, (), effect.parameters) for effect in effects]


def generics_of(driver: str, shape: np.ndarray):
    """The `generics` of `decide` with a single one, a force that goes with `driver`, of this (RUNS, ROWS) shape."""
    generic = Generic(driver, "force", driver, 1)
    candidate = Candidate(generic, (), generic.parameters)
    return lambda prediction, point, base: [Signature(candidate, [1.0], 0, False, streams(shape))]


def no_generics(prediction, point, base):
    """The `generics` of `decide` without any."""
    return []
