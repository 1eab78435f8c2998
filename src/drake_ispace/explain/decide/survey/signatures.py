"""Signatures: what each effect would change in the residuals."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from drake_ispace.explain.fit.candidates import Candidate, probes
from drake_ispace.explain.fit.likelihood import Point, merged
from drake_ispace.explain.predict.prediction import Prediction, Residuals, change
from drake_ispace.explain.threads import each


@dataclass(frozen=True)
class Signature:
    """The change of the residuals that an effect of one size would bring.

    Attributes:
        candidate: the effect. z: its coordinates. at: index of the coordinate that is not neutral.
        one_sided: whether only sizes of this sign are possible. change: residuals without the effect minus residuals
            with it.
    """

    candidate: Candidate
    z: list[float]
    at: int
    one_sided: bool
    change: Residuals


def signatures(
    prediction: Prediction, point: Point, candidates: Sequence[Candidate], scales: dict[str, float], base: Residuals,
    at: Mapping[Candidate, Sequence[list[float]]] = MappingProxyType({}),
) -> list[Signature]:
    """The signature of every probe of every candidate; probes at which the model runs away are left out.

    Args:
        prediction: model and runs. point: effects that the model already has. candidates: effects to add to them, one
            at a time. scales: units of the probes, as `probes` takes them. base: residuals at `point`.
        at: further probes of some candidates.
    """
    def signature(probe):
        candidate, z = probe
        changes = difference(base, prediction.residuals(merged({**point, candidate: z})))
        if not is_finite(changes):
            return None
        number = moved(candidate, z)
        neutral, (low, high) = candidate.neutral[number], candidate.bounds[number]
        return Signature(candidate, z, number, low >= neutral or high <= neutral, changes)

    tried = [(c, z) for c in candidates for z in [*probes(c, scales), *at.get(c, ())]]
    tried = [(candidate, z) for candidate, z in tried if not candidate.parameters[moved(candidate, z)].shape]
    return [found for found in each(signature, tried) if found is not None]


def moved(candidate: Candidate, z: Sequence[float]) -> int:
    """Index of the first coordinate that is not neutral; 0 if all are."""
    return next((i for i, (value, neutral) in enumerate(zip(z, candidate.neutral, strict=True)) if value != neutral), 0)


def difference(before: Residuals, after: Residuals) -> Residuals:
    """Residuals before minus residuals after, run by run, as `change` makes them."""
    return [change(run, other) for run, other in zip(before, after, strict=True)]


def is_finite(changes: Residuals) -> bool:
    """Whether all numbers of a change are finite; a model that runs away leaves others."""
    return all(np.isfinite(rows).all() for run in changes for rows in run.values())
