"""What these runs cannot show, however large it is."""

from collections.abc import Sequence

import numpy as np

from drake_ispace.explain.answer.explanation import NamedEffect, Untestable
from drake_ispace.explain.answer.next_experiment import needs
from drake_ispace.explain.decide.survey.generic import Generic
from drake_ispace.explain.decide.survey.screen import Screen
from drake_ispace.explain.levels import CERTAIN
from drake_ispace.explain.predict.case import Case


def cannot_show(case: Case, screen: Screen, effects: Sequence[NamedEffect]) -> list[Untestable]:
    """Effects, or some of their parameters, that chance would hide at the largest size that a search begins with.

    Whole effects come first, and those last that no motion shows.

    screen: of the model as given. effects: of the answer, which do show, and so do their look-alikes.
    """
    longest, driven = {}, case.replay.body.robot.driven
    answered = {name for effect in effects for name in (effect.name, *effect.equivalents)}
    for signature, length in zip(screen.signatures, screen.length, strict=True):
        if not isinstance(signature.candidate.effect, Generic):
            key = signature.candidate.name, signature.candidate.parameters[signature.at].name
            longest[key] = max(longest.get(key, 0.0), float(np.sqrt(max(length, 0.0))))
    found = []
    for name, effect in case.replay.effects.items():
        sizes = [p.name for p in effect.parameters_of(case.replay.body) if not p.shape]
        hidden = [size for size in sizes if longest.get((name, size), 0.0) < CERTAIN]
        if hidden and name not in answered:
            found.append(Untestable(name, needs(effect, driven), hidden if len(hidden) < len(sizes) else []))
    return sorted(found, key=lambda entry: (not case.replay.effects[entry.effect].in_motion, len(entry.parameters) > 0))


def in_motion(case: Case, untestable: Sequence[Untestable]) -> list[Untestable]:
    """Those that some motion shows."""
    return [entry for entry in untestable if case.replay.effects[entry.effect].in_motion]
