"""What these runs cannot show, and which of it is worth another experiment."""

from dataclasses import replace
from types import SimpleNamespace

import pytest

import answers
from drake_ispace.effects.effect import body_of
from drake_ispace.effects.library import library
from drake_ispace.explain.answer.explanation import Untestable
from drake_ispace.explain.answer.next_experiment import next_experiment
from drake_ispace.explain.answer.untestable import cannot_show, in_motion
from drake_ispace.explain.fit.candidates import candidates
from drake_ispace.robots.library import robots
from drake_ispace.scenario import Scenario, load_scenario

BODY = body_of(Scenario(), robots()["rover"])
AXES = {"camera_rotation", "camera_offset", "camera_dropouts"}


def case_of(*names):
    effects = {name: library()[name] for name in names}
    return SimpleNamespace(replay=SimpleNamespace(effects=effects, body=BODY))


def found(case, lengths, effects=()):
    """What is not shown where each parameter of the effects, in turn, has a signature as long as that."""
    tried = candidates(case.replay.effects, BODY)
    signatures = [SimpleNamespace(candidate=c, at=i) for c in tried for i in range(len(c.parameters))]
    screen = SimpleNamespace(signatures=signatures, length=[length**2 for length in lengths])
    return [entry.said for entry in cannot_show(case, screen, effects)]


@pytest.mark.parametrize("lengths, said", [
    ([9.0, 9.0], []), ([9.0, 0.0], ["constant_slip (ratio_y)"]), ([0.0, 1.0], ["constant_slip"]),
])
def test_each_parameter_must_show(lengths, said):
    assert found(case_of("constant_slip"), lengths) == said


@pytest.mark.parametrize("name, equivalents", [("track_error", []), ("wheel_toe", ["track_error"])])
def test_what_is_named_or_may_be_in_its_place_is_not_said_to_be_hidden(name, equivalents):
    (effect,) = answers.named(load_scenario("omni_multirate")).effects
    named = replace(effect, name=name, equivalents=equivalents)
    assert found(case_of("track_error"), [0.0], [named]) == [] != found(case_of("track_error"), [0.0])


def test_whole_effects_come_first():
    assert found(case_of("constant_slip", "track_error"), [9.0, 0.0, 0.0]) == ["track_error", "constant_slip (ratio_y)"]


def test_what_no_motion_shows_comes_last_and_is_no_advice():
    case = case_of("camera_rotation", "track_error")
    assert found(case, [0.0, 0.0]) == ["track_error", "camera_rotation"]
    hidden = [Untestable(name, "") for name in case.replay.effects]
    assert "camera_rotation" not in next_experiment([], None, in_motion(case, hidden))
    assert next_experiment([], None, in_motion(case, hidden[:1])) == ""


def test_only_the_axes_of_the_room_and_what_is_counted_show_in_no_motion():
    assert {name for name, effect in library().items() if not effect.in_motion} == AXES
