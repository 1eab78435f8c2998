"""Held-out runs that move as no training run does are no test of an answer, and say what to train on."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import answers
from drake_ispace.blocks.rates import TICK_S
from drake_ispace.explain.answer.missing_motion import advise_missing_motion
from drake_ispace.plants.wheels import mecanum
from drake_ispace.scenario import load_scenario

WHEELS = mecanum(0.05, 0.15, 0.14)
PLANT = SimpleNamespace(geometry=WHEELS)
REPLAY = SimpleNamespace(body=SimpleNamespace(plant=PLANT, wheels=4))
MODEL = load_scenario("omni_multirate")


def predicted(**runs):
    """Runs of these velocities, held for ten seconds."""
    t = TICK_S * np.arange(2001)
    tracks = [
        SimpleNamespace(name=name, turned=np.outer(t, WHEELS.inverse @ velocity), fix_t=[], since_s=0.0, command=None)
        for name, velocity in runs.items()
    ]
    return SimpleNamespace(replay=REPLAY, tracks=tracks)


def advice(held_out, training=(0.3, 0.0, 0.01), verdict="unknown", most=("c",)):
    left = [replace(answers.LEFT, runs=list(most))]
    answer = answers.named(MODEL, verdict=verdict, remainders=left, next_experiment="another")
    answer.effects = [] if verdict == "unknown" else answer.effects
    case = SimpleNamespace(scenario=MODEL, prediction=predicted(a=training), held_out=predicted(c=held_out))
    advise_missing_motion(answer, case)
    return answer.next_experiment


@pytest.mark.parametrize("held_out, training, said", [
    ((0.2, 0.2, 0.0), (0.3, 0.0, 0.01), "moving sideways"),
    ((0.2, 0.0, 0.8), (0.3, 0.0, 0.01), "turning"),
    ((0.2, 0.2, 0.8), (0.3, 0.0, 0.01), "moving sideways and on turning"),
    ((0.2, 0.2, 0.0), (0.0, 0.3, 0.01), "driving ahead and back"),
])
def test_it_says_what_training_runs_lack(held_out, training, said):
    assert advice(held_out, training) == (
        f"train on {said} as well: training runs hardly do so, and most is left in c, which does"
    )


@pytest.mark.parametrize("change", [
    {"training": (0.2, 0.2, 0.0)}, {"verdict": "named"}, {"most": ("a",)}, {"held_out": (0.3, 0.02, 0.0)},
], ids=["trained", "nothing left", "left elsewhere", "hardly held out either"])
def test_otherwise_the_advice_stays(change):
    assert advice(**{"held_out": (0.2, 0.2, 0.0)} | change) == "another"


def test_without_held_out_runs_the_advice_stays():
    answer = answers.named(MODEL, verdict="unknown", remainders=[answers.LEFT], next_experiment="another")
    advise_missing_motion(answer, SimpleNamespace(scenario=MODEL, held_out=None))
    assert answer.next_experiment == "another"


def test_what_tells_look_alikes_of_a_named_effect_apart_is_still_said():
    assert advice((0.2, 0.2, 0.0), verdict="incomplete").endswith("which does; another")
