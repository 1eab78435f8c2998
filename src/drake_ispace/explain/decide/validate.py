"""Stage 3 for runs that are too short for the statistics of a filter: effects chosen by free-run simulation.

Every set of effects is fitted to one half of the runs and judged on the other, both ways round, together with the free
parameters of the plant. Of the sets whose error is nearly the least, the one with the fewest parameters is named: what
is fitted to noise helps on the runs that it was fitted to, and hardly on others. Parameters count and not effects,
because a Stribeck bump that reaches beyond the fastest run is a Coulomb friction with one parameter more.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from drake_ispace.blocks.errors import InputError
from drake_ispace.explain.decide.survey.view import scales_of
from drake_ispace.explain.fit.candidates import Candidate, probes
from drake_ispace.explain.fit.free_run import Sizes, errors, fitted, rms, unit_of
from drake_ispace.explain.fit.likelihood import Point, merged
from drake_ispace.explain.predict.own_replay import OwnReplay
from drake_ispace.explain.predict.prediction import Prediction
from drake_ispace.explain.predict.tracks import Track

_NEARLY = 1.02  # times the least error, up to which a set of effects validates as well
_MOST_SETS = 64
_Set = tuple[Candidate, ...]


@dataclass(frozen=True)
class Choice:
    """The effects that cross-validation chooses.

    Attributes:
        sizes: of the named effects and of the plant's free parameters, fitted to all runs. base: of the plant's free
            parameters without any effect. rivals: other sets with as few parameters that validate as well.
        errors: set of effects -> root mean square error of the runs that it was not fitted to.
    """

    sizes: Sizes
    base: Sizes
    rivals: list[_Set]
    errors: dict[_Set, float]

    @property
    def named(self) -> _Set:
        """The chosen effects."""
        return tuple(self.sizes.point)


def validated_choice(
    prediction: Prediction, tried: Sequence[Candidate], tell: Callable[[str], None] = lambda text: None
) -> Choice:
    """Choose the effects with the fewest parameters that simulate these runs as well as any set of `tried`.

    prediction: of the runs of a user's own plant. tell: called with each set of effects and its error.

    Raises:
        InputError: a single run, or effects that make too many sets.
    """
    replay, tracks = prediction.replay, prediction.tracks
    if len(tracks) < 2:
        raise InputError(f"{tracks[0].name}: is the only run, expected two at least: one half validates the other")
    scales, error_of_set = scales_of(prediction), {}
    for names in _sets(tried):
        error_of_set[names] = _validated(replay, tracks, start_of(names, scales))
        label = " + ".join(candidate.label for candidate in names) or "no effect"
        tell(f"{label}: {error_of_set[names]:.3g} {unit_of(replay)}")
    least_error = min(error_of_set.values())
    enough = [names for names, error in error_of_set.items() if error <= _NEARLY * least_error]
    least = min(_parameters(names) for names in enough)
    fewest = [names for names in enough if _parameters(names) == least]
    best = min(fewest, key=error_of_set.get)
    rivals = [names for names in fewest if names != best]
    base = fitted(replay, tracks, {})
    return Choice(fitted(replay, tracks, start_of(best, scales)) if best else base, base, rivals, error_of_set)


def _sets(tried) -> list[_Set]:
    """Every set of effects, each with one choice of wheel at most, the smallest first."""
    names = list(dict.fromkeys(candidate.name for candidate in tried))
    count = np.prod([1.0 + sum(candidate.name == name for candidate in tried) for name in names])
    if count > _MOST_SETS:
        raise InputError(
            f"effects: {len(names)} make {count:.0f} sets that would all be fitted, expected fewer effects "
            f"({_MOST_SETS} sets at most)"
        )
    return [
        chosen for k in range(len(names) + 1) for chosen in combinations(tried, k)
        if len({candidate.name for candidate in chosen}) == k
    ]


def _parameters(names):
    """How many parameters these effects have together."""
    return sum(len(candidate.parameters) for candidate in names)


def start_of(names: Sequence[Candidate], scales: Mapping[str, float]) -> Point:
    """Each effect at its largest probe."""
    point = {}
    for candidate in names:
        columns = zip(*probes(candidate, scales), strict=True)
        point[candidate] = [
            max(column, key=lambda z, n=neutral: abs(z - n))
            for column, neutral in zip(columns, candidate.neutral, strict=True)
        ]
    return point


def _validated(replay: OwnReplay, tracks: Sequence[Track], start: Point) -> float:
    """Root mean square error on each half of the runs of what is fitted to the other half."""
    halves, differences = (tracks[::2], tracks[1::2]), []
    for fitted_to, judged in (halves, halves[::-1]):
        sizes = fitted(replay, fitted_to, start)
        differences += [errors(replay, track, merged(sizes.point), sizes.plant).ravel() for track in judged]
    return rms(np.concatenate(differences))
