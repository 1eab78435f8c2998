"""Effects that are doubtful, or in doubt, are named only where the answer does not suffice without them.

Further ones are named where it does not suffice without them either.
"""

from dataclasses import dataclass, field
from types import SimpleNamespace

import pytest

from drake_ispace.explain import best_answer
from drake_ispace.explain.best_answer import Answered, best_answered
from drake_ispace.explain.decide.decision import Asked

BODY = SimpleNamespace(robot=SimpleNamespace(driven="torque"))
CASE = SimpleNamespace(scenario="one", is_filtered=True, replay=SimpleNamespace(body=BODY))


@pytest.fixture(autouse=True)
def all_makes_sense(monkeypatch):
    """Answers here have no sizes and no gap."""
    monkeypatch.setattr(best_answer, "nonsense", lambda answer: (set(), ""))
    monkeypatch.setattr(best_answer, "doubtful", lambda answer, case, proof: {})


def decided(names, in_doubt=False, total_gain=1.0):
    """A Decision that names these effects, each of which gains 1, and can name others or none."""
    point = {Named(name): [1.0] for name in names}
    return SimpleNamespace(
        named=SimpleNamespace(point=point), detection=SimpleNamespace(in_doubt=in_doubt), kept={}, rivals={},
        gains=dict.fromkeys(point, 1.0), total_gain=total_gain,
        with_effects=lambda kept: decided([c.name for c in kept], total_gain=total_gain),
        without_effects=lambda: decided([]),
    )


def none_without(names):
    raise AssertionError(f"decided without {names}")


def best_of(first, answered, decided_without=none_without):
    return best_answered(CASE, first, answered, decided_without)


def proved(decision, answer, asked=None, unconfirmed=(), instead=None):
    proof = SimpleNamespace(by="leave-one-run-out", asked=asked, unconfirmed=unconfirmed, instead=instead)
    return Answered(decision, proof, answer)


class Named:
    """A candidate."""

    def __init__(self, name):
        self.name = name


@pytest.mark.parametrize(("small", "in_doubt", "enough", "left"), [
    ([], False, set(), {"slip", "lag"}),
    (["lag"], False, {"slip"}, {"slip"}), (["lag"], False, {"lag"}, {"slip", "lag"}),
    (["slip", "lag"], False, set(), set()), ([], True, set(), set()), ([], True, {"slip"}, {"slip", "lag"}),
])
def test_it_is_tried_without_them(monkeypatch, small, in_doubt, enough, left):
    def answered(decision):
        names = {candidate.name for candidate in decision.named.point}
        effects = [SimpleNamespace(name=name, parameters={}) for name in sorted(names)]
        verdict = "incomplete" if not enough <= names else "named" if names else "none"
        return proved(decision, SimpleNamespace(verdict=verdict, effects=effects, warnings=[]))

    monkeypatch.setattr(best_answer, "doubtful", lambda answer, case, proof: dict.fromkeys(small, "why"))
    best = best_of(answered(decided(["slip", "lag"], in_doubt)), answered)
    assert {effect.name for effect in best.answer.effects} == {c.name for c in best.decision.named.point} == left
    assert any("trace" in warning for warning in best.answer.warnings) == (left != {"slip", "lag"})


@pytest.mark.parametrize("left_out, left", [(set(), {"slip", "lag"}), ({"lag"}, {"slip"}), ({"slip", "lag"}, set())])
def test_nonsense_is_not_named(monkeypatch, left_out, left):
    def answered(decision):
        effects = [SimpleNamespace(name=candidate.name, parameters={}) for candidate in decision.named.point]
        return proved(decision, SimpleNamespace(verdict="unknown", effects=effects, warnings=[], gap=[], remainders=[]))

    def senseless(answer):
        return left_out if len(answer.effects) == 2 else set(), "so it is"

    monkeypatch.setattr(best_answer, "nonsense", senseless)
    monkeypatch.setattr(best_answer, "_needed", lambda case, best: best.decision)
    best = best_of(answered(decided(["slip", "lag"])), answered)
    assert {effect.name for effect in best.answer.effects} == {c.name for c in best.decision.named.point} == left
    assert any("no sense: so it is" in warning for warning in best.answer.warnings) == bool(left_out)


@pytest.mark.parametrize(("more", "left"), [(0.0, ["slip"]), (-0.5, ["slip"]), (0.5, ["slip", "lag"])])
def test_a_small_effect_is_not_named_where_an_answer_that_does_not_suffice_leaves_no_more_without(
    monkeypatch, more, left
):
    def answered(decision):
        effects = [SimpleNamespace(name=candidate.name, parameters={}) for candidate in decision.named.point]
        remainders = [SimpleNamespace(ratio=2.0 if len(effects) == 2 else 2.0 + more)]
        answer = SimpleNamespace(verdict="unknown", effects=effects, warnings=[], gap=[], remainders=remainders)
        return proved(decision, answer)

    monkeypatch.setattr(best_answer, "doubtful", lambda answer, case, proof: {
        effect.name: "lag is small" for effect in answer.effects if effect.name == "lag"
    })
    monkeypatch.setattr(best_answer, "_needed", lambda case, best: best.decision)
    best = best_of(answered(decided(["slip", "lag"])), answered)
    assert [effect.name for effect in best.answer.effects] == left
    assert any("lag is small" in said for said in best.answer.warnings) == (len(left) == 1)


@pytest.mark.parametrize(("doubted", "left"), [
    (["slip", "lag"], []), (["slip"], ["slip", "lag"]), ([], ["slip", "lag"]),
])
def test_nothing_is_named_where_every_effect_of_an_answer_that_does_not_suffice_is_doubtful(monkeypatch, doubted, left):
    def answered(decision):
        effects = [SimpleNamespace(name=candidate.name, parameters={}) for candidate in decision.named.point]
        remainders = [SimpleNamespace(ratio=4.0 - len(effects))]
        verdict = "incomplete" if effects else "unknown"
        answer = SimpleNamespace(verdict=verdict, effects=effects, warnings=[], gap=[], remainders=remainders)
        return proved(decision, answer)

    monkeypatch.setattr(best_answer, "doubtful", lambda answer, case, proof: {
        effect.name: f"{effect.name} may be none" for effect in answer.effects if effect.name in doubted
    })
    monkeypatch.setattr(best_answer, "_with_further", lambda first, answered: first)
    first = decided(["slip", "lag"])
    first.otherwise = None
    best = best_of(answered(first), answered)
    assert [effect.name for effect in best.answer.effects] == left
    assert any("lag may be none" in said for said in best.answer.warnings) == (not left)


@pytest.mark.parametrize(("unconfirmed", "left"), [
    ({"slip lag": ["lag"]}, ["slip"]),
    ({"slip lag": ["lag", "slip"]}, ["slip"]),  # which is confirmed without the other one
    ({"slip lag": ["lag", "slip"], "slip": ["slip"]}, []),
])
def test_what_unseen_runs_do_not_confirm_is_not_named_even_where_the_rest_does_not_suffice(
    monkeypatch, unconfirmed, left
):
    def answered(decision):
        names = [candidate.name for candidate in decision.named.point]
        effects = [SimpleNamespace(name=name, parameters={}) for name in names]
        answer = SimpleNamespace(verdict="incomplete", effects=effects, warnings=[], gap=[], remainders=[])
        return proved(decision, answer, unconfirmed=unconfirmed.get(" ".join(names), []))

    monkeypatch.setattr(best_answer, "doubtful", lambda answer, case, proof: dict.fromkeys(proof.unconfirmed, "why"))
    monkeypatch.setattr(best_answer, "_with_further", lambda first, answered: first)
    first = decided(["slip", "lag"])
    first.otherwise = None
    best = best_of(answered(first), answered)
    assert [effect.name for effect in best.answer.effects] == left
    assert len(best.answer.warnings) == 2 - len(left) and all("no nearer" in said for said in best.answer.warnings)


@pytest.mark.parametrize(("unconfirmed", "total_gain", "left", "verdict"), [
    ({}, 2.0, ["slip", "lag"], "named"),
    ({"slip lag": ["lag"]}, 2.0, ["slip"], "incomplete"),
    ({"slip lag": ["lag"]}, 200.0, ["slip"], "named"),
    ({"slip lag": ["lag"], "slip": ["slip"]}, 2.0, [], "unknown"),
])
def test_what_is_left_of_an_answer_on_a_plant_of_ones_own_is_none(unconfirmed, total_gain, left, verdict):
    """The effect that unseen runs rule out stood for something that is missing, unless it explained next to nothing."""
    def answered(decision):
        names = [candidate.name for candidate in decision.named.point]
        effects = [SimpleNamespace(name=name, parameters={}) for name in names]
        answer = SimpleNamespace(verdict="named" if names else "none", effects=effects, warnings=[], gap=[])
        return proved(decision, answer, unconfirmed=unconfirmed.get(" ".join(names), []))

    own = SimpleNamespace(scenario=None, is_filtered=True, replay=CASE.replay)
    first = answered(decided(["slip", "lag"], total_gain=total_gain))
    best = best_answered(own, first, answered, none_without)
    assert [effect.name for effect in best.answer.effects] == left and best.answer.verdict == verdict
    assert len(best.answer.warnings) == 2 - len(left) and all("likelier without" in w for w in best.answer.warnings)


@dataclass
class Keeping:
    """A Decision that names the effects of a point."""

    point: dict
    kept: dict = field(default_factory=dict)
    rivals: dict = field(default_factory=dict)
    otherwise: None = None

    def with_effects(self, point):
        return Keeping(point, self.kept)


@pytest.mark.parametrize(("verdict", "after", "names"), [
    ("incomplete", 1.5, {"lag", "radii"}), ("incomplete", 2.5, {"radius"}), ("named", 1.5, {"radius"}),
])
def test_what_is_asked_for_is_named_if_an_answer_does_not_suffice_and_gets_no_worse(monkeypatch, verdict, after, names):
    monkeypatch.setattr(best_answer, "_needed", lambda case, best: best.decision)
    monkeypatch.setattr(best_answer, "_with_further", lambda first, answered: first)
    radii, first = Named("radii"), Keeping({"radius": [0.1]})

    def answered(one):
        remainders = [SimpleNamespace(ratio=2.0 if one is first else after)]
        said = verdict if one is first else "incomplete"
        asked = (lambda: Asked(radii, {"radii": [0.1], "lag": [0.2]})) if one is first else None
        effects = [SimpleNamespace(name=name, parameters={}) for name in one.point]
        answer = SimpleNamespace(verdict=said, effects=effects, remainders=remainders, warnings=[])
        return proved(one, answer, asked)

    best = best_of(answered(first), answered)
    assert set(best.decision.point) == {effect.name for effect in best.answer.effects} == names
    assert (radii in best.decision.kept) == (best.decision is not first)


def with_further(ratios, enough_at=None):
    """What `_with_further` says of decisions that each name one effect more and leave errors of these ratios."""
    chain = SimpleNamespace(further=[], number=len(ratios) - 1)
    for number in range(len(ratios) - 1)[::-1]:
        named = range(number + 2)
        chain = SimpleNamespace(further=[named], number=number, with_effects=lambda point, one=chain: one)

    def answered(decision):
        remainders = [SimpleNamespace(ratio=ratio) for ratio in ratios[decision.number]]
        verdict = "set" if decision.number == enough_at else "incomplete"
        return proved(decision, SimpleNamespace(verdict=verdict, effects=["one"], remainders=remainders))

    best = best_answer._with_further(answered(chain), answered)
    assert (best.decision.number == enough_at) == (best.answer.verdict == "set")
    return best.decision.number


def test_effects_are_added_until_they_suffice():
    assert with_further([[4.8, 4.7], [4.8], []], enough_at=2) == 2


def test_effects_that_come_no_nearer_or_never_suffice_are_not_added():
    assert with_further([[4.8], [4.8], []], enough_at=2) == 0
    assert with_further([[4.8], [3.0], [2.0]]) == 0


def test_effects_that_take_too_little_to_ever_suffice_are_no_longer_added():
    assert with_further([[4.8], [4.7], []], enough_at=2) == 0


@pytest.mark.parametrize("ratio, name", [(1.5, "gain"), (2.5, "scale")])
def test_a_look_alike_that_runs_prefer_takes_the_name_unless_more_is_left(ratio, name):
    def answered(decision):
        (effect,) = decision.named.point
        left = [SimpleNamespace(ratio=2.0 if effect.name == "scale" else ratio)]
        effects = [SimpleNamespace(name=effect.name, parameters={})]
        answer = SimpleNamespace(verdict="unknown", effects=effects, warnings=[], gap=[], remainders=left)
        return proved(decision, answer, instead=lambda: decided(["gain"]) if effect.name == "scale" else None)

    best = best_of(answered(decided(["scale"])), answered)
    assert [effect.name for effect in best.answer.effects] == [name]


@pytest.mark.parametrize("on_bound, suffices, others, named", [
    (True, True, ["lag", "delay"], ["lag", "delay"]), (True, False, ["lag", "delay"], ["swing"]),
    (False, True, ["lag", "delay"], ["swing"]), (True, True, [], ["swing"]),
])
def test_effects_that_suffice_without_one_on_its_bound_take_its_place(on_bound, suffices, others, named):
    def answered(decision):
        names = [candidate.name for candidate in decision.named.point]
        size = SimpleNamespace(on_bound=on_bound and names == ["swing"])
        effects = [SimpleNamespace(name=name, parameters={"size": size}) for name in names]
        verdict = "incomplete" if not suffices or names == ["swing"] else "named" if names else "none"
        answer = SimpleNamespace(verdict=verdict, effects=effects, warnings=[], gap=[], remainders=[], drifts=[])
        return proved(decision, answer)

    def settled(names):
        return SimpleNamespace(**vars(decided(names)) | {"further": [], "otherwise": None})

    def without(names):
        assert names == {"swing"}
        return settled(others)

    best = best_of(answered(settled(["swing"])), answered, without)
    assert sorted(effect.name for effect in best.answer.effects) == sorted(named)
