"""Stage 4 where runs are too short for the statistics of a filter: effects chosen by simulating whole runs.

Every set of effects is fitted to one half of the runs and judged on the other, both ways round, the free parameters of
the plant with it. Of the sets that do nearly as well as the best, the one with the fewest parameters is named: what is
fitted to noise helps on the runs that it was fitted to, and hardly on others. Parameters count and not effects, because
a Stribeck bump that reaches beyond the fastest run is a Coulomb friction with one parameter more.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from drake_ispace.blocks.errors import InputError
from drake_ispace.explain.answer.confirm import bootstrap_interval, closed_share
from drake_ispace.explain.answer.explanation import Gap
from drake_ispace.explain.answer.free_run import Sizes, errors, fitted, rms, unit_of
from drake_ispace.explain.decide.view import scales_of
from drake_ispace.explain.fit.candidates import Candidate, probes
from drake_ispace.explain.fit.likelihood import Point, merged
from drake_ispace.explain.predict.own_model import OwnReplay
from drake_ispace.explain.predict.prediction import Prediction
from drake_ispace.explain.predict.tracks import Track

_WORTH = 1.02  # times the least error: a set that validates as well
_MOST_SETS = 64
_REPLICATES = 500
_Set = tuple[Candidate, ...]


@dataclass(frozen=True)
class Choice:
    """What validation says.

    Attributes:
        sizes: of the named effects and the plant, fitted to all runs; base: of the plant without them. rivals: other
            sets with as few parameters that validate as well. errors: set -> error on the other half of the runs.
    """

    sizes: Sizes
    base: Sizes
    rivals: list[_Set]
    errors: dict[_Set, float]

    @property
    def named(self) -> _Set:
        return tuple(self.sizes.point)


def validated_choice(
    prediction: Prediction, tried: Sequence[Candidate], tell: Callable[[str], None] = lambda text: None
) -> Choice:
    """The effects with the fewest parameters that simulate these runs of a user's plant as well as any of `tried`.

    Raises:
        InputError: a single run, or effects that make too many sets.
    """
    replay, tracks = prediction.replay, prediction.tracks
    if len(tracks) < 2:
        raise InputError(f"{tracks[0].name}: is the only run, expected two at least: one half validates the other")
    scales, found = scales_of(prediction), {}
    for names in _sets(tried):
        found[names] = _validated(replay, tracks, _start(names, scales))
        label = " + ".join(candidate.label for candidate in names) or "no effect"
        tell(f"{label}: {found[names]:.3g} {unit_of(replay)}")
    enough = [names for names, error in found.items() if error <= _WORTH * min(found.values())]
    least = min(_parameters(names) for names in enough)
    fewest = [names for names in enough if _parameters(names) == least]
    best = min(fewest, key=found.get)
    rivals = [names for names in fewest if names != best]
    base = fitted(replay, tracks, {})
    return Choice(fitted(replay, tracks, _start(best, scales)) if best else base, base, rivals, found)


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
    return sum(len(candidate.parameters) for candidate in names)


def _start(names: _Set, scales: Mapping[str, float]) -> Point:
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
    """Error on each half of the runs of what is fitted to the other half."""
    halves, off = (tracks[::2], tracks[1::2]), []
    for fitted_to, judged in (halves, halves[::-1]):
        sizes = fitted(replay, fitted_to, start)
        off += [errors(replay, track, merged(sizes.point), sizes.plant).ravel() for track in judged]
    return rms(np.concatenate(off))


def held_out_gap(replay: OwnReplay, tracks: Sequence[Track], choice: Choice, seed: int) -> Gap | None:
    """What the named effects close of the error of free-run simulations of held-out runs; None where there is no gap.

    seed: of the bootstrap over runs.
    """
    floor = fitted(replay, tracks, choice.sizes.point)
    off = [
        [errors(replay, track, merged(sizes.point), sizes.plant) for track in tracks]
        for sizes in (choice.base, choice.sizes, floor)
    ]
    sums = [np.array([np.sum(run**2) for run in one]) for one in off]
    if sums[0].sum() <= sums[2].sum():
        return None
    draws = np.random.default_rng([seed, 2]).integers(0, len(tracks), size=(_REPLICATES, len(tracks)))
    before, after, least = (rms(np.concatenate([run.ravel() for run in one])) for one in off)
    interval = bootstrap_interval(sums, draws) if len(tracks) > 1 else (np.nan, np.nan)
    return Gap(before, after, least, closed_share(sums), interval, unit_of(replay))
