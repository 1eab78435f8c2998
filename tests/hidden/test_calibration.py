"""Without a hidden effect, whitened residuals are white and nothing is found."""

import numpy as np
import pytest

from drake_ispace.effects.library import library
from drake_ispace.explain.decide.proposals.detect import trials
from drake_ispace.explain.decide.survey.survey import survey
from drake_ispace.explain.explain import explain
from drake_ispace.explain.fit.candidates import candidates
from drake_ispace.explain.predict.case import prepare
from drake_ispace.hiding import hide
from drake_ispace.scenario import load_scenario
from hidden.effects_truth import ROBOTS
from hidden.generator import generate

MOTIONS = ("square", "eight")


def sound(robot, seed, process_noise=1.0, seconds=12.0):
    """Runs of a robot that lacks nothing."""
    return [generate(robot, motion, seconds=seconds, seed=seed + i, process_noise=process_noise)
            for i, motion in enumerate(MOTIONS)]


@pytest.fixture(scope="module", params=[
    pytest.param(robot, marks=[] if robot == "omni" else pytest.mark.slow) for robot in ROBOTS
])
def surveyed(request):
    case = prepare(f"{request.param}_multirate", sound(request.param, 70))
    return survey(case.prediction, {}, candidates(case.replay.effects, case.replay.body))


def parts(survey):
    """(stream, (rows, p) what nothing explains of the whitened residuals, (rows,) which of them are scored), by run."""
    whitening, at = survey.likelihood.whitening, 0
    for run, classes in zip(survey.residuals, whitening.classes, strict=True):
        for stream, noise in whitening.noise.items():
            rows, p = max(len(run[stream]) - noise.lags, 0), run[stream].shape[1]
            part = survey.noise[at : at + rows * p].reshape(rows, p)
            at += rows * p
            scored = classes[stream][noise.lags :] > 0 if stream in classes else np.ones(rows, bool)
            yield stream, part, scored


def test_whitened_residuals_are_white(surveyed):
    """They have unit size, and no correlation: at lag 1 over all runs, at larger lags in every run."""
    products = np.zeros(2)
    for stream, part, scored in parts(surveyed):
        if stream not in ("motion", "room"):
            continue
        size = np.sum(part[scored] ** 2, axis=0)
        assert part[scored].std() == pytest.approx(1.0, abs=0.1 if stream == "motion" else 0.25)
        for lag in (1, 2, 5, 20):
            both = scored[lag:] & scored[:-lag]
            product = np.sum(part[lag:][both] * part[:-lag][both], axis=0)
            if lag == 1:
                products += product.sum(), size.sum()
            else:
                assert np.abs(product / size).max() < 4.5 / np.sqrt(scored.sum()) + 0.02, (stream, lag)
    assert abs(products[0] / products[1]) < 0.05


def test_the_largest_minus_log10_p_on_noise_is_that_of_some_independent_effects(surveyed):
    """The tail of the largest -log10 p falls tenfold per unit, and fewer effects are independent than there are."""
    largest = trials(surveyed.screen, surveyed.by_instant, 0)
    tenth, half = np.quantile(largest, [0.9, 0.5])
    assert 0.5 < tenth - half < 1.5
    assert 10.0**tenth * -np.log(0.9) < 2.0 * len(surveyed.screen.candidates)


@pytest.mark.slow
def test_noise_of_another_kind_is_no_wrong_inertia():
    """A robot that is exactly the model, with torque and slip noise that is white instead of coloured."""
    model = load_scenario("pendulum_multirate")
    runs = hide(model, "pendulum", {}, ["square", "circle"], seed=6, seconds=5.0)
    assert explain(model, list(runs.values())).verdict == "none"


FEW = ("viscous_friction", "mass_error", "gyro_bias")


def is_sound(robot, process_noise, effects, seconds):
    """Whether nothing is found of these effects, None for all, in runs of a robot that lacks nothing."""
    some = effects and [library()[name] for name in effects]
    explanation = explain(f"{robot}_multirate", sound(robot, 80, process_noise, seconds), effects=some)
    assert explanation.verdict == "none" and explanation.detection.p_value > explanation.detection.false_alarm_rate
    assert explanation.effects == [] and explanation.model is None
    return True


def test_nothing_is_found_in_short_runs_where_one_effect_is_tried():
    assert is_sound("omni", 1.0, FEW[:1], 5.0)


@pytest.mark.slow
@pytest.mark.parametrize(("robot", "process_noise", "effects"), [
    ("pendulum", 0.3, FEW), *(
        pytest.param(robot, noise, None, marks=pytest.mark.slow)
        for robot, noise in (("omni", 0.3), ("omni", 1.0), ("pendulum", 0.3), ("pendulum", 1.0))
    ),
])
def test_nothing_is_found_where_nothing_is_hidden(robot, process_noise, effects):
    assert is_sound(robot, process_noise, effects, 8.0)
