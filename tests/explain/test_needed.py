"""Where more is detectable than explained, effects that free runs do not need are taken away."""

import importlib
from types import SimpleNamespace

import pytest

explained = importlib.import_module("drake_ispace.explain.explain")


class Candidate:
    def __init__(self, name):
        self.name = name


def decided(point, gains):
    """A Decision that names these effects, and can name others."""
    return SimpleNamespace(
        named=SimpleNamespace(point=point), gains=gains, renamed=lambda decision, other: decided(other, gains)
    )


@pytest.mark.parametrize("needed, left", [
    ({"slip"}, {"slip"}), ({"slip", "lag"}, {"slip", "lag"}), (set(), {"slip"}), ({"lag", "gain"}, {"lag", "gain"}),
])
def test_it_is_tried_without_each_the_smallest_first(monkeypatch, needed, left):
    known = {name: Candidate(name) for name in ("slip", "lag", "gain")}
    gains = {known["slip"]: 900.0, known["lag"]: 50.0, known["gain"]: 30.0}

    def answered(case, decision, seed, tell):
        names = {candidate.name for candidate in decision.named.point}
        effects = [SimpleNamespace(name=name, parameters={}) for name in names]
        return SimpleNamespace(verdict="named" if needed <= names else "incomplete", effects=effects, warnings=[])

    monkeypatch.setattr(explained, "_answered", answered)
    start = decided({candidate: [1.0] for candidate in known.values()}, gains)
    decision, answer = explained._needed(None, start, answered(None, start, 0, None), 0, None)
    assert {effect.name for effect in answer.effects} == left == {c.name for c in decision.named.point}
