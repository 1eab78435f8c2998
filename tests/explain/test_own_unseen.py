"""What unseen runs of a user's own plant say against an answer: from read to read, and second by second."""

from dataclasses import replace

import numpy as np
import pytest
from test_own_asked import INERTIA, VISCOUS, run
from test_own_drives import STEP_S, logged, model, told_apart, unknown, wished

import drake_ispace as di
from drake_ispace.explain.fit.candidates import candidates
from drake_ispace.explain.fit.free_run import Sizes
from drake_ispace.explain.predict.case import prepare
from drake_ispace.explain.prove.errors.free_run import rms
from drake_ispace.explain.prove.own.runs import errors_of_runs, noise_of_runs
from drake_ispace.explain.prove.own.unseen import ruled_out


def elastic_run(seed, stiffness=15.0, motor=0.02, load=0.05, push=0.01, seconds=12.0):
    """A drive whose load hangs on a spring [N m/rad]; push: unknown torque [N m]."""
    generator = np.random.default_rng(seed)
    t, _, wish = wished(generator, seconds)
    told = np.repeat(10.0 * (motor + load) * wish[::5], 5)
    torques = told + push * unknown(generator, len(t))
    angles, speed, angle, turned, turns = np.zeros(len(t)), 0.0, 0.0, 0.0, 0.0
    for i, torque in enumerate(torques[:-1]):
        passed = stiffness * (angle - turned) + 0.05 * (speed - turns)
        speed, turns = speed + STEP_S * (torque - passed) / motor, turns + STEP_S * passed / load
        angle, turned = angle + STEP_S * speed, turned + STEP_S * turns
        angles[i + 1] = angle
    return logged(generator, t, told, angles, 1e-3, 5)


@pytest.mark.parametrize("offset, found", [(0.0, ["motor_offset"]), (0.05, [])])
def test_an_effect_that_an_unseen_run_does_not_have_is_ruled_out(offset, found):
    few = told_apart("motor_offset", "viscous_friction")
    case = prepare(model(INERTIA), [run(1, offset=0.05)], [run(2, offset=offset)], effects=few)
    tried = {one.name: one for one in candidates(case.effects_to_try, case.replay.body)}
    point = {tried["motor_offset"]: [0.05], tried["viscous_friction"]: [VISCOUS]}
    assert ruled_out(case.held_out, point) == found


def beyond_chance(plant, runs):
    """Horizon -> whether the model is off by more than torques as strong as assumed hardly ever make."""
    case = prepare(plant, runs, effects=told_apart("motor_offset"))
    replay, tracks, none = case.replay, case.prediction.tracks, Sizes({}, {})
    after = errors_of_runs(replay, tracks, none)
    *_, most = noise_of_runs(replay, tracks, none, after, 0, 40)
    return {m.horizon: rms([after[0][m]]) > most[m] for m in after[0] if m.unit == "rad"}


@pytest.mark.parametrize("push, found", [(0.01, False), (0.1, True)])
def test_a_second_is_off_by_no_more_than_torques_as_strong_as_told_make(push, found):
    assert beyond_chance(replace(model(INERTIA, VISCOUS), unknown_torque=0.01), [run(1, push=push)])["1s"] == found


def test_a_spring_shows_in_every_second_and_is_hidden_by_what_adds_up_over_a_run():
    assert beyond_chance(replace(model(0.07), unknown_torque=0.01), [elastic_run(1)]) == {"run": False, "1s": True}


@pytest.mark.slow
def test_an_effect_that_leaves_what_shows_in_every_second_is_no_answer():
    """From read to read a scale of the encoder takes the place of the spring that a rigid model lacks."""
    plant, runs = replace(model(0.07), unknown_torque=0.01), [elastic_run(k) for k in (1, 2, 3)]
    found = di.explain(plant, runs[:2], runs[2:], effects=told_apart("encoder_scale"))
    assert found.verdict in ("incomplete", "unknown") and [left.horizon for left in found.remainders] == ["1s"]
