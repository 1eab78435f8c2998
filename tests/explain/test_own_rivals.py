"""Look-alikes of the effects of a plant of one's own: which they are, and which of them whole runs prefer."""

import pytest
from test_own_asked import INERTIA, VISCOUS, run
from test_own_drives import model, told_apart

from drake_ispace.explain.decide.decide import decide
from drake_ispace.explain.decide.rivals import with_rival_named
from drake_ispace.explain.decide.survey.screen import Screen
from drake_ispace.explain.fit.candidates import candidates
from drake_ispace.explain.fit.likelihood import fit
from drake_ispace.explain.predict.case import prepare
from drake_ispace.explain.prove.own.instead import preferred_by_runs


@pytest.fixture(scope="module")
def decided():
    """(model and runs, Decision) of a drive whose friction is stronger than the model's, and its candidates by name."""
    effects = told_apart("viscous_friction", "torque_gain_error", "encoder_scale", "encoder_lost_counts")
    case = prepare(model(INERTIA, 0.8 * VISCOUS), [run(k) for k in (1, 2, 3)], effects=effects)
    tried = candidates(case.effects_to_try, case.replay.body)
    return case.prediction, decide(case.prediction, tried, 0), {candidate.name: candidate for candidate in tried}


def naming(decision, instead):
    """The Decision that names another effect in the place of the only one."""
    (effect,) = decision.named.point
    return with_rival_named(decision, effect, instead, fit(decision.end.likelihood, {instead: list(instead.neutral)}))


def test_whole_runs_choose_between_look_alikes(decided):
    prediction, decision, tried = decided
    assert [candidate.name for candidate in decision.named.point] == ["viscous_friction"]
    wrong = naming(decision, tried["torque_gain_error"])
    rivals = [rival.candidate.name for rival in wrong.rivals[tried["torque_gain_error"]]]
    assert "viscous_friction" in rivals
    assert list(preferred_by_runs(prediction, wrong).named.point) == [tried["viscous_friction"]]
    assert preferred_by_runs(prediction, decision) is None


def test_what_explains_as_much_is_a_rival_however_unlike_it_looked_at_first(decided, monkeypatch):
    _, decision, tried = decided
    monkeypatch.setattr(Screen, "alike", lambda *given: 0.0)
    wrong = naming(decision, tried["encoder_scale"])
    rivals = [rival.candidate.name for rival in wrong.rivals[tried["encoder_scale"]]]
    assert "viscous_friction" in rivals and not decision.rivals[tried["viscous_friction"]]
