"""What whole runs of a user's own drive ask for: sizes are fitted to some runs, and others are simulated with them."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from test_own_drives import STEP_S, logged, model, told_apart, unknown, wished

import drake_ispace as di
from drake_ispace.explain.decide.survey.survey import survey
from drake_ispace.explain.fit.candidates import candidates
from drake_ispace.explain.predict.case import prepare
from drake_ispace.explain.prove.own.asked import asked_for_own

INERTIA, VISCOUS = 0.1, 0.05
FEW = told_apart("motor_offset", "coulomb_friction", "torque_gain_error")


def run(seed, offset=0.0, spring=0.0, coulomb=0.0, push=0.01, seconds=8.0):
    """A drive with viscous friction that is told to go to and fro; offset, spring, coulomb: [N m], [N m/rad], [N m]."""
    generator = np.random.default_rng(seed)
    t, _, wish = wished(generator, seconds)
    told = np.repeat(10.0 * INERTIA * wish[::5], 5)
    torques = told + offset + push * told.std() * unknown(generator, len(t))
    angles, speed = np.zeros(len(t)), 0.0
    for i, torque in enumerate(torques[:-1]):
        braking = VISCOUS * speed + coulomb * np.clip(speed / 1e-3, -1.0, 1.0)
        speed += STEP_S * (torque - spring * angles[i] - braking) / INERTIA
        angles[i + 1] = angles[i] + STEP_S * speed
    return logged(generator, t, told, angles, 1e-3, 5)


def asked(runs, is_lacking=False):
    case = prepare(model(INERTIA, VISCOUS), runs, effects=FEW)
    decision = SimpleNamespace(
        named=None, end=survey(case.prediction, {}, candidates(case.effects_to_try, case.replay.body))
    )
    return asked_for_own(case.prediction, decision, is_lacking)


def test_a_small_constant_torque_is_named():
    found = di.explain(model(INERTIA, VISCOUS), [run(k, offset=0.02) for k in (1, 2)], effects=FEW)
    assert found.verdict == "named" and [effect.name for effect in found.effects] == ["motor_offset"]
    assert found.effects[0].parameters["offset_n_m"].estimate == pytest.approx(0.02, abs=0.004)


@pytest.mark.parametrize("offset", [0.02, -0.02])
def test_whole_runs_ask_for_what_adds_up(offset):
    found = asked([run(k, offset) for k in (1, 2, 3)])
    assert found.effect.name == "motor_offset" and found.rivals == []
    assert found.point[found.effect] == [pytest.approx(offset, abs=0.004)]


def test_a_single_run_is_cut_into_blocks():
    assert asked([run(1, 0.05, seconds=20.0)], is_lacking=True).effect.name == "motor_offset"


def test_a_run_that_is_too_short_to_be_cut_asks_for_nothing():
    assert asked([run(1, 0.05, seconds=4.0)], is_lacking=True) is None


@pytest.mark.first_case
@pytest.mark.parametrize("seed", range(4))
def test_sound_runs_ask_for_nothing(seed):
    assert asked([run(10 * seed + k) for k in (1, 2, 3)]) is None


@pytest.mark.slow
def test_a_spring_is_unknown_and_goes_with_the_angle_of_the_wheel():
    found = di.explain(model(INERTIA, VISCOUS), [run(k, spring=0.05) for k in (1, 2)], effects=FEW)
    assert found.verdict == "unknown" and found.unknown.driver == "wheel angle"


@pytest.mark.slow
def test_what_whole_runs_ask_for_is_named_and_said():
    """A friction no larger than a sound drive may have, as far as coarse counts show it one after the other."""
    runs = [_counted(run(k, coulomb=0.008, push=0.0), 0.05) for k in range(4)]
    found = di.explain(model(INERTIA, VISCOUS), runs, effects=FEW)
    assert found.verdict == "named" and [effect.name for effect in found.effects] == ["coulomb_friction"]
    assert found.effects[0].parameters["torque_n_m"].estimate == pytest.approx(0.008, abs=0.001)
    assert found.detection.p_value > found.detection.false_alarm_rate
    assert any("whole runs ask for coulomb_friction" in warning for warning in found.warnings)


def _counted(recording, count):
    encoder = recording.channels["encoder"]
    coarse = replace(encoder, values=count * np.floor(encoder.values / count + 0.5))
    return replace(recording, channels=recording.channels | {"encoder": coarse})
