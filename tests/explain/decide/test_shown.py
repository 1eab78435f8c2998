"""Effects must raise an alarm by themselves, also under noise that leaves less to be seen. By linear predictions."""

from types import SimpleNamespace

import numpy as np
import pytest

from drake_ispace.explain.decide import shown
from drake_ispace.explain.decide.decide import decide
from drake_ispace.explain.decide.survey.survey import survey
from stand_ins.linear import RUNS, Linear, made, no_generics, noise, pattern

SHAPES = {name: pattern(number) for number, name in enumerate(("tilt", "lag", "drag"))}


def surveyed(**hidden):
    """The survey of runs in which effects of these sizes are hidden."""
    measured = noise() + sum(size * SHAPES[name] for name, size in hidden.items())
    return survey(Linear(measured, SHAPES), {}, made(*SHAPES), generics=no_generics)


def doubted(monkeypatch, **minus_log10_p):
    """Let every alarm be doubted by a survey in which the tests of the effects come to these -log10 p."""
    def doubting(current):
        by_itself = np.array([minus_log10_p[candidate.name] for candidate in current.screen.candidates])
        yield SimpleNamespace(screen=current.screen, by_instant=current.by_instant, minus_log10_p=by_itself)

    monkeypatch.setattr(shown, "_doubting", doubting)


def names(proposals):
    return {proposal.candidate.name for proposal in proposals}


def test_what_shows_is_no_clearer_than_where_it_is_doubted(monkeypatch):
    doubted(monkeypatch, tilt=5.0, lag=20.0, drag=0.0)
    found = shown.shown_at(surveyed(tilt=0.2, lag=0.2), 0)
    assert {p.candidate.name: p.minus_log10_p for p in found.proposals}["tilt"] == 5.0
    assert found.detection.found and names(found.proposals) == {"tilt", "lag"}


def test_an_effect_that_does_not_hold_is_not_shown_although_another_one_does(monkeypatch):
    doubted(monkeypatch, tilt=0.5, lag=20.0, drag=0.0)
    found = shown.shown_at(surveyed(tilt=0.25, lag=0.2), 0)
    assert found.detection.found and names(found.proposals) == {"lag"} and names(found.tried) == {*SHAPES}


def test_an_alarm_that_no_effect_holds_is_none(monkeypatch):
    doubted(monkeypatch, tilt=0.5, lag=0.5, drag=0.0)
    found = shown.shown_at(surveyed(tilt=0.25), 0)
    assert not found.detection.found and not found.proposals and found.tried


def test_an_alarm_beyond_doubt_is_not_doubted(monkeypatch):
    doubted(monkeypatch, tilt=0.5, lag=0.5, drag=0.0)
    assert "tilt" in names(shown.shown_at(surveyed(tilt=0.8), 0).proposals)


def test_noise_shows_nothing():
    found = shown.shown_at(surveyed(), 0)
    assert not found.detection.found and not found.proposals and not found.disagreements


@pytest.mark.parametrize("least, expected", [(5.0, {"tilt"}), (7.0, {"tilt", "lag"})])
def test_a_further_effect_must_be_as_clear_where_it_is_doubted(monkeypatch, least, expected):
    doubted(monkeypatch, tilt=30.0, lag=least, drag=0.0)
    measured = noise() + 0.8 * SHAPES["tilt"] + 0.25 * SHAPES["lag"]
    decision = decide(Linear(measured, SHAPES), made(*SHAPES), 0, generics=no_generics)
    assert {candidate.name for candidate in decision.named.point} == expected


@pytest.mark.parametrize("tracks, driven, is_tried", [
    (1, "torque", False), (RUNS, "torque", True), (1, "command", True),
])
def test_what_does_not_show_is_tried_unless_there_is_a_single_run_under_torque(monkeypatch, tracks, driven, is_tried):
    body = SimpleNamespace(wheels=1, robot=SimpleNamespace(driven=driven, in_room=True))
    monkeypatch.setattr(Linear, "replay", SimpleNamespace(body=body))
    monkeypatch.setattr(Linear, "tracks", Linear.tracks * tracks)
    decision = decide(Linear(noise() + 0.8 * SHAPES["tilt"], SHAPES), made(*SHAPES), 0, generics=no_generics)
    further = [{candidate.name for candidate in point} for point in decision.further]
    assert sorted(map(sorted, further)) == [["drag", "tilt"], ["lag", "tilt"]] * is_tried
    assert decision.left_over is None
