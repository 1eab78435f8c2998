"""The scenario with the named effects in it, each of them a block of its Diagram or a number of the plant."""

import copy

import numpy as np

from drake_ispace.effects.library import library
from drake_ispace.explain.answer.explanation import Explanation
from drake_ispace.explain.fit.likelihood import Point
from drake_ispace.explain.predict.case import Case
from drake_ispace.scenario import difference


def add_effects(answer: Explanation, case: Case, point: Point) -> None:
    """Add the scenario with the effects of `point` to the answer, or a warning where a scenario cannot list them."""
    if foreign := [candidate.name for candidate in point if candidate.name not in library()]:
        answer.warnings.append(
            f"{', '.join(foreign)}: no entry point drake_ispace.effects, so there is no model with the effect in it"
        )
        return
    scenario = copy.deepcopy(case.scenario)
    section = getattr(scenario, case.robot)
    for candidate, z in point.items():
        together = case.replay.combined({candidate.name: candidate.values(z)})[candidate.name]
        values = {
            name: int(value) if name in dict(candidate.choices) else float(value)
            for name, value in together.items() if np.isfinite(value)
        }
        section.effects = {**section.effects, candidate.name: values}
    answer.model, answer.difference = scenario, difference(scenario)
