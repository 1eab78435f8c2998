"""The whole library: cards and numbers that make sense, a page about them, and effects of other people."""

import importlib.util
import math
import re
import runpy
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import yaml

from drake_ispace.blocks.block import Block
from drake_ispace.blocks.errors import InputError
from drake_ispace.effects import library as library_module
from drake_ispace.effects.card import HOMES, SCALES, Card
from drake_ispace.effects.document import effects_markdown
from drake_ispace.effects.effect import BlockEffect, Effect, PlantEffect, body_of
from drake_ispace.effects.library import library
from drake_ispace.robots.library import robots
from drake_ispace.rollout.engine import simulate_compiled
from drake_ispace.scenario import Scenario, load_scenario
from drake_ispace.wiring.catalog import build_diagram

WIRES = ("torque", "ground_force", "wheel_angle", "body_motion", "pose", "fix", "velocity")
PAGE = Path(__file__).parents[2] / "docs" / "effects.md"
BODIES = [body_of(Scenario(), robot) for robot in robots().values()]
EVERY = [
    pytest.param(effect, body, id=f"{name}-{body.name}") for name, effect in library().items() for body in BODIES
    if effect.applies_to(body)
]


# Cards


def test_no_two_effects_have_one_name():
    names = [effect.card.name for place in library_module._PLACES for effect in place.EFFECTS]
    assert len(set(names)) == len(names) == len(library())


@pytest.mark.parametrize("name", library())
def test_a_card_says_everything(name):
    card = library()[name].card
    assert card.name == name and re.fullmatch(r"[a-z]+(_[a-z]+)*", name)
    texts = (card.title, card.home, card.equation, card.source, card.signature, card.excitation)
    assert all(text and text == text.strip() and not text.endswith(".") and "\n" not in text for text in texts)
    assert card.home in HOMES


@pytest.mark.parametrize("name", library())
def test_look_alikes_are_other_effects(name):
    look_alikes = library()[name].card.look_alikes
    assert look_alikes and name not in look_alikes and len(set(look_alikes)) == len(look_alikes)
    assert set(look_alikes) <= set(library())


@pytest.mark.parametrize("name", library())
def test_an_effect_has_a_place_and_a_robot(name):
    effect = library()[name]
    assert any(effect.applies_to(body) for body in BODIES)
    assert isinstance(effect, PlantEffect) or (isinstance(effect, BlockEffect) and effect.wire in WIRES)
    assert effect.__doc__


# Numbers


@pytest.mark.parametrize("effect, body", EVERY)
def test_parameters_and_probes_lie_within_bounds(effect, body):
    parameters = effect.parameters_of(body)
    names = [p.name for p in parameters] + list(effect.choices)
    assert parameters and len(set(names)) == len(names)
    for p in parameters:
        assert p.unit and p.low < p.high and p.low <= p.neutral <= p.high and p.scale in ("", *SCALES)
        assert 1 <= len(p.probes) <= 4 and len(set(p.probes)) == len(p.probes)
        assert all(math.isfinite(probe) and probe != p.neutral for probe in p.probes)
        assert p.scale or all(p.low <= probe <= p.high for probe in p.probes)
        assert p.reciprocal or math.isfinite(p.neutral)


def numbers(effect, body, values):
    """Ports, states and parameters as the effect gives them at `values`."""
    if not isinstance(effect, BlockEffect):
        return effect.change(body.robot, body.plant, values)
    spec = effect.spec(body, values)
    Block(spec)  # every kernel's arguments are ports, states or parameters
    return spec


@pytest.mark.parametrize("effect, body", EVERY)
def test_values_change_numbers_and_nothing_else(effect, body):
    neutral = effect.neutral(body)
    probes = {p.name: min(max(p.probes[-1], p.low), p.high) for p in effect.parameters_of(body)}
    one, other = numbers(effect, body, neutral), numbers(effect, body, neutral | probes)
    if not isinstance(effect, BlockEffect):
        assert type(one) is type(other) is type(body.plant) and one != other
        return
    assert effect.wire in one.inputs and one.inputs[effect.wire] == one.outputs[effect.wire].size
    assert (one.inputs, one.outputs, one.updates, one.derivatives) == (
        other.inputs, other.outputs, other.updates, other.derivatives
    )
    assert one.parameter_names == other.parameter_names and np.size(one.discrete_state) == np.size(other.discrete_state)
    assert not np.array_equal(one.parameter_values, other.parameter_values)


@pytest.mark.parametrize("effect, body", EVERY)
def test_a_fit_may_put_any_value_within_bounds(effect, body):
    neutral = effect.neutral(body)
    at_neutral = numbers(effect, body, neutral)
    for p in effect.parameters_of(body):
        for value in filter(math.isfinite, (p.low, p.high)):
            found = numbers(effect, body, neutral | {p.name: value})
            if isinstance(effect, BlockEffect):
                assert found.parameter_names == at_neutral.parameter_names
                assert not np.isnan(found.parameter_values).any()
            else:
                assert type(found) is type(body.plant) and not re.search(r"\bnan\b", repr(found))
                assert (found == at_neutral) == (value == p.neutral)


# The page


def test_the_page_is_the_one_that_the_library_writes():
    expected = "run python -m drake_ispace.effects.document > docs/effects.md"
    assert PAGE.read_text(encoding="utf-8") == effects_markdown(), expected


def test_the_page_has_every_effect():
    headings = re.findall(r"^### (\w+)$", effects_markdown(), re.MULTILINE)
    assert sorted(headings) == sorted(library())


EXAMPLES = re.findall(r"^```yaml\n(.*?)^```$", effects_markdown(), re.MULTILINE | re.DOTALL)


@pytest.mark.parametrize("text", EXAMPLES[:-1], ids=[re.findall(r"^    (\w+):", t, re.M)[0] for t in EXAMPLES[:-1]])
def test_an_example_on_the_page_is_a_scenario(text, tmp_path):
    file = tmp_path / "example.yaml"
    file.write_text(text, encoding="utf-8")
    scenario = load_scenario(str(file))
    ((robot, settings),) = ((name, part) for name, part in yaml.safe_load(text).items() if name != "diagram")
    (name,) = settings["effects"]
    diagram = build_diagram(scenario)
    is_block = isinstance(library()[name], BlockEffect)
    assert diagram.HasSubsystemNamed(f"{robot}_{name}") == is_block


# Effects of other people


def test_the_effect_on_the_page_is_a_whole_file_that_runs(tmp_path, capsys):
    (text,) = re.findall(r"^```py\n(.*?)^```$", effects_markdown(), re.MULTILINE | re.DOTALL)
    file = tmp_path / "own_effect.py"
    file.write_text(text, encoding="utf-8")
    (effect,) = runpy.run_path(str(file), run_name="__main__")["EFFECTS"]
    assert re.fullmatch(r"\[.*\]\n", capsys.readouterr().out)
    assert effect.card.name == "cogging" and effect.card.name not in library()
    assert set(effect.card.look_alikes) <= set(library())
    assert effect.card.name in EXAMPLES[-1]


@pytest.fixture
def registered(monkeypatch):
    """Registers objects as entry points, as an installed package would."""
    def register(**objects):
        entries = [SimpleNamespace(name=name, load=lambda found=found: found) for name, found in objects.items()]
        monkeypatch.setattr(library_module, "entry_points", lambda group: {"drake_ispace.effects": entries}[group])
        library.cache_clear()

    yield register
    library.cache_clear()


@pytest.fixture
def own(own_effect_file):
    """The module of an effect of one's own."""
    spec = importlib.util.spec_from_file_location("own_effect", own_effect_file)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_an_effect_of_ones_own_is_one_more_in_the_library(registered, own):
    before = list(library())
    registered(own=own.EFFECTS)
    assert list(library()) == [*before, "torque_fade"]
    registered(own=own.EFFECTS[0])
    assert list(library()) == [*before, "torque_fade"]
    assert effects_markdown() == PAGE.read_text(encoding="utf-8")  # the page is about those of the package


def test_an_effect_of_ones_own_acts_in_a_run(registered, own):
    registered(own=own.EFFECTS)
    base, neutral, faded = (
        simulate_compiled(load_scenario("omni_multirate", ["seconds=1", *setting])).signals for setting in (
            [], ["omni.effects.torque_fade.loss_s_rad=0"], ["omni.effects.torque_fade.loss_s_rad=0.05"],
        )
    )
    assert all(np.array_equal(base[name], neutral[name]) for name in base)
    assert np.abs(faded["omni_velocity"] - base["omni_velocity"]).max() > 1e-3
    with pytest.raises(InputError, match=r"at most 0.1 \[s/rad\]"):
        load_scenario("omni_multirate", ["omni.effects.torque_fade.loss_s_rad=1"])


def test_what_is_no_effect_is_named(registered):
    registered(mine=3)
    with pytest.raises(InputError, match=r"entry point mine of drake_ispace\.effects: expected an Effect, got 3"):
        library()


def test_a_name_that_is_taken_is_refused(registered):
    class Second(Effect):
        card = Card("mass_error", "", "plant", "", "", "", (), "")

    registered(mine=[Second()])
    with pytest.raises(InputError, match="entry point mine: there is an effect mass_error already"):
        library()
