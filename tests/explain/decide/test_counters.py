"""Counters of encoders begin anywhere: what errs once a turn has another phase in each run."""

from dataclasses import replace

import numpy as np
import pytest

import drake_ispace as di
from drake_ispace.explain.decide.counters import with_counters_set
from drake_ispace.explain.predict.case import prepare
from hidden import two_wheels
from hidden.generator import generate

ECCENTRIC = {"encoder_eccentricity": {"wheel": 3, "sine_rad": 0.04, "cosine_rad": -0.03}}
MOTIONS = ("square", "eight", "circle")
COUNTS = 108


def runs(effects, counts_later, seconds=8.0):
    """Runs of the omni robot, the third wheel's counter of each of which began so many counts elsewhere."""
    made = [generate("omni", motion, effects, seconds, 30 + i) for i, motion in enumerate(MOTIONS)]
    return [moved(run, later) for run, later in zip(made, counts_later, strict=True)]


def moved(run, later):
    encoder = run.channels["encoder"]
    values = encoder.values.copy()
    values[:, 2] += later * 2.0 * np.pi / COUNTS
    return replace(run, channels=run.channels | {"encoder": replace(encoder, values=values)})


def zeros(case):
    """(runs,) where the third wheel's counter of each begins [rad]."""
    every = case.prediction.tracks + (case.held_out.tracks if case.held_out is not None else [])
    return np.array([track.measured[0, 2] for track in every])


@pytest.mark.first_case
@pytest.mark.parametrize("held_out", [0, 1])
def test_phases_become_the_same_and_it_is_said(held_out):
    recorded = runs(ECCENTRIC, (0, 36, -30))
    case = prepare("omni_multirate", recorded[: 3 - held_out], recorded[3 - held_out :])
    after = with_counters_set(case)
    apart = np.ptp(np.unwrap(zeros(after) - zeros(prepare("omni_multirate", runs(ECCENTRIC, (0, 0, 0))))))
    assert apart < 0.2 and np.ptp(zeros(case)) > 3.0
    assert "encoders' zeros were moved" in after.warning and "wheel 3" in after.warning


@pytest.mark.first_case
@pytest.mark.parametrize(("effects", "later"), [(ECCENTRIC, (0, 0, 0)), ({}, (0, 36, -30))], ids=["same", "sound"])
def test_counters_that_agree_or_show_nothing_are_left(effects, later):
    case = prepare("omni_multirate", runs(effects, later))
    assert with_counters_set(case) is case


def test_one_counter_has_one_zero_however_long_it_counts():
    case = prepare("omni_multirate", [generate("omni", "eight", ECCENTRIC, 60.0, 7)])
    assert len(case.prediction.tracks) > 1 and with_counters_set(case) is case


@pytest.mark.filterwarnings("error")
def test_a_run_in_which_nothing_moves_shows_no_phase():
    parked = two_wheels.drive(3, 8.0)
    resting = {
        name: replace(channel, values=np.full_like(channel.values, 0.0 if name == "command" else 5.0))
        for name, channel in parked.channels.items()
    }
    case = prepare(two_wheels.model(), [replace(parked, channels=resting), *(two_wheels.drive(s, 8.0) for s in (4, 5))])
    assert with_counters_set(case) is case


@pytest.mark.slow
def test_zeros_stay_where_the_answer_needs_no_others():
    """Lost counts that are not in the model turn the phase of each run by another amount."""
    hidden = {
        "encoder_eccentricity": {"wheel": 2, "sine_rad": 0.05, "cosine_rad": -0.03},
        "encoder_lost_counts": {"wheel": 2, "share": 0.05},
    }
    motions = ("square", "eight", "circle") * 2
    few = [di.effects()[name] for name in (*hidden, "encoder_scale", "wheel_radius_error", "single_wheel_radius_error")]
    recorded = [generate("pendulum", motion, hidden, 12.0, 130 + i) for i, motion in enumerate(motions)]
    answer = di.explain("pendulum_multirate", recorded, effects=few)
    assert answer.verdict == "named" and {effect.name for effect in answer.effects} == hidden.keys()
    assert not any("zeros" in warning for warning in answer.warnings)


@pytest.mark.slow
def test_an_eccentric_encoder_is_named_though_each_run_has_a_zero_of_its_own():
    answer = di.explain("omni_multirate", runs(ECCENTRIC, (0, 36, -30), 12.0))
    (effect,) = answer.effects
    sizes = [effect.parameters[name].estimate for name in ("sine_rad", "cosine_rad")]
    assert answer.verdict == "named" and effect.name == "encoder_eccentricity"
    assert np.hypot(*sizes) == pytest.approx(0.05, rel=0.1)
